"""Every effect of the contract: present, described, neutral at zero, felt at its typical size, symmetric, the same on
every back end and per run."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from shipbench.effects.base import EFFECTS, FAMILIES, Effect
from shipbench.errors import InputError
from shipbench.physics import eq2, mmg, wind
from shipbench.physics.actuators import gear_path
from shipbench.physics.modifiers import Flow, Modifiers
from shipbench.ship import complete
from shipbench.signals import STATES
from shipbench.simulate.hidden import Hidden, actuator_paths, gears_of, sail

CONTRACT = (
    "current", "current_per_run", "wind", "wind_per_run", "wave_drift", "shallow_water", "bank_suction",
    "rudder_offset", "rudder_gain", "race_gain", "rudder_stall", "rudder_asymmetry", "rudder_delay", "rudder_lag",
    "rudder_rate_limit",
    "rudder_deadband", "rudder_backlash", "thrust_gain", "added_resistance", "propeller_walk", "propeller_walk_astern",
    "wake_variation", "shaft_lag",
    "shaft_rate_limit", "thruster_gain", "thruster_speed_loss", "thruster_lag", "thruster_lever", "cross_flow_drag",
    "mass_change",
    "center_of_gravity_shift", "hull_derivatives", "list", "heading_bias", "yaw_rate_bias", "antenna_offset",
    "speed_scale", "position_delay",
    "velocity_delay", "unit_or_sign_error", "change_point",
)  # fmt: skip
NAMES = [
    name for name in EFFECTS.names() if name != "change_point"
]  # it has no values of its own: see test_change_point

MIRROR: dict[str, tuple[int, ...]] = {
    # the east component, at psi -> -psi
    "current": (1,), "current_per_run": (1,), "wind": (1,), "wind_per_run": (1,), "wave_drift": (1,),
    "bank_suction": (2,),  # the bearing
    "rudder_offset": (0,), "rudder_asymmetry": (0,), "propeller_walk": (0,), "propeller_walk_astern": (0, 1),
    "list": (0, 1),
    "heading_bias": (0,), "yaw_rate_bias": (0,), "antenna_offset": (1,),
}  # fmt: skip
"""Indices of the values that change sign in a mirror that exchanges port and starboard; none for the others."""

FLIPPED_STATES = np.array([1.0, -1.0, -1.0, 1.0, -1.0, -1.0, 1.0, -1.0, -1.0, -1.0])
CONTAINER = mmg.load_mmg_ship("container130")
PARTICULARS = complete(CONTAINER.particulars)
C = eq2.coefficients(PARTICULARS)
P = np.array([0.0, 2e4, 1e4, 1e3, 0.0, 3.0, 0.0, -1.5, 0.03, 0.0, 1.2])


def get(name: str) -> Effect:
    return EFFECTS.get(name)


def of(enters: str) -> list[str]:
    return [name for name in NAMES if get(name).enters == enters]


def typical(effect: Effect, L: float = 130.0) -> tuple[float, ...]:
    return tuple(p.typical for p in effect.sized(L))


def nothing(effect: Effect) -> tuple[float, ...]:
    """No amplitude; shape parameters as usual."""
    return tuple(p.typical if p.shape else 0.0 for p in effect.parameters)


@cache
def flow() -> Flow:
    """Motion at twelve instants, ahead and astern, with large rudder angles, both thrusters and reversed screws among
    them."""
    rng = np.random.default_rng(12)
    n = 12
    u, back = rng.uniform(1.0, 6.0, n), np.arange(n) >= 9
    return Flow(
        x=rng.uniform(-200, 150, n), y=rng.uniform(-200, 150, n), t=np.zeros(n), psi=rng.uniform(-3, 3, n),
        u=np.where(back, -0.4 * u, u),
        v=rng.uniform(-1, 1, n), r=rng.uniform(-0.015, 0.015, n), n=np.where(back, -1.0, 1.0) * rng.uniform(60, 120, n),
        delta=rng.uniform(-0.6, 0.6, n), F_b=rng.uniform(-4e4, 4e4, n), F_s=rng.uniform(-4e4, 4e4, n),
    )  # fmt: skip


def mirrored(s: Flow) -> Flow:
    odd = ("y", "psi", "v", "r", "delta", "F_b", "F_s")
    return s._replace(**{key: -getattr(s, key) for key in odd})


def on_eq2(s: Flow, effect: Effect | None, q=()) -> tuple:
    e = Modifiers()
    if effect is not None:
        effect.force(e, s, q, PARTICULARS)
    return eq2.accelerations(s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, (s.u, s.v), C, list(P), e)


def on_mmg(s: Flow, effect: Effect | None, q=()) -> tuple:
    e = Modifiers()
    if effect is not None:
        effect.force(e, s, q, PARTICULARS)
    return mmg.accelerations(CONTAINER, s.psi, s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, mods=e)


SHIPS = {"eq2": on_eq2, "mmg": on_mmg}


@cache
def record() -> np.ndarray:
    """Three recorded turns, (3, 30, 10)."""
    s0 = np.zeros((3, 10))
    s0[:, 3], s0[:, 6], s0[:, 2] = 4.5, 90.0, (0.3, -2.0, 1.0)
    U = np.zeros((3, 29, 4))
    U[..., 0], U[..., 1] = 90.0, np.array([0.3, -0.2, 0.1])[:, None]
    U[:, 10:, 1] *= -1.0
    U[:, 5:20, 2] = 3e4
    return sail(CONTAINER, s0, U, 1.0)


def commands() -> np.ndarray:
    U = np.zeros((2, 60, 4))
    U[:, :30] = (60.0, 0.5, 3e4, 2e4)
    U[:, 30:] = (110.0, -0.3, -2e4, 1e4)
    U[1] *= 0.7
    return U


def actuators(hidden: list[Hidden]) -> np.ndarray:
    return actuator_paths(CONTAINER, np.zeros((2, 10)), commands(), 1.0, 2, hidden)


# --- what every effect says of itself


def test_every_name_of_the_contract_has_its_file():
    assert set(EFFECTS.names()) >= set(CONTRACT)


@pytest.mark.parametrize("name", EFFECTS.names())
def test_an_effect_is_named_after_its_file_and_described(name: str):
    effect = get(name)
    assert effect.name == name
    assert effect.family in FAMILIES
    assert all(isinstance(text, str) and len(text) > 3 for text in (effect.summary, effect.source, effect.separate))
    module = __import__(type(effect).__module__, fromlist=["EFFECT"])
    assert len(module.__doc__ or "") > 30
    assert len({p.name for p in effect.parameters}) == len(effect.parameters)
    for p in effect.parameters:
        assert p.unit, p.name
        assert p.low < p.high, p.name
        assert p.low <= p.typical <= p.high, p.name
        assert p.shape or p.low <= 0.0 or name.endswith("rate_limit"), p.name
    assert len(effect.parameters) > 0 or name == "change_point"  # whose values are those of the effect that changes


@pytest.mark.parametrize("name", NAMES)
def test_every_reported_value_has_a_unit(name: str):
    assert set(get(name).units()) == set(get(name).public(typical(get(name))))


@pytest.mark.parametrize("name", NAMES)
def test_sizes_follow_froude(name: str):
    powers = {"1": 0.0, "m/s": 0.5, "s": 0.5, "rad/s": -0.5, "m": 1.0, "m^2": 2.0, "rpm/s": -1.0, "rad": 0.0}
    effect = get(name)
    for large, small in zip(effect.parameters, effect.sized(130.0 / 4.0), strict=True):
        factor = 4.0 ** -powers[large.unit]
        assert (small.typical, small.low, small.high) == pytest.approx(
            (large.typical * factor, large.low * factor, large.high * factor)
        )
    assert effect.sized(130.0) == effect.parameters


# --- neutral at zero, felt at a typical size


@pytest.mark.parametrize("ship", SHIPS)
@pytest.mark.parametrize("name", of("force"))
def test_no_size_is_exactly_the_plain_ship(name: str, ship: str):
    effect = get(name)
    for plain, same in zip(SHIPS[ship](flow(), None), SHIPS[ship](flow(), effect, nothing(effect)), strict=True):
        np.testing.assert_allclose(same, plain, rtol=1e-13, atol=1e-18)


@pytest.mark.parametrize("name", of("gear"))
def test_no_size_leaves_the_gears_as_built(name: str):
    assert gears_of(CONTAINER, [Hidden(get(name), (0.0,))]) == gears_of(CONTAINER, [])


@pytest.mark.parametrize("name", of("sensor"))
def test_no_size_leaves_the_record_as_it_is(name: str):
    effect = get(name)
    np.testing.assert_array_equal(effect.measure(record(), nothing(effect), 1.0), record())


@pytest.mark.parametrize("ship", SHIPS)
@pytest.mark.parametrize(
    "name", [name for name in of("force") if name != "wind_drift"]
)  # there is no wind here: see below
def test_a_typical_size_is_felt(name: str, ship: str):
    effect = get(name)
    plain, moved = np.array(SHIPS[ship](flow(), None)), np.array(SHIPS[ship](flow(), effect, typical(effect)))
    assert np.max(np.abs(moved - plain) / np.max(np.abs(plain), axis=1, keepdims=True)) > 1e-3


@pytest.mark.parametrize("name", of("gear"))
def test_a_typical_size_changes_the_path_of_the_actuator(name: str):
    effect = get(name)
    plain, moved = actuators([]), actuators([Hidden(effect, typical(effect))])
    assert np.max(np.abs(moved - plain) / np.max(np.abs(plain), axis=(0, 1))) > 0.01


@pytest.mark.parametrize("name", of("sensor"))
def test_a_typical_size_changes_the_record(name: str):
    effect = get(name)
    assert np.max(np.abs(effect.measure(record(), typical(effect), 1.0) - record())) > 1e-3


@pytest.mark.parametrize("value", [1.0, 1])
@pytest.mark.parametrize(
    ("name", "ship"),
    [("current", "eq2"), ("current", "mmg"), ("center_of_gravity_shift", "eq2"), ("rudder_asymmetry", "mmg")],
)
def test_a_size_of_one_is_not_taken_for_nothing(name: str, ship: str, value: float):
    effect, s = get(name), flow()._replace(psi=0.0)
    q = (value, 0.0)[: len(effect.parameters)]
    assert np.max(np.abs(np.array(SHIPS[ship](s, effect, q)) - np.array(SHIPS[ship](s, None)))) > 1e-6


# --- mirror


def mirrored_values(name: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    q = tuple(0.8 * v for v in typical(get(name)))
    odd = MIRROR.get(name, ())
    return q, tuple(-v if i in odd else v for i, v in enumerate(q))


@pytest.mark.parametrize("name", of("force"))
def test_port_and_starboard_are_mirror_images(name: str):
    q, image = mirrored_values(name)
    s = flow()
    du, dv, dr = on_eq2(s, get(name), q)
    mu, mv, mr = on_eq2(mirrored(s), get(name), image)
    np.testing.assert_allclose(mu, du, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(mv, -dv, rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(mr, -dr, rtol=1e-9, atol=1e-17)


@pytest.mark.parametrize("name", of("force"))
def test_what_breaks_a_symmetry_is_not_its_own_mirror_image(name: str):
    """The same values on both sides: a symmetric effect is its own mirror image."""
    q, _ = mirrored_values(name)
    here, there = (on_eq2(s, get(name), q) for s in (flow(), mirrored(flow())))
    alike = all(
        np.allclose(b, sign * a, rtol=1e-9, atol=1e-15)
        for a, b, sign in zip(here, there, (1.0, -1.0, -1.0), strict=True)
    )
    assert get(name).breaks_symmetry != alike


@pytest.mark.parametrize("name", of("sensor"))
def test_sensors_see_mirror_images(name: str):
    q, image = mirrored_values(name)
    seen = get(name).measure(record() * FLIPPED_STATES, image, 1.0)
    np.testing.assert_allclose(seen * FLIPPED_STATES, get(name).measure(record(), q, 1.0), rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", of("gear"))
def test_gears_treat_both_sides_alike(name: str):
    gear = gears_of(CONTAINER, [Hidden(get(name), typical(get(name)))])["delta"]
    side = commands()[..., 1]
    np.testing.assert_allclose(
        gear_path(np.zeros(2), -side, 1.0, gear, 4), -gear_path(np.zeros(2), side, 1.0, gear, 4), atol=1e-15
    )


# --- back ends and values per run


@pytest.mark.parametrize("name", of("force"))
def test_numpy_torch_and_casadi_agree(name: str):
    torch, casadi = pytest.importorskip("torch"), pytest.importorskip("casadi")
    effect, s = get(name), flow()
    q = typical(effect)
    wanted = np.array(on_eq2(s, effect, q))
    tensors = Flow(*(torch.tensor(v, dtype=torch.float64) for v in s))
    sizes = [torch.tensor(v, dtype=torch.float64) for v in q]
    np.testing.assert_allclose(torch.stack(on_eq2(tensors, effect, sizes)).numpy(), wanted, rtol=1e-9, atol=1e-15)
    state, size = casadi.SX.sym("s", len(s)), casadi.SX.sym("q", len(q))
    found = on_eq2(Flow(*casadi.vertsplit(state)), effect, casadi.vertsplit(size))
    f = casadi.Function("f", [state, size], [casadi.vertcat(*found)])
    np.testing.assert_allclose(
        np.array(f.map(len(s.u))(np.array(s), np.tile(np.array(q)[:, None], len(s.u)))), wanted, rtol=1e-9, atol=1e-15
    )


@pytest.mark.parametrize("ship", SHIPS)
@pytest.mark.parametrize("name", of("force"))
def test_forces_of_values_per_run_are_those_of_each_run(name: str, ship: str):
    effect, s = get(name), flow()
    share = np.linspace(0.2, 1.0, len(s.u))
    together = np.array(SHIPS[ship](s, effect, tuple(v * share for v in typical(effect))))
    for i, part in enumerate(share):
        alone = SHIPS[ship](Flow(*(v[i] for v in s)), effect, tuple(v * part for v in typical(effect)))
        np.testing.assert_allclose(together[:, i], np.array(alone, dtype=float), rtol=1e-10, atol=1e-16)


@pytest.mark.parametrize("name", of("sensor"))
def test_records_with_values_per_run_are_those_of_each_run(name: str):
    effect, share = get(name), np.array([0.3, 0.6, 1.0])
    q = tuple(p.typical * np.where(p.shape, 1.0, share) for p in effect.parameters)
    together = effect.measure(record(), q, 1.0)
    for i in range(3):
        np.testing.assert_allclose(
            together[i : i + 1],
            effect.measure(record()[i : i + 1], tuple(float(v[i]) for v in q), 1.0),
            rtol=1e-12,
            atol=1e-12,
        )


@pytest.mark.parametrize("name", of("gear"))
def test_gears_with_values_per_run_are_those_of_each_run(name: str):
    effect, share = get(name), np.array([0.0, 0.8])
    value = effect.parameters[0].typical
    together = actuators([Hidden(effect, (value * share,))])
    for i in range(2):
        alone = actuators([Hidden(effect, (float(value * share[i]),))])
        np.testing.assert_allclose(together[i], alone[i], rtol=1e-10, atol=1e-9)


# --- reported values


@pytest.mark.parametrize("name", NAMES)
def test_reported_values_lead_back_to_the_size(name: str):
    effect = get(name)
    q = tuple(0.7 * v for v in typical(effect)) if name != "unit_or_sign_error" else (-2.0, 5.0)
    assert effect.internal(effect.public(q)) == pytest.approx(q, rel=1e-12)
    with pytest.raises(InputError, match=f"effect '{name}' has no parameter 'sise'"):
        effect.internal({"sise": 1.0})


@pytest.mark.parametrize("name", [name for name in NAMES if get(name).vector])
def test_a_vector_is_reported_as_size_and_direction(name: str):
    effect = get(name)
    size, direction = effect.vector
    assert effect.public((0.0, -2.0)) == pytest.approx({size: 2.0, direction: 1.5 * np.pi})
    assert effect.units() == {size: effect.parameters[0].unit, direction: "rad"}
    with pytest.raises(InputError, match=f"{size} is missing"):
        effect.internal({direction: 1.0})


def test_values_not_given_are_zero_and_shapes_typical():
    assert get("rudder_stall").internal({"lost_share": 0.2}) == (0.2, 0.3)
    assert get("hull_derivatives").internal({"N_r": 0.1}) == (0.0, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_the_states_stand_in_the_order_that_the_mirror_assumes():
    assert [s for s, f in zip(STATES, FLIPPED_STATES, strict=True) if f < 0] == [
        "y",
        "psi",
        "v",
        "r",
        "delta",
        "F_b",
        "F_s",
    ]


# --- delays, and wind as a fit sees it


def test_the_slope_of_a_delayed_record_does_not_jump_at_whole_samples():
    S, effect = record(), get("position_delay")
    left, at, right = (effect.measure(S, (1.0 + d,), 1.0)[:, 5:-5, :2] for d in (-1e-4, 0.0, 1e-4))
    np.testing.assert_allclose((at - left) / 1e-4, (right - at) / 1e-4, atol=1e-2)
    np.testing.assert_allclose(at, S[:, 4:-6, :2], atol=1e-12)


def test_a_delay_goes_on_as_the_run_began_and_ended():
    S = np.zeros((1, 8, 10))
    S[0, :, 0] = 3.0 * np.arange(8)
    for delay in (1.7, -2.4):
        np.testing.assert_allclose(
            get("position_delay").measure(S, (delay,), 1.0)[0, :, 0], 3.0 * (np.arange(8) - delay), atol=1e-12
        )


def test_velocities_late_in_the_earths_axes_turn_with_the_ship():
    """A ship that drifts in a straight line while it turns: its earth-fixed velocity is constant, so that no delay of
    it shows."""
    S, effect = np.zeros((1, 30, 10)), get("velocity_delay")
    S[0, :, 2] = 0.05 * np.arange(30)
    S[0, :, 3], S[0, :, 4] = 4.0 * np.cos(S[0, :, 2]), -4.0 * np.sin(S[0, :, 2])
    np.testing.assert_allclose(effect.measure(S, (2.3, 1.0), 1.0), S, atol=1e-12)
    assert np.max(np.abs(effect.measure(S, (2.3, 0.0), 1.0) - S)) > 0.3


@pytest.mark.parametrize("own", [0.0, 1.0])
def test_the_velocities_of_an_antenna_are_midships_or_its_own(own: float):
    """On a ship that turns on the spot and drifts: its own are those at which the recorded position moves."""
    S, dt = np.zeros((1, 400, 10)), 0.05
    t = dt * np.arange(400)
    S[0, :, 2], S[0, :, 5] = 0.3 * np.sin(t), 0.3 * np.cos(t)
    S[0, :, 0], S[0, :, 3], S[0, :, 4] = 2.0 * t, 2.0 * np.cos(S[0, :, 2]), -2.0 * np.sin(S[0, :, 2])
    x, y, psi, u, v = get("antenna_offset").measure(S, (-9.0, 4.0, own), dt)[0, :, :5].T
    earth = (u + 1j * v) * np.exp(1j * psi)
    assert bool(np.max(np.abs(np.gradient(x + 1j * y, dt) - earth)[1:-1]) < 0.01) is bool(own)


@pytest.mark.parametrize("name", ["wind", "wind_per_run"])
def test_stretched_wind_says_the_wind_that_it_pushes_with(name: str):
    plain = get(name)
    for fitted in plain.fitted(130.0):
        for q in ((7.0, 0.0), (-2.0, 3.0), (0.1, 0.0)):
            said = fitted.public(q)
            stretched, wind = Modifiers(), Modifiers()
            fitted.force(stretched, flow(), q, PARTICULARS)
            plain.force(wind, flow(), plain.internal(said), PARTICULARS)
            np.testing.assert_allclose(
                (stretched.air_u, stretched.air_v), (wind.air_u, wind.air_v), rtol=1e-9, atol=1e-9
            )
        assert fitted.public((7.0, 0.0))["speed"] == pytest.approx(7.0, rel=1e-6)  # the typical wind is itself
        assert (fitted.name, fitted.enters, fitted.per_run) == (plain.name, plain.enters, plain.per_run)


@pytest.mark.parametrize("L", [25.0, 130.0])
def test_a_fitted_wind_has_the_bounds_of_the_wind_that_it_means(L: float):
    plain = get("wind")
    for fitted in plain.fitted(L):
        for own, meant in zip(fitted.sized(L), plain.sized(L), strict=True):
            assert fitted.public((own.high, 0.0))["speed"] == pytest.approx(meant.high, rel=1e-6)
            assert (own.low, own.typical) == pytest.approx((-own.high, meant.typical))
            assert meant.high > 25.0  # a storm, which blows on boats too


def test_wind_coefficients_scale_the_wind_alone():
    effect = get("wind_coefficients")
    still, moved = Modifiers(), Modifiers()
    effect.force(moved, flow(), (0.5, -0.2, -1.0, 10.0), PARTICULARS)
    s, air = flow(), (flow().u + 8.0, flow().v - 5.0)
    one = eq2.accelerations(s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, air, C, list(P), still)
    other = eq2.accelerations(s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, air, C, list(P), moved)
    calm = eq2.accelerations(s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, None, C, list(P), moved)
    np.testing.assert_allclose(
        calm, eq2.accelerations(s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, None, C, list(P), still)
    )
    X, Y, N = wind.harmonic(*air, C.A_F, C.A_L, C.L)
    np.testing.assert_allclose((other[0] - one[0]) * (C.m + C.m_x), 0.5 * X, rtol=1e-9)
    dY = C.m11 * (other[1] - one[1]) + C.m12_Y * (other[2] - one[2])
    dN = C.m12_N * (other[1] - one[1]) + C.m22 * (other[2] - one[2])
    np.testing.assert_allclose(dY, -0.2 * Y, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(dN, -N + 10.0 * Y, rtol=1e-6, atol=1e-1)


def test_the_water_drifts_with_the_wind():
    """In both ships: a drift of 2 % of the measured wind is the current of that size beside the same wind; without wind
    it is nothing."""
    drift, current, s = get("wind_drift"), get("current"), flow()
    speed, bearing = 8.0, 0.7
    air = wind.apparent_wind(s.psi, s.u, s.v, speed, bearing)
    towards = (-0.02 * speed * np.cos(bearing), -0.02 * speed * np.sin(bearing))
    for effect, q in ((drift, (0.02,)), (current, towards)):
        e = Modifiers()
        effect.force(e, s, q, PARTICULARS)
        one = eq2.accelerations(s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, air, C, list(P), e)
        env = mmg.Environment(wind_speed=speed, wind_from=bearing)
        other = mmg.accelerations(CONTAINER, s.psi, s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, env, e)
        if effect is drift:
            wanted = one, other
    np.testing.assert_allclose(one, wanted[0], rtol=1e-9, atol=1e-15)
    np.testing.assert_allclose(other, wanted[1], rtol=1e-9, atol=1e-15)
    for ship in SHIPS.values():
        np.testing.assert_allclose(ship(s, drift, (0.02,)), ship(s, None), rtol=1e-12, atol=1e-15)


def test_going_astern_turns_the_moment_of_drift_over():
    """At q = 1 the linear moment of drift is that of v u: ahead as it was, astern with its sign changed; alone, without
    rudder and yaw."""
    effect, plain = get("going_astern"), np.zeros(11)
    v, zero = np.array([0.3, 0.3, -0.3, -0.3]), np.zeros(4)
    u = np.array([5.0, -5.0, 5.0, -5.0])
    state = Flow(zero, zero, zero, zero, u, v, zero, zero, zero, zero, zero)

    def sway_and_yaw(q: tuple[float, ...]) -> tuple[np.ndarray, np.ndarray]:
        e = Modifiers()
        effect.force(e, state, q, PARTICULARS)
        _, dv, dr = eq2.accelerations(u, v, zero, zero, zero, zero, zero, None, C, list(plain), e)
        return C.m11 * dv + C.m12_Y * dr, C.m12_N * dv + C.m22 * dr

    (Y, N), (Y_turned, N_turned) = sway_and_yaw((0.0, 0.0, 0.0, 0.0)), sway_and_yaw((1.0, 0.0, 0.0, 0.0))
    np.testing.assert_allclose(N[0], N[1], rtol=1e-9)
    np.testing.assert_allclose(N_turned[[0, 2]], N[[0, 2]], rtol=0.02)
    np.testing.assert_allclose(N_turned[[1, 3]], -N[[1, 3]], rtol=0.02)
    np.testing.assert_allclose(Y_turned, Y, rtol=1e-9)


def test_banks_lie_along_the_way_that_was_sailed():
    """Runs up and down a channel to the north-east: two of four banks lie beside them, and may both be there."""
    along, across = np.linspace(-2000.0, 2000.0, 50), np.tile([-40.0, 40.0], 25)
    towards = np.array([[np.cos(0.75), np.sin(0.75)], [-np.sin(0.75), np.cos(0.75)]])
    settings = get("bank_suction").settings(np.column_stack([along, across]) @ towards, PARTICULARS)
    beside = [(line, channel) for bearing, line, channel in settings if abs(np.cos(bearing - 0.75)) < 0.01]
    breadth = PARTICULARS.B
    away = 40.0 + 2.0 * breadth
    channels = [(away - i * breadth, 2.0 * away - (i + j) * breadth) for i, j in ((0, 0), (1, 0), (0, 1), (1, 1))]
    assert len(settings) == 8
    assert np.ravel(beside) == pytest.approx(np.ravel([(away, 0.0), (away, 0.0), *channels]), abs=0.5 * breadth)


def test_in_the_middle_of_a_channel_banks_are_not_felt_and_far_banks_leave_the_near_one():
    def force(y: float, channel: float) -> list[float]:
        e, zero = Modifiers(), np.zeros(1)
        state = Flow(zero, zero + y, zero, zero, zero + 3.0, *[zero] * 6)
        get("bank_suction").force(e, state, (0.3, 0.0, 0.5 * np.pi, 100.0, channel), PARTICULARS)
        return [float(np.squeeze(x)) for x in (e.Y, e.N)]

    np.testing.assert_allclose(force(0.0, 200.0), 0.0, atol=1e-6)
    np.testing.assert_allclose(force(60.0, 200.0), np.negative(force(-60.0, 200.0)), rtol=1e-9)
    assert force(60.0, 200.0)[0] > 0.0
    np.testing.assert_allclose(force(60.0, 1e6), force(60.0, 0.0), rtol=1e-3)
