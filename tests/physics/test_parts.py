"""The five kinds of test that every physics part has: limit, symmetry, dimension, reference, back ends."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from shipbench.physics import actuators, eq2, hull, mmg, propeller, regressions, rudder, shallow_water, thruster, wind
from shipbench.physics.modifiers import Modifiers
from shipbench.ship import complete

SHIP = mmg.load_mmg_ship("container130")
POLY = mmg.load_mmg_ship("kcs").hull
C = eq2.coefficients(complete(SHIP.particulars))
P = [0.1, 2e3, 5e3, 50.0, 0.03, 1.8, 0.1, -1.0, 0.02, 0.02, 1.2]
P_SYMMETRIC = [0.0, 2e3, 5e3, 50.0, 0.0, 1.8, 0.0, -1.0, 0.02, 0.0, 1.2]


def _inflow(u, n, thrust):
    return rudder.inflow_speed(u, n, thrust, 0.3, SHIP.rudder, 3.8, 1025.0)


def _eq2(u, v, r, n, delta, F_b, F_s):
    return eq2.accelerations(u, v, r, n, delta, F_b, F_s, None, C, P)


def _eq2_symmetric(u, v, r, n, delta, F_b, F_s):
    return eq2.accelerations(u, v, r, n, delta, F_b, F_s, None, C, P_SYMMETRIC)


def _mmg(u, v, r, n, delta, F_b, F_s):
    return mmg.accelerations(SHIP, 0.3, u, v, r, n, delta, F_b, F_s, mmg.Environment(0.3, 1.0, 5.0, 2.0, 9.0))


@dataclass(frozen=True)
class Part:
    """A formula, the ranges of its arguments, and which arguments and results change sign in the mirror (None: no such
    symmetry)."""

    name: str
    f: Callable
    ranges: tuple[tuple[float, float], ...]
    flips: tuple[int, ...] | None = None
    odd: tuple[int, ...] = ()


U_, V_, R_, N_, D_, F_ = (-2.0, 7.0), (-1.0, 1.0), (-0.02, 0.02), (-3.0, 3.0), (-0.7, 0.7), (-6e4, 6e4)
RPM = (-180.0, 180.0)
BLADE = replace(SHIP.rudder, gamma_plus=0.4, gamma_minus=0.4)
PARTS = [
    Part(
        "hull.polynomial",
        lambda u, v, r: hull.polynomial(u, v, r, POLY, 130.0, 6.1, 1025.0),
        (U_, V_, R_),
        (1, 2),
        (1, 2),
    ),
    Part(
        "hull.unified",
        lambda u, v, r: hull.unified(u, v, r, SHIP.hull, 130.0, 6.1, 1025.0),
        (U_, V_, R_),
        (1, 2),
        (1, 2),
    ),
    Part("hull.cross_flow", lambda v, r: hull.cross_flow(v, r, 130.0, 2.2, 1.9), (V_, R_), (0, 1), (0, 1)),
    Part("hull.tilted_cross_flow", lambda v, r: hull.tilted_cross_flow(v, r, 130.0), (V_, R_), (0, 1), (0, 1)),
    Part(
        "propeller.quadratic",
        lambda n, a: (propeller.thrust_quadratic(n, a, 3.8, (0.356, -0.3055, -0.1338), 1025.0),),
        (N_, U_),
    ),
    Part("propeller.four_quadrant", lambda n, a: (propeller.thrust_four_quadrant(n, a, 3.8, 1025.0),), (N_, U_)),
    Part(
        "propeller.wake",
        lambda u, v, r: (propeller.wake_fraction(u, v, r, 0.33, -59.0, 2.0, 1.4, 1.4),),
        (U_, V_, R_),
        (1, 2),
        (),
    ),
    Part("propeller.side_force", lambda n, u: propeller.side_force_astern(n, u, 3.8, 130.0, 6.1, 1025.0), (N_, U_)),
    Part("propeller.race_through", lambda a, t: (propeller.race_through(a, t, 3.8, 1025.0),), (U_, (0.0, 5e5))),
    Part("propeller.race", lambda a, t: (propeller.race_speed(a, t, 3.8, 1025.0),), (U_, (0.0, 5e5))),
    Part("rudder.inflow", lambda u, n, t: (_inflow(u, n, t),), (U_, N_, (-3e5, 5e5))),
    Part(
        "rudder.mmg",
        lambda u, v, r, d, w: rudder.mmg_rudder(u, v, r, d, w, BLADE, 130.0, 1025.0),
        (U_, V_, R_, D_, U_),
        (1, 2, 3),
        (1, 2),
    ),
    Part("thruster", lambda u, b, s: thruster.tunnel_thrusters(u, b, s, SHIP.thrusters), (U_, F_, F_), (1, 2), (0, 1)),
    Part(
        "wind.blendermann",
        lambda a, b: wind.blendermann(a, b, 350.0, 1800.0, 130.0),
        ((-20.0, 20.0), (-20.0, 20.0)),
        (1,),
        (1, 2),
    ),
    Part(
        "wind.harmonic",
        lambda a, b: wind.harmonic(a, b, 350.0, 1800.0, 130.0),
        ((-20.0, 20.0), (-20.0, 20.0)),
        (1,),
        (1, 2),
    ),
    Part(
        "actuators.lag",
        lambda a, c: (actuators.lag_with_rate_limit(a, c, 0.7, 2.0, 0.1),),
        ((-1.0, 1.0), (-1.0, 1.0)),
        (0, 1),
        (0,),
    ),
    Part("shallow_water", lambda h: (shallow_water.depth_factors(h, 130.0, 18.2, 6.1, 0.65).m_y,), ((7.0, 60.0),)),
    Part("eq2", _eq2, (U_, V_, R_, RPM, D_, F_, F_)),
    Part("eq2.symmetric", _eq2_symmetric, (U_, V_, R_, RPM, D_, F_, F_), (1, 2, 4, 5, 6), (1, 2)),
    Part("mmg", _mmg, (U_, V_, R_, RPM, D_, F_, F_)),
]
BY_NAME = pytest.mark.parametrize("part", PARTS, ids=lambda p: p.name)


def _points(part: Part, num: int = 400) -> list[np.ndarray]:
    rng = np.random.default_rng(7)
    return [rng.uniform(low, high, num) for low, high in part.ranges]


@BY_NAME
def test_numpy_torch_and_casadi_agree(part: Part):
    import casadi as ca
    import torch

    args = _points(part)
    expected = np.stack([np.broadcast_to(x, args[0].shape) for x in part.f(*args)])
    torched = part.f(*(torch.tensor(a, dtype=torch.float64) for a in args))
    scale = np.max(np.abs(expected), axis=1, keepdims=True) + 1e-300
    assert np.max(np.abs(np.stack([t.numpy() for t in torched]) - expected) / scale) < 1e-11
    symbols = [ca.SX.sym(f"a{i}") for i in range(len(args))]
    function = ca.Function("f", symbols, [ca.vertcat(*part.f(*symbols))]).map(len(args[0]))
    assert np.max(np.abs(np.asarray(function(*(a[None] for a in args))) - expected) / scale) < 1e-11


@BY_NAME
def test_torch_gradient_is_the_finite_difference(part: Part):
    import torch

    args = _points(part, 60)
    tensors = [torch.tensor(a, dtype=torch.float64, requires_grad=True) for a in args]
    for j, out in enumerate(part.f(*tensors)):
        grads = torch.autograd.grad(out.sum(), tensors, retain_graph=True, allow_unused=True)
        for i, (low, high) in enumerate(part.ranges):
            h = 1e-6 * (high - low)
            up, down = ([a + s * h * (k == i) for k, a in enumerate(args)] for s in (1, -1))
            slope = (np.asarray(part.f(*up)[j]) - np.asarray(part.f(*down)[j])) / (2 * h)
            grad = np.zeros_like(slope) if grads[i] is None else grads[i].numpy()
            size = np.max(np.abs(slope)) + 1e-12
            # A point may sit on a kink (|v|, a clip): nine in ten must agree to 1e-4 of the greatest slope.
            assert np.mean(np.abs(slope - grad) < 1e-4 * size) > 0.9, (part.name, j, i)


@BY_NAME
def test_everything_is_finite_at_rest_and_in_all_quadrants(part: Part):
    corners = np.stack(np.meshgrid(*[(low, 0.0, high) for low, high in part.ranges], indexing="ij")).reshape(
        len(part.ranges), -1
    )
    corners = np.clip(corners, [[low] for low, _ in part.ranges], [[high] for _, high in part.ranges])
    for out in part.f(*corners):
        assert np.isfinite(out).all()


@pytest.mark.parametrize("part", [p for p in PARTS if p.flips is not None], ids=lambda p: p.name)
def test_port_is_the_mirror_of_starboard(part: Part):
    args = _points(part)
    mirrored = [-a if i in part.flips else a for i, a in enumerate(args)]
    for j, (out, other) in enumerate(zip(part.f(*args), part.f(*mirrored), strict=True)):
        np.testing.assert_allclose(other, -out if j in part.odd else out, rtol=1e-9, atol=1e-9 * np.max(np.abs(out)))


# -- limits
# ----------------------------------------------------------------------------------------------------------------------


def test_hull_and_thrusters_give_nothing_at_rest():
    for f in (hull.polynomial, hull.unified):
        assert np.allclose(f(0.0, 0.0, 0.0, POLY if f is hull.polynomial else SHIP.hull, 130.0, 6.1, 1025.0), 0.0)
    assert thruster.tunnel_thrusters(0.0, 1e4, 0.0, SHIP.thrusters) == (1e4, pytest.approx(54.6e4))


def test_a_drag_that_is_larger_forward_turns_a_ship_pushed_sideways_and_pushes_one_that_turns():
    L, v, r = 130.0, 0.7, 0.01
    Y, N = hull.tilted_cross_flow(np.array([v, 0.0]), np.array([0.0, r]), L)
    np.testing.assert_allclose(
        Y, [0.0, (L * r) ** 2 / 16.0], atol=1e-12, rtol=2e-3
    )  # 2 int xi^3 sign(xi) over the length
    np.testing.assert_allclose(N, [v**2 / 6.0, 0.0], atol=1e-12)


def test_pure_sway_meets_the_cross_flow_drag_of_a_plate():
    _, Y, N = hull.unified(0.0, 0.5, 0.0, SHIP.hull, 130.0, 6.1, 1025.0)
    assert pytest.approx(-0.5 * 1025 * 130 * 6.1 * 0.80 * 0.25) == Y
    assert abs(N) < 1e-6 * abs(Y) * 130


def test_wake_is_the_published_one_straight_ahead_and_none_astern():
    assert propeller.wake_fraction(3.0, 0.0, 0.0, 0.40, -3.4, 2.0, 1.6, 1.1) == pytest.approx(0.40)
    assert propeller.wake_fraction(-1.0, 0.2, 0.0, 0.40, -3.4, 2.0, 1.6, 1.1) == 0.0


def test_wake_falls_at_drift_as_published():
    beta = np.arctan2(0.5, 3.001)
    expected = 1 - 0.6 * (1 + (1 - np.exp(-2.0 * beta)) * 0.6)
    assert propeller.wake_fraction(3.0, -0.5, 0.0, 0.40, -3.4, 2.0, 1.6, 1.1) == pytest.approx(expected)


def test_rudder_gives_no_force_at_zero_angle_straight_ahead():
    assert np.allclose(rudder.mmg_rudder(4.0, 0.0, 0.0, 0.0, 3.0, SHIP.rudder, 130.0, 1025.0), 0.0)


def test_rudder_works_at_rest_in_the_race_of_a_kick_ahead():
    thrust = propeller.thrust_four_quadrant(1.5, 0.0, 3.8, 1025.0)
    expected = 0.956 * 0.633 * np.sqrt(3.8 / 5.04) * np.sqrt(8 * thrust / (1025 * np.pi * 3.8**2))
    assert rudder.inflow_speed(0.0, 1.5, thrust, 0.0, SHIP.rudder, 3.8, 1025.0) == pytest.approx(expected, rel=1e-6)


def test_rudder_loses_its_flow_when_backing_with_headway():
    ahead = _inflow(3.0, 1.5, 1.5e5)
    assert abs(_inflow(3.0, -1.5, -1.5e5)) < 0.5 * ahead


def test_side_force_going_astern_pushes_the_stern_to_port():
    Y, N = propeller.side_force_astern(-2.5, 1.0, 3.8, 130.0, 6.1, 1025.0)
    assert Y < 0 < N
    assert propeller.side_force_astern(2.5, 1.0, 3.8, 130.0, 6.1, 1025.0) == (0.0, 0.0)


def test_head_wind_drags_and_wind_from_starboard_pushes_to_port():
    for model in (wind.blendermann, wind.harmonic):
        X, Y, _ = model(*wind.apparent_wind(0.0, 0.0, 0.0, 10.0, 0.0), 350.0, 1800.0, 130.0)
        assert X < 0
        assert abs(Y) < 1e-6 * abs(X)
        assert model(*wind.apparent_wind(0.0, 0.0, 0.0, 10.0, np.pi / 2), 350.0, 1800.0, 130.0)[1] < 0
        assert model(*wind.apparent_wind(0.0, 0.0, 0.0, 10.0, np.pi / 4), 350.0, 1800.0, 130.0)[2] < 0


def test_deep_water_changes_nothing_and_shallow_water_makes_everything_heavier():
    deep, shallow = (shallow_water.depth_factors(h, 130.0, 18.2, 6.1, 0.65) for h in (2000.0, 8.0))
    for f in (deep.hull.Y_v, deep.hull.N_v, deep.hull.N_r, deep.m_y, deep.J_z):
        assert f == pytest.approx(1.0, abs=0.02)
    assert shallow.hull.Y_v > 1.3
    assert shallow.m_y > 1.5
    assert shallow.hull.resistance > 1.1


def test_thruster_moment_is_halved_at_four_knots_and_back_at_fifteen():
    full = thruster.tunnel_thrusters(0.0, 1e4, 0.0, SHIP.thrusters)[1]
    assert thruster.tunnel_thrusters(2.1, 1e4, 0.0, SHIP.thrusters)[1] == pytest.approx(0.5 * full)
    assert thruster.tunnel_thrusters(7.7, 1e4, 0.0, SHIP.thrusters)[1] > 0.99 * full


def test_actuator_moves_at_its_rate_limit_and_then_settles():
    assert actuators.lag_with_rate_limit(0.0, 1.0, 1.0, 2.0, 0.1) == pytest.approx(0.1)
    assert actuators.lag_with_rate_limit(0.9, 1.0, 3.0, 2.0, 0.1) == pytest.approx(1.0 - 0.1 * np.exp(-1.5))
    two_halves = actuators.lag_with_rate_limit(
        actuators.lag_with_rate_limit(0.0, 0.3, 1.0, 2.0, 0.1), 0.3, 1.0, 2.0, 0.1
    )
    assert actuators.lag_with_rate_limit(0.0, 0.3, 2.0, 2.0, 0.1) == pytest.approx(two_halves, rel=1e-12)


# -- dimension
# -------------------------------------------------------------------------------------------------------------------


def _scaled(ship: mmg.MMGShip, s: float) -> mmg.MMGShip:
    """The geometrically similar ship at length scale `s` in the same water."""
    p, b = ship.propeller, ship.rudder
    return replace(
        ship, L=ship.L * s, B=ship.B * s, T=ship.T * s, m=ship.m * s**3, x_G=ship.x_G * s, I_zG=ship.I_zG * s**5,
        m_x=ship.m_x * s**3,
        m_y=ship.m_y * s**3, J_z=ship.J_z * s**5, propeller=replace(p, D=p.D * s, x_P=p.x_P * s),
        rudder=replace(b, A_R=b.A_R * s**2, H_R=b.H_R * s, c_pr=0.0), A_F=ship.A_F * s**2, A_L=ship.A_L * s**2,
        thrusters=replace(ship.thrusters, x_bow=ship.thrusters.x_bow * s, x_stern=ship.thrusters.x_stern * s,
            loss_force=0.0, loss_moment=0.0),
    )  # fmt: skip


def test_an_actuator_stops_at_the_edge_of_its_deadband_whatever_the_step():
    command = np.repeat([[0.3, 0.29, -0.2, -0.21, 0.0]], 12, axis=1)
    gear = actuators.Gear(T=1.5, rate=0.05, deadband=0.02)
    coarse, fine = (actuators.gear_path(np.zeros(1), command, 1.0, gear, k)[:, ::k] for k in (1, 40))
    np.testing.assert_allclose(coarse, fine, atol=1e-12)
    assert coarse[0, 24] == pytest.approx(
        0.3 - 0.02
    )  # on its way up it stops within the band and stays, whatever the command does inside it


def test_a_froude_scaled_ship_moves_alike():
    s = 0.04
    ship = _scaled(SHIP, 1.0)
    u, v, r, n, d, b, f = _points(PARTS[-1], 200)
    u = np.abs(u) + 0.5
    full = mmg.accelerations(ship, 0.2, u, v, r, n, d, b, f)
    k = np.sqrt(s)
    model = mmg.accelerations(_scaled(SHIP, s), 0.2, u * k, v * k, r / k, n / k, d, b * s**3, f * s**3)
    for a, c, unit in zip(full, model, (1.0, 1.0, 1.0 / s), strict=True):
        np.testing.assert_allclose(c, a * unit, rtol=2e-3, atol=2e-3 * np.max(np.abs(a)) * unit)


def test_eq2_of_a_froude_scaled_ship_scales():
    s = 0.04
    known = complete(SHIP.particulars)
    small = known.model_copy(
        update={k: getattr(known, k) * s for k in ("L", "B", "T", "xG", "D_P", "x_P", "H_R", "x_R", "x_bow", "x_stern")}
        | {k: getattr(known, k) * s**2 for k in ("A_R", "A_F", "A_L")} | {"mass": known.mass * s**3,
            "Izz": known.Izz * s**5}
    )  # fmt: skip
    u, v, r, n, d, b, f = _points(PARTS[-1], 200)
    k = np.sqrt(s)
    p_small = [P[0], P[1] * s**2.5, P[2] * s**2, P[3] * s**1.5, *P[4:]]
    full = eq2.accelerations(u, v, r, n, d, b, f, None, C, P)
    model = eq2.accelerations(u * k, v * k, r / k, n / k, d, b * s**3, f * s**3, None, eq2.coefficients(small), p_small)
    for a, c, unit in zip(full, model, (1.0, 1.0, 1.0 / s), strict=True):
        np.testing.assert_allclose(c, a * unit, rtol=1e-3, atol=1e-3 * np.max(np.abs(a)) * unit)


# -- reference
# -------------------------------------------------------------------------------------------------------------------


def test_four_quadrant_thrust_meets_the_wageningen_polynomial():
    for J, value in {0.0: 0.354, 0.2: 0.291, 0.4: 0.212, 0.6: 0.123, 0.8: 0.028}.items():
        assert float(propeller.thrust_coefficient_four_quadrant(np.float64(J))) == pytest.approx(value, abs=0.01)


def test_bollard_thrust_astern_is_74_percent_of_ahead():
    ahead, astern = (propeller.thrust_four_quadrant(n, 0.0, 3.8, 1025.0) for n in (3.0, -3.0))
    assert ahead == pytest.approx(667e3, rel=0.01)
    assert astern == pytest.approx(-491e3, rel=0.01)


def test_quadratic_thrust_is_the_k_t_polynomial():
    n, V_A, D = 1.5, 2.0, 3.8
    J = V_A / (n * D)
    expected = 1025 * n**2 * D**4 * (0.356 - 0.3055 * J - 0.1338 * J**2)
    assert propeller.thrust_quadratic(n, V_A, D, (0.356, -0.3055, -0.1338), 1025.0) == pytest.approx(expected)


def test_rudder_inflow_is_the_printed_mmg_form():
    u, n, w, D = 4.0, 1.55, 0.33, 3.8
    T = float(propeller.thrust_four_quadrant(n, (1 - w) * u, D, 1025.0))
    J, K_T = (1 - w) * u / (n * D), T / (1025 * n**2 * D**4)
    eta, eps, kappa = D / 5.04, 0.956, 0.633
    printed = (
        eps * (1 - w) * u * np.sqrt(eta * (1 + kappa * (np.sqrt(1 + 8 * K_T / (np.pi * J**2)) - 1)) ** 2 + (1 - eta))
    )
    assert rudder.inflow_speed(u, n, T, w, SHIP.rudder, D, 1025.0) == pytest.approx(printed, rel=1e-6)


def test_a_reversed_propeller_takes_the_rudders_flow_in_eq2():
    state = (3.0, 0.0, 0.0)
    ahead, astern = ((n, 0.3, 0.0, 0.0) for n in (60.0, -60.0))
    still = Modifiers(backing=1.0)

    def turn(actuators, mods):
        sides = [
            eq2.accelerations(*state, actuators[0], s * actuators[1], 0.0, 0.0, None, C, P_SYMMETRIC, mods)[2]
            for s in (1.0, -1.0)
        ]
        return sides[0] - sides[1]

    assert turn(ahead, still) == pytest.approx(turn(ahead, Modifiers()))
    assert turn(astern, Modifiers()) > 0.0
    assert turn(astern, still) == pytest.approx(0.0, abs=1e-3 * turn(astern, Modifiers()))


@pytest.mark.parametrize(("share", "turned"), [(0.5, 0.0), (1.0, -1.0)])
def test_a_rudder_in_flow_from_astern_works_from_its_trailing_edge(share, turned):
    def turn(u, mods):
        return _turned(u, -80.0 if u < 0 else 0.0, mods)  # reversed, it drives no race

    plain, changed = Modifiers(), Modifiers(reversal=share)
    assert turn(2.0, changed) == pytest.approx(turn(2.0, plain))
    assert turn(-2.0, plain) > 0.0
    assert turn(-2.0, changed) == pytest.approx(turned * turn(-2.0, plain), abs=1e-7 * turn(-2.0, plain))


def test_a_propeller_that_drives_ahead_against_sternway_turns_the_flow_at_the_rudder():
    """A propeller that stands still does not, though its drag pushes the ship ahead."""
    changed = Modifiers(reversal=1.0)
    assert _turned(-1.0, 120.0, changed) > 0.0
    assert _turned(-1.0, 0.0, changed) == pytest.approx(_turned(-1.0, -60.0, changed))
    assert _turned(-1.0, 0.0, changed) < 0.0
    assert _turned(1.0, 120.0, changed) == pytest.approx(_turned(1.0, 120.0, Modifiers()), rel=1e-6)


def _turned(u, n, mods):
    """What the rudder does to the yaw acceleration."""
    sides = [eq2.accelerations(u, 0.0, 0.0, n, s * 0.3, 0.0, 0.0, None, C, P_SYMMETRIC, mods)[2] for s in (1.0, -1.0)]
    return sides[0] - sides[1]


def test_added_mass_between_sway_and_yaw_couples_both_ways():
    """(m + m_y) dv + (m x_G + c) dr = Y, (m x_G + c) dv + (I + J) dr = N."""
    args = (2.0, 0.3, 0.01, 60.0, 0.1, 0.0, 0.0, None, C, P)
    coupling = 0.05 * C.m * C.L
    _, dv, dr = eq2.accelerations(*args)
    X_rr_only = coupling * 0.01**2
    du2, dv2, dr2 = eq2.accelerations(*args, Modifiers(coupling=coupling))
    assert C.m11 * dv2 + (C.m12_Y + coupling) * dr2 == pytest.approx(C.m11 * dv + C.m12_Y * dr)
    assert (C.m12_N + coupling) * dv2 + C.m22 * dr2 == pytest.approx(C.m12_N * dv + C.m22 * dr)
    assert (C.m + C.m_x) * (du2 - eq2.accelerations(*args)[0]) == pytest.approx(X_rr_only)


def test_turning_is_balanced_by_hand_in_eq2():
    """Straight ahead, no rudder: du = ((1 - t) T - R)/(m + m_x), every term worked out here."""
    u, n = 3.7, 93.0
    V_A = u * (1 - 0.33)
    T = 1025 * 3.8**2 * (0.356 * 3.8**2 * 1.55**2 - 0.3055 * 3.8 * 1.55 * V_A - 0.1338 * V_A**2)
    race2 = V_A**2 + 8 * T / (1025 * np.pi * 3.8**2)
    eta = 3.8 / 5.04
    drag = 0.5 * 1025 * 15.9 * (eta * race2 + (1 - eta) * V_A**2) * 0.02
    R = u * (2e3 + 5e3 * u + 50.0 * u**2)
    m_x = 2.7 * 1025 * 9402.0 ** (5 / 3) / 130**2
    expected = ((1 - 0.207) * T - R - drag) / (9402.0 * 1025 + m_x)
    assert eq2.accelerations(u, 0.0, 0.0, n, 0.0, 0.0, 0.0, None, C, P_SYMMETRIC)[0] == pytest.approx(
        expected, rel=1e-6
    )


def test_positive_rudder_turns_both_models_to_starboard():
    for f in (lambda *a: mmg.accelerations(SHIP, 0.0, *a), _eq2_symmetric):
        _, dv, dr = f(4.0, 0.0, 0.0, 93.0, np.deg2rad(10.0), 0.0, 0.0)
        assert dr > 0
        assert dv < 0


def test_a_bow_thruster_turns_to_starboard_and_a_stern_thruster_to_port():
    assert mmg.accelerations(SHIP, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6e4, 0.0)[2] > 0
    assert mmg.accelerations(SHIP, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 6e4)[2] < 0


def test_full_thruster_couple_at_rest_gives_the_reference_acceleration():
    dr = mmg.accelerations(SHIP, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 63e3, -63e3)[2]
    assert dr == pytest.approx(3.7e-4, rel=0.03)


def test_a_ship_drifting_with_the_current_feels_no_water():
    env = mmg.Environment(current_speed=0.5, current_to=0.7)
    psi = 0.2
    u, v = 0.5 * np.cos(0.5), 0.5 * np.sin(0.5)
    assert np.allclose(
        mmg.accelerations(
            SHIP, psi, u, v, 0.0, 0.0, 0.0, 0.0, 0.0, replace(env, wind_speed=0.5, wind_from=0.7 + np.pi)
        ),
        0.0,
        atol=1e-9,
    )


def test_a_beamy_ship_turns_with_added_inertia_about_her_middle():
    """A tug of 30 m: the regression as printed gives J_z < 0, and Y of an added mass that stands 0.4 L before
    midship."""
    of = regressions.clarke_1983(30.0, 10.0, 4.0, 0.55)
    assert 0.03 < of.N_rd / of.Y_vd < 1.0 / 12.0
    assert abs(of.N_vd / of.Y_vd) < 0.15
    ordinary = regressions.clarke_1983(230.0, 32.2, 10.8, 0.651)
    assert ordinary.N_rd / ordinary.Y_vd == pytest.approx(0.058, abs=1e-3)
