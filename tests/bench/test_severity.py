"""Severity: measures by hand, ratios to the mean, and what the notes say of them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.bench.severity import measured, severities, severity_notes
from shipbench.signals import DELTA, U, V


def with_motion(run, u, v, delta):
    states = run.states.copy()
    states[:, U], states[:, V], states[:, DELTA] = u, v, delta
    return replace(run, states=states)


def test_measures_by_hand(toy):
    run = toy(1, steps=3).runs[0]
    u, v = [4.0, 4.0, -3.0, 0.0], [0.0, 3.0, 0.0, 0.1]  # the last sample is nearly at rest: its 90 degrees do not count
    [found] = measured([with_motion(run, u, v, [0.1, -0.3, 0.2, 0.0])])
    assert found == pytest.approx([0.3, np.arctan2(3.0, 4.0), 5.0])


def test_measures_are_the_same_in_the_mirrored_run(toy):
    run = toy(1).runs[0]
    mirrored = with_motion(run, run.states[:, U], -run.states[:, V], -run.states[:, DELTA])
    np.testing.assert_array_equal(measured([run]), measured([mirrored]))


def test_a_ship_at_rest_has_finite_measures(toy):
    assert (measured([with_motion(toy(1).runs[0], 0.0, 0.0, 0.0)]) == 0.0).all()


def test_severity_is_the_largest_ratio_to_the_mean_over_runs():
    measures = np.array([[0.1, 0.0, 5.0], [0.3, 0.0, 5.0], [0.2, 0.0, 5.0]])
    assert severities(measures) == pytest.approx([1.0, 1.5, 1.0])


def test_severity_does_not_depend_on_the_units():
    measures = np.random.default_rng(0).random((8, 3))
    np.testing.assert_allclose(severities(measures * [57.3, 57.3, 0.1]), severities(measures))


def test_notes_name_the_measures_in_which_runs_go_beyond():
    trained, tested = np.array([[0.2, 0.1, 4.0], [0.1, 0.0, 5.0]]), np.array([[0.5, 0.05, 4.5], [0.3, 0.05, 6.0]])
    assert severity_notes(trained, tested) == (
        "trained on the 2 least severe runs: rudder up to 11.5 deg, drift angle up to 5.73 deg, speed up to 5.00 m/s",
        "tested on runs beyond: rudder 17.2 to 28.6 deg in 2 of 2, speed 6.00 to 6.00 m/s in 1 of 2",
    )
