"""Frames, hemispheres and earth-fixed velocities are named as such, and not as other errors that explain the same
track."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shipbench.checking.base import check_dataset
from shipbench.records import Dataset
from shipbench.signals import PSI, N, R, U, V, X, Y
from shipbench.suites.checks.clean_sets import base_set


def changed(data: Dataset, change: Callable[[np.ndarray], None]) -> Dataset:
    runs = []
    for run in data.runs:
        states = run.states.copy()
        change(states)
        runs.append(replace(run, states=states))
    return data.with_runs(runs)


@pytest.fixture(scope="module")
def clean() -> Dataset:
    return base_set("container130", 311)


def test_both_axes_reversed_is_one_error_of_the_position(clean):
    def reverse(S: np.ndarray) -> None:
        S[:, [X, Y]] *= -1.0

    (finding,) = check_dataset(changed(clean, reverse))
    assert (finding.kind, finding.channels) == ("position reversed", ("x", "y"))
    assert finding.line == '[signs]\nx = "south"\ny = "west"'
    assert "hemisphere" in finding.todo


def test_speeds_and_shaft_that_count_astern_are_not_taken_for_it(clean):
    def reverse(S: np.ndarray) -> None:
        S[:, [U, V]] *= -1.0

    assert {(f.kind, f.channels) for f in check_dataset(changed(clean, reverse))} == {
        ("sign", ("u",)),
        ("sign", ("v",)),
    }


def small_turns(S: np.ndarray) -> None:
    """Courses within a few degrees of north, velocities in the earth's axes: as if psi were nothing."""
    psi = 0.03 * (S[:, PSI] - S[0, PSI])
    way = (S[:, U] + 1j * S[:, V]) * np.exp(1j * psi)
    S[:, PSI], S[:, R], S[:, U], S[:, V] = psi, 0.03 * S[:, R], way.real, way.imag
    z = np.concatenate([[0.0], np.cumsum(0.5 * (way[1:] + way[:-1]))])
    S[:, X], S[:, Y] = z.real, z.imag


def test_earth_fixed_velocities_on_small_turns_are_not_a_heading_in_degrees(clean):
    data = changed(clean, small_turns)
    one_second = replace(
        data, dt=1.0, runs=tuple(replace(run, t=np.arange(len(run), dtype=float)) for run in data.runs)
    )
    found = [f for f in check_dataset(one_second) if "psi" in f.channels or "u" in f.channels]
    assert [f.line for f in found] == ['velocities = "earth"']


def test_with_earth_fixed_velocities_the_track_tells_nothing_of_a_late_heading(clean):
    def late(S: np.ndarray) -> None:
        way = (S[:, U] + 1j * S[:, V]) * np.exp(1j * S[:, PSI])
        S[:, U], S[:, V] = way.real, way.imag
        S[4:, PSI] = S[:-4, PSI].copy()
        S[4:, R] = S[:-4, R].copy()

    found = check_dataset(changed(clean, late))
    assert found[0].kind == "earth-fixed velocities"
    assert not [f for f in found if f.check == "track"]


def test_shaft_alone_reversed_is_still_found(clean):
    def reverse(S: np.ndarray) -> None:
        S[:, N] *= -1.0

    assert [
        (f.kind, f.channels) for f in check_dataset(changed(clean, reverse)) if f.kind == "sign" and "n" in f.channels
    ] == [("sign", ("n",))]
