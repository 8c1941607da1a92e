"""The simulator: published figures, order of the integration, symmetry of rollouts, batches."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.errors import InputError, WorkError
from shipbench.physics.mmg import Environment, load_mmg_ship
from shipbench.simulate.manoeuvres import straight_state, turning_circle
from shipbench.simulate.simulator import Simulator
from shipbench.simulate.validation import KVLCC2_RPM, KVLCC2_SPEED, integrator_order, table


@pytest.fixture(scope="module")
def rows():
    return {(r["ship"], r["quantity"]): r for r in table()}


def test_kvlcc2_turns_as_published(rows):
    assert rows["kvlcc2_l7", "advance, +35 deg"]["computed"] == pytest.approx(3.31, rel=0.03)
    assert rows["kvlcc2_l7", "tactical diameter, +35 deg"]["computed"] == pytest.approx(3.36, rel=0.03)


@pytest.mark.long
def test_kcs_propels_itself_at_the_published_revolutions(rows):
    assert rows["kcs", "self-propulsion at 24 kn"]["computed"] == pytest.approx(115.5, rel=0.005)


def test_every_row_with_a_tolerance_passes(rows):
    judged = [r for r in rows.values() if r["tolerance"] is not None]
    assert len(judged) >= 9
    assert [r for r in judged if not r["passed"]] == []


def test_zig_zags_stay_near_the_references_own_runs(rows):
    overshoots = [r for (_, q), r in rows.items() if "overshoot" in q]
    assert len(overshoots) == 16
    assert max(abs(r["computed"] - r["published"]) for r in overshoots) < 2.0


def test_the_integrator_is_of_fourth_order():
    assert integrator_order() == pytest.approx(4.0, abs=0.2)


def test_steady_speeds_of_the_container_ship_are_the_references():
    sim = Simulator(load_mmg_ship("container130"), 4.0)
    rpm = np.array([32.0, 60.0, 93.0, 120.0, 155.0, 180.0])
    s0 = straight_state(4.0, 0.0, len(rpm))
    s0[:, 6] = rpm
    U = np.zeros((len(rpm), 750, 4))
    U[..., 0] = rpm[:, None]
    speeds = sim.rollout(s0, U, 4.0)[:, -1, 3]
    np.testing.assert_allclose(speeds, [1.28, 2.40, 3.72, 4.81, 6.21, 7.21], rtol=0.01)


def _random_runs(num: int):
    rng = np.random.default_rng(11)
    s0 = straight_state(3.5, 90.0, num)
    s0[:, 2] = rng.uniform(-3, 3, num)
    s0[:, 7] = rng.uniform(-0.2, 0.2, num)
    U = np.repeat(rng.uniform([-120, -0.6, -6e4, -6e4], [150, 0.6, 6e4, 6e4], (num, 4, 4)), 10, axis=1)
    return s0, U


def test_a_batch_is_the_loop_over_its_runs():
    sim = Simulator(load_mmg_ship("container130"))
    s0, U = _random_runs(5)
    together = sim.rollout(s0, U, 1.0)
    for i in range(5):
        np.testing.assert_allclose(
            sim.rollout(s0[i : i + 1], U[i : i + 1], 1.0)[0], together[i], rtol=1e-12, atol=1e-12
        )


def test_two_halves_are_one_whole():
    sim = Simulator(load_mmg_ship("container130"))
    s0, U = _random_runs(3)
    whole, first = sim.rollout(s0, U, 1.0), sim.rollout(s0, U[:, :20], 1.0)
    np.testing.assert_allclose(sim.rollout(first[:, -1], U[:, 20:], 1.0), whole[:, 20:], rtol=1e-12)


def test_the_default_step_is_fine_enough():
    s0, U = _random_runs(8)
    ship = load_mmg_ship("container130")
    coarse, fine = (Simulator(ship, h).rollout(s0, U, 1.0) for h in (0.25, 0.05))
    assert np.abs(coarse[..., :2] - fine[..., :2]).max() < 0.005


def test_a_uniform_current_carries_a_drifting_ship_along():
    sim = Simulator(load_mmg_ship("container130"))
    s0 = np.zeros((1, 10))
    s0[0, 3], s0[0, 4] = 0.4 * np.cos(1.0), 0.4 * np.sin(1.0)
    env = Environment(current_speed=0.4, current_to=1.0, wind_speed=0.4, wind_from=1.0 + np.pi)
    end = sim.rollout(s0, np.zeros((1, 100, 4)), 1.0, env)[0, -1]
    np.testing.assert_allclose(end[:2], [40 * np.cos(1.0), 40 * np.sin(1.0)], atol=1e-6)


def test_shallow_water_widens_the_turn():
    sim = Simulator(load_mmg_ship("container130"))
    s0 = straight_state(3.7, 93.0)
    U = np.zeros((1, 100, 4))
    U[..., 0], U[..., 1] = 93.0, np.deg2rad(15)
    deep, shallow = sim.rollout(s0, U, 1.0), sim.rollout(s0, U, 1.0, Environment(depth=8.0))
    assert shallow[0, -1, 2] < 0.97 * deep[0, -1, 2]


def test_a_beam_wind_sets_the_ship_to_leeward():
    sim = Simulator(load_mmg_ship("container130"))
    end = sim.rollout(
        straight_state(3.7, 93.0),
        np.tile([93.0, 0, 0, 0], (1, 60, 1)),
        1.0,
        Environment(wind_speed=10.0, wind_from=np.pi / 2),
    )[0, -1]
    assert end[4] < 0


def test_a_crash_stop_ends_within_the_references_time():
    sim = Simulator(load_mmg_ship("container130"), 1.0)
    S = sim.rollout(straight_state(3.8, 93.0), np.tile([-150.0, 0, 0, 0], (1, 200, 1)), 1.0)
    stopped = int(np.argmax(S[0, :, 3] < 0))
    assert 60 < stopped < 180


def test_a_turn_that_does_not_come_round_says_so():
    with pytest.raises(WorkError, match="sail longer"):
        turning_circle(Simulator(load_mmg_ship("kvlcc2_l7"), 0.1), KVLCC2_SPEED, KVLCC2_RPM, 35.0, 0.1, 5.0)


def test_an_unknown_ship_is_named_with_the_nearest():
    with pytest.raises(InputError, match="container130"):
        load_mmg_ship("container13")


@pytest.mark.parametrize("name", ["container130", "kvlcc2_l7", "kcs"])
def test_the_fast_rollout_has_the_numbers_of_the_ordinary_one(name):
    ship, rng = load_mmg_ship(name), np.random.default_rng(0)
    froude = (ship.L / 130.0) ** 0.5
    s0 = straight_state(4.0 * froude, 100.0 / froude, 9)
    s0[:, 2] = rng.uniform(-3.0, 3.0, 9)
    U = np.zeros((9, 40, 4))
    U[:, :, 0] = 100.0 / froude * np.where(np.arange(40) < 25, 1.0, -0.6)
    U[:, :, 1] = rng.uniform(-0.6, 0.6, (9, 1)) * np.sign(np.sin(np.arange(40) / 5.0))
    U[:, 20:, 2] = 3e4
    env = Environment(rng.uniform(0.0, 0.5, 9), 1.0, rng.uniform(0.0, 8.0, 9), 2.0)
    sim = Simulator(ship, 0.5)
    for around in (env, Environment()):
        np.testing.assert_allclose(
            sim.fast_rollout(s0, U, 1.0, around), sim.rollout(s0, U, 1.0, around), rtol=1e-9, atol=1e-9
        )


def test_the_fast_rollout_refuses_shallow_water():
    sim = Simulator(load_mmg_ship("container130"))
    with pytest.raises(InputError, match="deep water"):
        sim.fast_rollout(straight_state(4.0, 100.0), np.zeros((1, 5, 4)), 1.0, Environment(depth=9.0))
