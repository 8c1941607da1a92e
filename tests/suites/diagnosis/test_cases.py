"""The hidden sets: drawn alike from one seed, hidden where they say, sailed on ships that can be sailed."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from every_day import every

from shipbench.effects.base import EFFECTS
from shipbench.errors import InputError
from shipbench.physics.hull import polynomial, unified
from shipbench.physics.mmg import load_mmg_ship
from shipbench.run_meta import RunMeta
from shipbench.signals import PSI
from shipbench.simulate.fitted_ship import fitted_trials, is_sane
from shipbench.simulate.manoeuvres import turning_circle
from shipbench.simulate.simulator import Simulator
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.cases import KINDS, OWN_KINDS, SIZES, UNITS, count, draw_case, misread, singles
from shipbench.suites.diagnosis.ships import PARENTS, as_polynomial, draw_ship, scaled
from shipbench.suites.diagnosis.unmodelled import OUTSIDE, canonical

TINY = Trials(runs=4, samples=40)


def states(data) -> np.ndarray:
    return np.stack([run.states for run in data.runs])


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_a_case_is_drawn_again_from_seed_kind_and_index(kind):
    first, second = (draw_case(kind, 3, 11, plan=TINY) for _ in range(2))
    assert first.truth == second.truth
    assert first.dataset().fingerprint == second.dataset().fingerprint
    assert draw_case(kind, 3, 12, plan=TINY).dataset().fingerprint != first.dataset().fingerprint


def test_singles_cover_every_effect_at_both_sizes():
    drawn = {
        (case.truth[0], case.size[0])
        for case in (draw_case("single", i, 0, plan=TINY) for i in range(0, count("single", 1), 13))
    }
    expected = {(name, size) for name in EFFECTS.names() if name not in OWN_KINDS for size in SIZES}
    assert drawn <= expected
    assert len(drawn) == len(range(0, count("single", 1), 13))
    assert count("single", 1) == len(expected)


def test_what_is_hidden_has_the_size_that_is_said():
    names = singles()
    for name, size in (("current", 1.0), ("rudder_offset", 0.3), ("heading_bias", 1.0)):
        case = draw_case("single", names.index(name) + (len(names) if size == 0.3 else 0), 5, plan=TINY)
        typical = EFFECTS.get(name).sized(case.ship.L)[0].typical
        assert abs(next(iter(case.values()[0].values()))) == pytest.approx(size * abs(typical))


def test_signs_and_directions_are_drawn_both_ways():
    names = singles()
    signs = {
        np.sign(draw_case("single", names.index("rudder_offset"), seed, plan=TINY).effects[0].q[0]) for seed in range(4)
    }
    assert signs == {-1.0, 1.0}
    assert all(
        draw_case("single", names.index("rudder_stall"), seed, plan=TINY).effects[0].q[0] > 0 for seed in range(4)
    )


def test_effects_of_one_run_each_have_as_many_values_as_runs():
    case = draw_case("single", singles().index("wind_per_run"), 2, plan=TINY)
    assert [np.shape(v) for v in case.effects[0].q] == [(4,), (4,)]
    assert set(case.values()[0]) == {"speed"}


def test_thruster_effects_are_hidden_on_ships_with_thrusters():
    for seed in range(3):
        case = draw_case("single", singles().index("thruster_gain"), seed, plan=TINY)
        assert case.ship.particulars.thrusters.max_force > 0
        assert case.ship.thrusters.x_bow == case.ship.particulars.thrusters.x_bow


def test_pairs_join_two_families():
    for index in range(6):
        first, second = (EFFECTS.get(name).family for name in draw_case("pair", index, 1, plan=TINY).truth)
        assert first != second


def test_a_change_begins_with_the_run_that_is_said():
    plan = Trials(runs=8, samples=40)
    case = draw_case("change", 0, 4, plan=plan)
    k = case.detail["from_run"]
    plain = states(sea_trials(case.ship, case.data_seed, (), plan))
    changed = np.max(np.abs(states(case.dataset()) - plain), axis=(1, 2)) > 1e-9
    assert changed.tolist() == [i >= k for i in range(8)]


def test_a_unit_error_touches_its_channels_alone():
    data = sea_trials(load_mmg_ship("container130"), 0, (), TINY)
    error = next(i for i, item in enumerate(UNITS) if item[0] == "rudder to port")
    other = misread(data, *UNITS[error][1:])
    difference = states(other) - states(data)
    assert np.allclose(states(other)[..., 7], -states(data)[..., 7])
    assert np.allclose(np.delete(difference, 7, axis=-1), 0.0)
    assert np.allclose(other.runs[1].inputs[:, 1], -data.runs[1].inputs[:, 1])


@pytest.mark.long
@pytest.mark.parametrize("cause", OUTSIDE, ids=lambda c: c.name)
def test_causes_outside_the_library_move_the_ship_or_what_is_recorded_and_are_not_registered(cause):
    case = draw_case("outside", OUTSIDE.index(cause), 6, plan=TINY)
    assert case.variables == cause.variables
    assert cause.name not in EFFECTS.names()
    moved = states(case.dataset()) - states(sea_trials(case.ship, case.data_seed, (), TINY))
    if cause.enters == "sensor":
        changed = np.flatnonzero(np.max(np.abs(moved), axis=(0, 1)))
        assert len(changed) == 1  # of one channel, which is not the place
        assert changed[0] >= PSI
    else:
        assert np.max(np.abs(moved[..., :2])) > 0.5
    assert pickle.loads(pickle.dumps(cause)) is cause


def test_variables_are_known_under_their_usual_names():
    assert canonical("psi") == canonical("heading") == {"heading"}
    assert canonical("|delta|") == {"rudder"}
    assert canonical("n * r") == {"revolutions", "yaw rate"}
    assert canonical("yaw rate") == {"yaw rate"}
    assert canonical("current") == frozenset()


def test_nothing_in_the_data_says_what_was_hidden():
    for kind in ("single", "outside", "none-same", "none-other"):
        data = draw_case(kind, 1, 3, plan=TINY).dataset()
        assert (data.name, data.source, data.simulation, data.notes) == ("trials", "hidden set of the suite", None, ())
        assert all(run.meta == RunMeta() for run in data.runs)


def test_a_hull_as_polynomial_is_the_same_where_it_was_fitted_and_another_beyond():
    ship = load_mmg_ship("container130")
    cubic, size = as_polynomial(ship.hull), (ship.L, ship.T, 1025.0)
    u, v, r = (np.array(a) for a in ((4.0, 4.0, 4.0), (0.5, -1.0, 0.0), (0.0, 0.015, -0.02)))
    for near, true in zip(polynomial(u, v, r, cubic, *size), unified(u, v, r, ship.hull, *size), strict=True):
        np.testing.assert_allclose(near, true, atol=0.12 * np.abs(true).max())
    aside = (np.array([0.5]), np.array([1.0]), np.array([0.0]))
    assert abs(polynomial(*aside, cubic, *size)[1][0] / unified(*aside, ship.hull, *size)[1][0] - 1.0) > 0.05


@pytest.mark.long
def test_half_of_the_development_ships_have_a_polynomial_hull():
    names = [draw_ship(np.random.default_rng(seed), "development", False).name for seed in range(6)]
    assert 1 <= sum(name.endswith("polynomial") for name in names) <= 5


@pytest.mark.long
def test_development_and_test_ships_come_from_other_hulls():
    for which, parents in PARENTS.items():
        ships = [draw_ship(np.random.default_rng(seed), which, False) for seed in range(2)]
        assert all(ship.name.startswith(tuple(f"{parent}-" for parent in parents)) for ship in ships)
        assert len({ship.L for ship in ships}) == 2
    assert not set(PARENTS["test"]) & set(PARENTS["development"])


def test_the_ship_file_agrees_with_the_ship_that_is_sailed():
    ship = draw_ship(np.random.default_rng(3), "test", True)
    p = ship.particulars
    assert (p.L, p.rudder.area, p.propeller.diameter, p.Izz) == pytest.approx(
        (ship.L, ship.rudder.A_R, ship.propeller.D, ship.I_zG)
    )
    assert p.rho * p.displacement == pytest.approx(ship.m)
    assert p.wind.lateral_area == pytest.approx(ship.A_L)


def test_a_scaled_ship_turns_in_the_same_circle_measured_in_its_length():
    ship = load_mmg_ship("container130")
    half = scaled(ship, 65.0)
    big = turning_circle(Simulator(ship, 1.0), 4.5, 93.0, 35.0, 1.0, 400.0)
    small = turning_circle(Simulator(half, 1.0), 4.5 / 2**0.5, 93.0 * 2**0.5, 35.0, 1.0 / 2**0.5, 400.0 / 2**0.5)
    # the speed that regularises the hull forces and the thrusters' loss scale as well: the circles agree to the
    # integrator
    assert small.tactical_diameter == pytest.approx(big.tactical_diameter, rel=2e-3)


@pytest.mark.parametrize("seed", every(3, range(3)))
def test_trials_of_the_fitted_model_can_be_sailed_and_repeated(seed):
    ship = draw_ship(np.random.default_rng(seed), "test", False)
    data = fitted_trials(ship, seed, TINY)
    assert is_sane(states(fitted_trials(ship, seed, Trials(runs=4, samples=40, noise=0.0))), ship.L)
    assert (
        data.fingerprint
        == fitted_trials(ship, seed, TINY).fingerprint
        != fitted_trials(ship, seed + 1, TINY).fingerprint
    )
    assert data.ship == ship.particulars


def test_gusts_of_the_fitted_ship_can_be_turned_off():
    ship = load_mmg_ship("container130")
    calm = Trials(runs=2, samples=40, noise=0.0, gusts=0.0)
    rough = Trials(runs=2, samples=40, noise=0.0, gusts=1.5)
    moved = states(fitted_trials(ship, 1, calm)) - states(fitted_trials(ship, 1, rough))
    assert 0.01 < np.max(np.abs(moved[..., :2])) < 50.0


def test_an_unknown_kind_is_told():
    with pytest.raises(InputError, match=r"unknown kind of case 'singel'.*single"):
        draw_case("singel", 0, 0)
    with pytest.raises(InputError, match="unknown set of ships"):
        draw_case("single", 0, 0, "training")
