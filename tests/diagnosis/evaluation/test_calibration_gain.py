"""What calibrating the ship's own coefficients is worth: on a ship off her file, and on one that is as in the file."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_diagnosis import make_diagnosis

from shipbench.diagnosis.evaluation.calibration_gain import calibration_gain
from shipbench.estimation.calibration import calibrated, estimated
from shipbench.estimation.forward import Plant
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.reports.diagnosis.text import calibration_words
from shipbench.simulate.trials import Trials, sea_trials


def gain(data: Dataset):
    plant = Plant.of(data)
    return calibration_gain(data, calibrated(plant, estimated(plant)))


@pytest.fixture(scope="module")
def data() -> Dataset:
    return sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=6, samples=60, gusts=0.0, noise=0.1))


def test_a_ship_off_her_file_is_predicted_far_better_once_calibrated(data):
    rudder = data.ship.rudder.model_copy(update={"area": 2.0 * data.ship.rudder.area})
    found = gain(replace(data, ship=data.ship.model_copy(update={"rudder": rudder})))
    assert found.after < 0.7 * found.before
    assert found.seconds == pytest.approx(60.0, abs=1.0)


def test_commands_alone_are_enough(data):
    runs = (Run(r.id, r.t, np.concatenate([r.states[:, :6], r.inputs], axis=1), r.inputs) for r in data.runs)
    found = gain(replace(data, actuators="commanded", runs=tuple(runs)))
    assert 0.0 < found.after < found.before


def test_both_errors_are_told_in_words(data):
    found = gain(data)
    text = calibration_words(replace(make_diagnosis(), calibration=found))
    assert "the ship file's model is" in text
    assert "on the runs that were fitted" in text
    assert calibration_words(make_diagnosis()) == ""
