"""What is reported of the calibrated ship: speed and turns that the runs identify, no single coefficients."""

from __future__ import annotations

import pytest

from shipbench.diagnosis.evaluation.moved import moved
from shipbench.diagnosis.result import Cause
from shipbench.estimation.budget import Budget, limited
from shipbench.estimation.calibration import calibrated, estimated
from shipbench.estimation.forward import Plant
from shipbench.estimation.laplace import Fit
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.trials import Trials, sea_trials


@pytest.fixture(scope="module")
def found() -> Fit:
    plant = Plant.of(sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=8, samples=80)))
    return calibrated(plant, estimated(plant))


def cause(name: str) -> Cause:
    return Cause(name, 1, 100.0, 0.001, {})


def test_a_ship_that_turns_faster_than_by_her_file_is_reported(found):
    (turn,) = [m for m in moved(found, [cause("current")]) if "10° of rudder" in m.coefficient]
    assert turn.coefficient.startswith("yaw rate with 10° of rudder at ")
    assert turn.ci95[0] < 0.45 < turn.ci95[1]
    assert 0.05 < turn.ci95[0] < turn.change < turn.ci95[1]
    assert turn.unit == "1"


def test_beside_a_cause_in_the_ship_or_without_time_nothing_is_reported(found):
    assert moved(found, [cause("hull_derivatives")])
    assert moved(found, [cause("rudder_gain")]) == ()
    with limited(Budget(iterations=0)):
        assert moved(found, []) == ()
