"""Speed and turning of a calibrated ship against those of her file: true on a ship of another formula."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.estimation.behaviour import Operation, changes
from shipbench.estimation.calibration import Calibration, calibrated, calibration_of, estimated
from shipbench.estimation.coefficients import NUM_BASE
from shipbench.estimation.forward import Plant
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.trials import Trials, sea_trials

ANGLES = tuple(np.deg2rad([10.0, 25.0]).tolist())
TRUE = (0.055, 0.443, 0.053)
"""Of the simulated ship at 110 rpm, beside eq. (2) with all coefficients at their prior means."""


@pytest.fixture(scope="module")
def plant() -> Plant:
    return Plant.of(sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=12, samples=120)))


@pytest.fixture(scope="module")
def model(plant) -> Calibration:
    return calibration_of(calibrated(plant, estimated(plant)))


def test_speed_and_turns_are_found_with_intervals_that_hold(plant, model):
    at = replace(Operation.of(plant, ANGLES), rpm=110.0)
    for found, true in zip(changes(plant, model, at, 2.2), TRUE, strict=True):
        assert found.ci95[0] < true < found.ci95[1]
        assert found.ci95[1] - found.ci95[0] < 0.2


def test_the_ship_of_the_file_has_not_changed(plant, model):
    as_in_file = replace(model, base=np.zeros(NUM_BASE))
    for found in changes(plant, as_in_file, Operation.of(plant, ANGLES), 2.0):
        assert found.relative == found.spreads == 0.0
        assert found.ci95[0] < 0.0 < found.ci95[1]


def test_only_angles_that_the_runs_reach_are_compared(plant):
    at = Operation.of(plant, (0.1, 3.0))
    assert at.angles == (0.1,)
    assert 50.0 < at.rpm < 200.0


def test_what_does_not_turn_has_no_change(plant, model):
    wild = replace(model, base=np.full(NUM_BASE, 300.0))
    assert None in changes(plant, wild, Operation.of(plant, ANGLES), 2.0)


def test_runs_that_never_go_ahead_have_no_operation(plant):
    astern = plant.seg.states.copy()
    astern[..., 6] *= -1.0
    still = replace(plant.seg, states=-np.abs(astern))
    assert Operation.of(Plant(plant.ship, still, plant.long, plant.ordinary, plant.froude), ANGLES) is None
