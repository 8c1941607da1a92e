"""Wind channels as instruments on board show them are read as the true wind before anything is fitted; a true wind
stays as it is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.preparation.apparent_wind import true_wind
from shipbench.diagnosis.preparation.base import Prepared
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import PSI, U, V
from shipbench.simulate.trials import Trials, sea_trials


@pytest.fixture(scope="module")
def windy() -> Dataset:
    return sea_trials(load_mmg_ship("container130"), 41, (), Trials(runs=12, wind=(6.0, -5.0)), wind_recorded=True)


def _vector(dataset: Dataset) -> np.ndarray:
    return np.concatenate([run.inputs[:, -2] * np.exp(1j * run.inputs[:, -1]) for run in dataset.runs])


def _felt(dataset: Dataset, moving: float, from_bow: float, turned: float = 0.0) -> Dataset:
    runs = []
    for run in dataset.runs:
        psi, way = run.states[:, PSI], run.states[:, U] + 1j * run.states[:, V]
        wind = run.inputs[:, -2] * np.exp(1j * run.inputs[:, -1]) + moving * way * np.exp(1j * psi)
        inputs = np.column_stack([run.inputs[:, :-2], np.abs(wind), np.angle(wind) - from_bow * psi + turned])
        runs.append(replace(run, inputs=inputs))
    return dataset.with_runs(runs)


def test_a_true_wind_is_left_alone(windy):
    assert true_wind(Prepared(windy)) == Prepared(windy)


@pytest.mark.parametrize(("moving", "from_bow"), [(1.0, 1.0), (0.0, 1.0), (1.0, 0.0)])
def test_a_felt_wind_becomes_the_true_one(windy, moving: float, from_bow: float):
    ready = true_wind(Prepared(_felt(windy, moving, from_bow)))
    found, lines = ready.dataset, ready.notes
    np.testing.assert_allclose(_vector(found), _vector(windy), atol=1e-6)
    assert len(lines) == 1


def test_a_wind_that_is_where_it_blows_to_is_turned(windy):
    ready = true_wind(Prepared(_felt(windy, 0.0, 0.0, np.pi)))
    found, (line,) = ready.dataset, ready.notes
    np.testing.assert_allclose(_vector(found), _vector(windy), atol=1e-6)
    assert "blows to" in line


@pytest.mark.parametrize("kept", [-2, -1])
def test_half_a_wind_is_none_and_said(windy, kept: int):
    names = windy.inputs
    half = windy.with_runs(
        [replace(r, inputs=r.inputs[:, [0, 1, 2, 3, kept]], inputs_names=(*names[:4], names[kept])) for r in windy.runs]
    )
    ready = true_wind(Prepared(half))
    found, (line,) = ready.dataset, ready.notes
    assert found is half
    assert line.startswith(f"{names[kept]} is recorded alone")


@pytest.mark.long
def test_a_wind_as_felt_makes_no_cause(windy):
    found = diagnose(_felt(windy, 1.0, 1.0), gain=False)
    assert found.verdict == "none"
    assert any("apparent wind" in line for line in found.warnings)
