"""Velocities through water, put over ground."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.preparation.base import Prepared
from shipbench.diagnosis.preparation.water_speeds import speeds_over_ground
from shipbench.records import Dataset
from shipbench.signals import PSI, U, V, X, Y

NORTH, EAST = 0.6, -0.3


def turning(toy, drift: bool) -> Dataset:
    """Runs whose positions follow from their velocities; u and v of a log that does not see the drift, if any."""
    runs = []
    for run in toy(runs=6, steps=120).runs:
        S = run.states.copy()
        c, s = np.cos(S[:, PSI]), np.sin(S[:, PSI])
        rate = np.stack([c * S[:, U] - s * S[:, V] + drift * NORTH, s * S[:, U] + c * S[:, V] + drift * EAST], axis=1)
        S[1:, [X, Y]] = np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(run.t)[:, None], axis=0)
        S[0, [X, Y]] = 0.0
        runs.append(replace(run, states=S))
    return toy(runs=1).with_runs(runs)


def test_the_drift_of_the_track_is_added_to_the_velocities_and_told(toy):
    data = turning(toy, drift=True)
    found = speeds_over_ground(Prepared(data))
    assert "the track drifts 0.67" in found.notes[0]
    assert "towards 333 deg" in found.notes[0]
    for run, before in zip(found.dataset.runs, data.runs, strict=True):
        c, s = np.cos(run.states[:, PSI]), np.sin(run.states[:, PSI])
        added = run.states - before.states
        assert c * added[:, U] - s * added[:, V] == pytest.approx(np.full(len(run), NORTH), abs=0.02)
        assert s * added[:, U] + c * added[:, V] == pytest.approx(np.full(len(run), EAST), abs=0.02)


def test_velocities_over_ground_and_derived_ones_are_left_alone(toy):
    over_ground = Prepared(turning(toy, drift=False))
    assert speeds_over_ground(over_ground) is over_ground
    derived = Prepared(replace(turning(toy, drift=True), derived=("u", "v")))
    assert speeds_over_ground(derived) is derived
