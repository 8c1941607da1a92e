"""Rollouts and errors of a simulation of the user's own, as a diagnosis measures them."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from shipbench.diagnosis.evaluation.own_simulation import OwnSimulation, Rollouts, its_own, without_pushes
from shipbench.errors import InputError
from shipbench.estimation.beside import PUSHES
from shipbench.metrics.ed import ed
from shipbench.specs import parse_spec, spec_of


def still(s0, U, dt):
    return np.repeat(s0[:, None], U.shape[1], axis=1)


def test_errors_are_the_mean_ed_of_every_run(harbour):
    batch = harbour.batch()
    rollouts = OwnSimulation(spec_of(still), harbour).alone(harbour)
    expected = ed(true=batch.truth, pred=still(batch.s0, batch.U, 1.0)).mean(axis=1)
    np.testing.assert_allclose(rollouts.errors, expected)
    assert rollouts.motion.shape == (len(harbour), 41, 6)


def test_a_diverged_rollout_counts_as_a_large_error(harbour):
    def lost(s0, U, dt):
        return np.full((*U.shape[:2], 10), np.nan)

    assert (Rollouts.of(harbour, OwnSimulation(spec_of(lost), harbour), None).errors > 1e5).all()


def test_channels_of_the_simulation_can_be_taken_off_again(harbour):
    simulation = OwnSimulation(spec_of(still), harbour)
    beside = simulation.beside(harbour)
    assert beside.inputs[-3:] == PUSHES
    assert without_pushes(beside).fingerprint == harbour.fingerprint
    assert simulation.beside(beside).fingerprint == beside.fingerprint


def test_a_model_that_learns_is_fitted_to_the_training_runs_alone(harbour):
    learns = OwnSimulation(parse_spec("sklearn:Ridge"), harbour)
    train = learns.beside(harbour).subset(range(10))
    other, runs = learns.of_training(learns.beside(harbour), train)
    assert len(other.known) == 10
    assert runs.inputs[-3:] == PUSHES
    function = OwnSimulation(spec_of(still), harbour)
    assert function.of_training(harbour, train)[0] is function


def test_another_process_makes_the_model_anew(harbour):
    simulation = OwnSimulation(parse_spec("hold"), harbour)
    assert simulation.model is simulation.model
    again = pickle.loads(pickle.dumps(simulation))
    np.testing.assert_array_equal(again.alone(harbour).errors, simulation.alone(harbour).errors)


def test_actuator_dynamics_are_not_searched_beside_a_simulation():
    assert {"rudder_delay", "shaft_lag", "thruster_lag"} <= set(its_own())
    assert "current" not in its_own()


@pytest.mark.parametrize(
    "fault", ["raise RuntimeError('no licence')", "import nothing_of_this_name", "raise SystemExit(3)"]
)
def test_a_simulation_that_fails_is_one_message(harbour, tmp_path, fault):
    (tmp_path / "late.py").write_text(f"def simulate(s0, U, dt):\n    {fault}\n")
    (tmp_path / "soon.py").write_text(f"{fault}\ndef simulate(s0, U, dt):\n    return s0\n")
    for name in ("late", "soon"):
        with pytest.raises(InputError, match=rf"the simulation '.*{name}.py:simulate' fails: "):
            OwnSimulation(parse_spec(f"{tmp_path / name}.py:simulate"), harbour).beside(harbour)


def in_degrees(s0, U, dt):
    return still(s0, U, dt) * np.where(np.arange(10) == 2, np.rad2deg(1.0), 1.0)


def of_its_own_start(s0, U, dt):
    S = still(s0, U, dt)
    S[..., 4:6] = 0.1
    return S


@pytest.mark.parametrize(
    ("simulation", "said"),
    [(in_degrees, r"Probable cause: angles in degrees"), (of_its_own_start, r"does not begin at the measured v, r")],
)
def test_a_simulation_that_does_not_step_from_measured_states_is_refused(harbour, simulation, said):
    with pytest.raises(InputError, match=said):
        OwnSimulation(spec_of(simulation), harbour).beside(harbour)


def test_rollouts_without_a_finite_position_are_told(harbour):
    def lost(s0, U, dt):
        S = still(s0, U, dt)
        S[:, 15:] = np.nan
        return S

    alone = Rollouts.of(harbour, OwnSimulation(spec_of(lost), harbour), None)
    [said] = alone.said(harbour.ship)
    assert said.startswith("your simulation has no finite position in 16 of 16 open-loop rollouts, the earliest after")
    assert OwnSimulation(spec_of(still), harbour).alone(harbour).said(harbour.ship) == []
