"""A block of a value that stands for "not available" is cut as a whole; standstills, steps and rounded records are no
such blocks."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from shipbench.checking.base import check_dataset
from shipbench.records import Dataset
from shipbench.signals import DELTA, PSI, STATES, R, U, X, Y
from shipbench.suites.checks.clean_sets import base_set


def with_block(data: Dataset, channels: list[int], value: float, first: int, last: int) -> Dataset:
    states = data.runs[2].states.copy()
    states[first : last + 1, channels] = value
    return data.with_runs([*data.runs[:2], replace(data.runs[2], states=states), *data.runs[3:]])


@pytest.mark.parametrize(
    ("channels", "value"),
    [
        ([PSI], np.deg2rad(511.0)),
        ([U], 102.3 * 0.5144),
        ([U], -999.0),
        ([R], 9999.0),
        ([DELTA], np.deg2rad(-128.0)),
        ([X, Y], 0.0),
        ([X, Y], 1e7),
    ],
)
def test_the_cut_covers_the_whole_block(channels, value):
    data = base_set("container130", 311)
    t = data.runs[2].t
    (finding,) = check_dataset(with_block(data, channels, value, 40, 44))
    assert (finding.kind, finding.channels) == ("placeholder", tuple(STATES[c] for c in channels))
    assert tomllib.loads(finding.line) == {"runs": {"run02": {"cut": [[pytest.approx(t[40]), pytest.approx(t[44])]]}}}


def test_samples_on_the_slopes_of_an_interpolated_block_go_with_it():
    data = with_block(base_set("container130", 311), [U], 52.6, 40, 44)
    states = data.runs[2].states
    for at, beside in ((39, 38), (45, 46)):
        states[at, U] = 0.5 * (states[beside, U] + 52.6)
    (finding,) = check_dataset(data)
    (cut,) = tomllib.loads(finding.line)["runs"]["run02"]["cut"]
    assert cut == [pytest.approx(data.runs[2].t[39]), pytest.approx(data.runs[2].t[45])]


def test_a_channel_that_freezes_at_its_last_value_is_no_placeholder():
    data = base_set("container130", 311)
    frozen = with_block(data, [U], float(data.runs[2].states[40, U]), 40, 60)
    assert "placeholder" not in {f.kind for f in check_dataset(frozen)}


def test_a_rudder_in_degrees_held_hard_over_is_a_unit_and_no_placeholder():
    data = base_set("container130", 311)
    runs = [
        replace(run, states=np.where(np.arange(run.states.shape[1]) == DELTA, np.rad2deg(run.states), run.states))
        for run in data.runs
    ]
    kinds = {(f.kind, f.channels) for f in check_dataset(data.with_runs(runs)) if "delta" in f.channels}
    assert kinds == {("unit", ("delta",))}
