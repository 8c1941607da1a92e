"""Refinement on open-loop rollouts is taken where it pays on validation runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.estimation.actuator_fit import fit_actuators
from shipbench.estimation.calibration import Calibration, calibration_of, estimated
from shipbench.estimation.coefficients import NUM_BASE
from shipbench.estimation.forward import Plant
from shipbench.estimation.gears import gears_of
from shipbench.estimation.linearisation import Scales
from shipbench.estimation.open_loop import distance, rollout_plant
from shipbench.estimation.refinement import refined_on, refinement_length
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.trials import Trials, sea_trials

DATA = sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=6, samples=60, gusts=0.0, noise=0.1))
TRAIN, VALID = DATA.with_runs(DATA.runs[:4]), DATA.with_runs(DATA.runs[4:])
GEARS = gears_of(fit_actuators(DATA.batch(), DATA.dt))


@pytest.fixture(scope="module")
def prior() -> Calibration:
    """The prior means, as if nothing had been fitted."""
    found = calibration_of(estimated(Plant.of(TRAIN)))
    return replace(found, base=np.zeros(NUM_BASE))


def test_it_pays_from_the_prior_means_and_lowers_the_error_of_validation_runs(prior):
    seconds = refinement_length(TRAIN, VALID, GEARS, prior)
    assert seconds is not None
    plant = rollout_plant(VALID, GEARS, 60.0)
    after, before = (
        distance(plant, Scales(plant), model)[0].mean() for model in (refined_on(TRAIN, GEARS, seconds, prior), prior)
    )
    assert after < before


def test_it_is_not_taken_where_nothing_is_gained_a_second_time(prior):
    seconds = refinement_length(TRAIN, VALID, GEARS, prior)
    best = refined_on(DATA, GEARS, seconds, prior)
    assert refinement_length(TRAIN, VALID, GEARS, best) is None


def test_a_single_validation_run_decides_nothing(prior):
    assert refinement_length(TRAIN, DATA.with_runs(DATA.runs[4:5]), GEARS, prior) is None
    assert refined_on(TRAIN, GEARS, None, prior) is prior
