"""What the values of single runs go with is told: a current that differs from place to place is not one drawn anew for
each run."""

from __future__ import annotations

import numpy as np
import pytest
from made_fits import made_segments

from shipbench.diagnosis.evaluation.run_values import goes_with

RUNS, SAMPLES = 24, 30


@pytest.fixture
def sailed():
    """Runs in pieces of two, each about a place of its own."""
    rng = np.random.default_rng(0)
    places = rng.uniform(-2000.0, 2000.0, (RUNS, 2))
    run = np.repeat(np.arange(RUNS), 2)
    states = places[run][:, None, :] + rng.normal(0.0, 50.0, (2 * RUNS, SAMPLES, 2))
    return places, made_segments(run, states=np.pad(states, [(0, 0), (0, 0), (0, 8)]))


def test_a_current_that_differs_from_place_to_place_is_told_so(sailed):
    places, seg = sailed
    current = np.stack([0.05 + 2e-4 * places[:, 1], np.full(RUNS, 0.1)], axis=1) + np.random.default_rng(1).normal(
        0.0, 0.05, (RUNS, 2)
    )
    assert goes_with(seg, current).startswith("it differs from place to place: ")
    assert goes_with(seg, 5.0 * current) == goes_with(seg, current)


def test_a_tide_goes_with_the_number_of_the_run(sailed):
    tide = np.stack([np.linspace(-0.3, 0.3, RUNS), np.zeros(RUNS)], axis=1) + np.random.default_rng(1).normal(
        0.0, 0.05, (RUNS, 2)
    )
    assert goes_with(sailed[1], tide).startswith("it differs with time: ")


def test_values_that_are_drawn_anew_for_each_run_go_with_nothing(sailed):
    drawn = np.random.default_rng(2).normal(0.0, 0.3, (200, RUNS, 2))
    assert not any(goes_with(sailed[1], values) for values in drawn)
    assert not goes_with(sailed[1], np.zeros((RUNS, 2)))
