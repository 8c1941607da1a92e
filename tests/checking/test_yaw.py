"""A yaw rate of another channel is called unrelated; no scale, lag or bias that explains nothing is told, nor one of a
derived channel."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.checking.base import check_dataset
from shipbench.records import Dataset
from shipbench.signals import PSI, R
from shipbench.suites.checks.clean_sets import base_set


def with_yaw_rate(data: Dataset, make) -> Dataset:
    runs = []
    for i, run in enumerate(data.runs):
        states = run.states.copy()
        states[:, R] = make(np.random.default_rng(i), states)
        runs.append(replace(run, states=states))
    return data.with_runs(runs)


@pytest.mark.parametrize("size", [1e-11, 1.0, 30.0])
def test_a_roll_rate_in_place_of_the_yaw_rate_has_no_scale_and_no_lag(size):
    data = base_set("container130", 311)
    rolling = with_yaw_rate(data, lambda rng, S: size * 0.02 * np.sin(0.6 * np.arange(len(S)) + rng.uniform(0.0, 6.0)))
    yaw = [(f.kind, f.line) for f in check_dataset(rolling) if "r" in f.channels]
    assert yaw == [("unrelated", "")]


def test_a_yaw_rate_that_import_made_of_the_heading_is_not_judged():
    data = base_set("container130", 311)
    slow = with_yaw_rate(data, lambda rng, S: 1.3 * np.gradient(S[:, PSI], data.dt))
    assert {f.kind for f in check_dataset(slow)} & {"scale", "yaw rate bias", "lag", "outliers"}
    assert check_dataset(replace(slow, derived=("r",))) == []
