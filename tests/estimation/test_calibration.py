"""Calibration from pieces, and its refinement on open-loop rollouts."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from shipbench.estimation.actuator_fit import fit_actuators
from shipbench.estimation.calibration import (
    Calibration,
    calibrated,
    calibration_of,
    estimated,
    refined,
    some_of,
)  # fmt: skip
from shipbench.estimation.coefficients import NUM_BASE
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import Origin
from shipbench.estimation.gears import gears_of
from shipbench.estimation.laplace import settle
from shipbench.estimation.linearisation import Linearisation, Scales
from shipbench.estimation.open_loop import Rollout, distance, rollout_plant
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.trials import Trials, sea_trials

PRIOR = Rollout(np.zeros(NUM_BASE), (), ())


@cache
def rollouts(seconds: float) -> Plant:
    data = sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=4, samples=60, gusts=0.0, noise=0.1))
    return rollout_plant(data, gears_of(fit_actuators(data.batch(), data.dt)), seconds)


@cache
def from_pieces() -> Calibration:
    plant = Plant.of(sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=4, samples=60, gusts=0.0, noise=0.1)))
    return calibration_of(calibrated(plant, estimated(plant)))


def test_calibration_predicts_better_than_the_prior_means():
    plant = rollouts(60.0)
    after, before = (distance(plant, Scales(plant), model)[0].mean() for model in (from_pieces(), PRIOR))
    assert after < 0.7 * before


def test_the_path_from_another_fit_begins_near_its_optimum():
    """Its trajectories follow the measured ones with the latent force of these coefficients."""
    plant = Plant.of(sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=4, samples=60, gusts=0.0, noise=0.1)))
    like, scales = estimated(plant), Scales(plant)
    start = Origin.like(plant, scales, like)
    near = settle(Linearisation(plant, scales, start.point, start.motion), like.model, like.hyper, {}, leap=0.0)
    assert near.excess < 30.0
    assert near.evidence == pytest.approx(like.evidence, abs=100.0)


def test_a_position_that_jumps_leaves_the_calibration_finite():
    data = sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=4, samples=60, gusts=0.0, noise=0.1))
    states = data.runs[0].states.copy()
    states[30:, :2] += 5000.0
    plant = Plant.of(replace(data, runs=[replace(data.runs[0], states=states), *data.runs[1:]]))
    model = calibration_of(calibrated(plant, estimated(Plant.of(data))))
    assert np.isfinite(model.base).all()
    assert np.abs(model.base).max() < 10.0


def test_every_coefficient_is_known_no_worse_than_before():
    model = from_pieces()
    assert (model.spread > 0.0).all()
    assert (model.spread <= model.widths * (1.0 + 1e-6)).all()
    assert model.spread.min() < 0.5


def test_refinement_lowers_the_error_on_its_own_rollouts_and_stays_near_the_prior():
    plant = rollouts(60.0)
    start = from_pieces()
    after = refined(plant, Scales(plant), start)
    assert distance(plant, Scales(plant), after)[0].mean() < distance(plant, Scales(plant), start)[0].mean()
    assert np.sum(after.base**2) < np.sum(start.base**2) + NUM_BASE


def test_rollouts_are_as_long_as_asked_and_driven_by_commands():
    assert rollouts(30.0).seg.commanded
    assert rollouts(30.0).seg.states.shape[1] == 31
    assert len(some_of(rollouts(30.0)).seg.run) == len(rollouts(30.0).seg.run)  # few already


@pytest.mark.parametrize("runs", [1, 4])
def test_errors_are_told_by_run(runs: int):
    plant = rollouts(30.0).where(rollouts(30.0).seg.run < runs)
    assert distance(plant, Scales(plant), PRIOR)[0].shape == (runs,)
