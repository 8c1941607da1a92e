"""Correction of a simulation: known accelerations beside the physics, the corrected rollout, and saving."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.errors import InputError
from shipbench.estimation.beside import PUSHES
from shipbench.estimation.coefficients import NUM_BASE, parameters
from shipbench.estimation.forward import Plant, cut
from shipbench.estimation.linearisation import Scales
from shipbench.physics.mmg import load_mmg_ship
from shipbench.predictors.context import Context
from shipbench.predictors.own_simulator import Simulator
from shipbench.predictors.physics_model.correction import (
    Correction,
    beside_simulation,
    correctable,
    corrected_simulation,
)
from shipbench.ship import complete
from shipbench.signals import COMMANDS
from shipbench.simulate.simulator import Simulator as Mmg


def mmg(s0, U, dt):
    """Simulator that made the runs of `harbour`."""
    return Mmg(load_mmg_ship("container130")).fast_rollout(s0, U, dt)


@pytest.fixture(scope="module")
def simulation(harbour):
    return Simulator(mmg).fit(harbour)


@pytest.fixture(scope="module")
def beside(harbour, simulation):
    return beside_simulation(harbour, simulation)


@pytest.fixture(scope="module")
def correction(beside):
    return Correction.fit(beside)


def test_with_the_known_accelerations_the_physics_steps_as_the_simulation_does(harbour, simulation, beside):
    assert beside.inputs == (*harbour.inputs, *PUSHES)
    plant = Plant(complete(beside.ship), cut(beside, 40))
    p, ship = parameters(Scales(plant), np.zeros(NUM_BASE))
    states = np.swapaxes(plant.seg.states[:, :-1, :6], 0, 1)[None]
    ends = plant.steps_from(states, p, ship, plant.pushes(np.zeros((*plant.seg.mask.shape, 3))))[0]
    run = harbour.runs[3]
    S = simulation.predict(run.states[:-1], run.inputs[:-1, None])[:, 0]
    moved = np.abs(S[:, 3:6] - run.states[:-1, 3:6]).max(axis=0)
    np.testing.assert_allclose(ends[:, 3, 3:], S[:, 3:6], atol=0.02 * moved.max(), rtol=0)
    assert (np.abs(ends[:, 3, 3:] - S[:, 3:6]).max(axis=0) < 0.05 * moved).all()


def test_beside_the_simulation_that_made_the_runs_no_coefficient_moves_by_a_prior_spread(correction):
    assert np.abs(correction.physics.calibration.base - correction.reference).max() < 1.0
    assert correction.physics.inputs == COMMANDS


def test_the_corrected_simulation_is_hardly_another_where_it_was_right(harbour, simulation, correction):
    batch = harbour.batch()
    S = correction.predict(simulation, batch.s0, batch.U, harbour.dt)
    assert np.hypot(*(S - batch.truth)[..., :2].reshape(-1, 2).T).mean() < 0.1


def test_a_saved_correction_makes_the_same_model(harbour, simulation, correction, tmp_path):
    (tmp_path / "sim.py").write_text(
        "from shipbench.physics.mmg import load_mmg_ship\nfrom shipbench.simulate.simulator import Simulator\n"
        "def mmg(s0, U, dt):\n    return Simulator(load_mmg_ship('container130')).fast_rollout(s0, U, dt)\n"
    )
    (tmp_path / "out").mkdir()
    correction.save(tmp_path / "out" / "correction")
    corrected = corrected_simulation("../sim.py:mmg", tmp_path / "out", "f1")
    assert Simulator(corrected).fitted_to == "f1"
    batch = harbour.batch()
    S = corrected(batch.s0, batch.U, harbour.dt, context=Context.of(harbour))
    np.testing.assert_array_equal(S, correction.predict(simulation, batch.s0, batch.U, harbour.dt))


def test_only_causes_that_are_the_same_in_every_run_can_be_corrected():
    found = correctable(["current", "hull_derivatives", "rudder_lag", "heading_bias", "change_point"])
    assert found == ("current", "heading_bias")


def test_a_simulation_that_returns_nothing_finite_is_told_with_run_and_time(harbour):
    def breaks(s0, U, dt):
        S = np.repeat(s0[:, None], U.shape[1], axis=1)
        S[s0[:, 0] == harbour.runs[2].states[7, 0]] = np.nan
        return S

    with pytest.raises(InputError, match=rf"run '{harbour.runs[2].id}' at t = 7 s"):
        beside_simulation(harbour, Simulator(breaks).fit(harbour))


def test_another_shape_of_one_step_is_told(harbour):
    class Two:
        def predict(self, s0, U, history=None):
            return np.zeros((len(s0), 2, 10))

    with pytest.raises(InputError, match="returned the shape"):
        beside_simulation(replace(harbour, runs=harbour.runs[:2]), Two())
