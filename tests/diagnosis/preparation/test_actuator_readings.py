"""Records of actuators that differ from their commands, and which of the two is believed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.actuators.record_error import RecordError, readings
from shipbench.diagnosis.preparation.actuator_readings import judged, read_rightly, said
from shipbench.diagnosis.thresholds import THRESHOLDS
from shipbench.signals import DELTA, F_B, F_S, N

SURE = THRESHOLDS.value("evidence_beyond_library")


def error(actuator: str = "delta", worth: float = 0.0) -> RecordError:
    """A record that reads 10 % too much, and 0.02 besides."""
    return RecordError(actuator, "{}", 50.0, 0.1, np.array([0.02, 0.1, 0.0, 0.0]), worth)


def test_errors_are_taken_out_of_their_channels_alone(toy):
    data = toy(runs=2)
    true = [run.states[:, DELTA] for run in data.runs]
    recorded = []
    for run in data.runs:
        states = run.states.copy()
        states[:, DELTA] += np.tensordot(error().factors, readings(states[:, DELTA]), 1)
        recorded.append(states)
    wrong = data.with_runs([replace(run, states=S) for run, S in zip(data.runs, recorded, strict=True)])
    right = read_rightly(wrong, [error()])
    for run, S, delta in zip(right.runs, recorded, true, strict=True):
        np.testing.assert_allclose(run.states[:, DELTA], delta, atol=1e-12)
        others = [i for i in range(10) if i != DELTA]
        np.testing.assert_array_equal(run.states[:, others], S[:, others])


def test_an_error_of_the_thrusters_is_taken_out_of_both(toy):
    data = toy(runs=1)
    run = read_rightly(data, [error("F")]).runs[0]
    assert np.all(run.states[:, [F_B, F_S]] != data.runs[0].states[:, [F_B, F_S]])
    np.testing.assert_array_equal(run.states[:, N], data.runs[0].states[:, N])


@pytest.mark.parametrize(
    ("worth", "told"),
    [
        (SURE, "The motion agrees with the command"),
        (-SURE, "The motion agrees with the record"),
        (0.4 * SURE, "The motion does not show which of the two is right"),
    ],
)
def test_what_the_motion_says_is_told_by_its_evidence(worth: float, told: str):
    (line,) = said([error(worth=worth)])
    assert told in line
    assert f"it is taken as {'commanded' if worth == SURE else 'recorded'}" in line
    assert "they differ by 10% (root mean square)" in line


def test_without_errors_nothing_is_fitted():
    assert judged(None, []) == []
    assert said([]) == []
