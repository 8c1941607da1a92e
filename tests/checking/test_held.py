"""Positions that are held between fixes are found and bridged; rounded positions and a ship at rest are not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.checking.base import check_dataset
from shipbench.data.corrections import between_fixes
from shipbench.records import Dataset
from shipbench.signals import PSI, X, Y
from shipbench.suites.checks.clean_sets import base_set


def held(data: Dataset, every: int, **late: int) -> Dataset:
    """Positions held for `every` samples, each channel renewed so many samples late."""
    runs = []
    for run in data.runs:
        states, k = run.states.copy(), np.arange(len(run))
        for channel, first in ((X, late.get("x", 0)), (Y, late.get("y", 0))):
            states[:, channel] = states[np.maximum((k - first) // every * every + first, 0), channel]
        runs.append(replace(run, states=states))
    return data.with_runs(runs)


@pytest.mark.parametrize(("every", "late"), [(2, {}), (5, {}), (5, {"y": 2})])
def test_held_fixes_are_named_also_where_latitude_and_longitude_come_in_turn(every, late):
    (finding,) = check_dataset(held(base_set("container130", 311), every, **late))
    assert (finding.kind, finding.channels) == ("held fixes", ("x", "y"))
    assert finding.line == 'held = ["x", "y"]'
    assert finding.evidence["samples"] == every


def test_positions_in_whole_metres_are_not_held():
    data = base_set("container130", 311)
    coarse = data.with_runs(
        [
            replace(run, states=np.hstack([np.round(run.states[:, :2] / 5.0) * 5.0, run.states[:, 2:]]))
            for run in data.runs
        ]
    )
    assert "held fixes" not in {f.kind for f in check_dataset(coarse)}


def test_straight_lines_go_from_fix_to_fix_and_a_rest_stays_a_rest():
    values = np.repeat([0.0, 1.0, 3.0, 3.0, 3.0, 5.0, 6.0], 4)
    expected = np.concatenate(
        [np.interp(np.arange(16), [0, 4, 8, 16], [0, 1, 3, 3]), np.interp(np.arange(12), [0, 4, 11], [3, 5, 6.75])]
    )
    assert between_fixes(values)[:24] == pytest.approx(expected[:24], abs=0.76)
    assert between_fixes(values)[8:17] == pytest.approx(np.full(9, 3.0))
    assert between_fixes(np.arange(5.0)) == pytest.approx(np.arange(5.0))


def test_a_held_heading_is_one_too():
    data = base_set("container130", 311)
    runs = [replace(run, states=run.states.copy()) for run in data.runs]
    for run in runs:
        run.states[:, PSI] = run.states[np.arange(len(run)) // 4 * 4, PSI]
    assert "psi" in {c for f in check_dataset(data.with_runs(runs)) if f.kind == "held fixes" for c in f.channels}
