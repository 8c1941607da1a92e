"""Known faults put into real measured runs must stand out by name and size. Runs only where a copy of the data is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from shipbench.data.base import load_dataset
from shipbench.diagnosis.preparation.time_offsets import put_back, unfiltered
from shipbench.diagnosis.selection.screening import screen
from shipbench.diagnosis.selection.stepwise import candidates_for
from shipbench.errors import InputError
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.forward import Plant
from shipbench.estimation.linearisation import Scales
from shipbench.records import Dataset, Run

FILTER = 0.93
"""Mean delay [s] of the published velocities behind the receiver's filter, as `shipbench data check` finds it."""

FAULTS = ("heading_bias", "speed_scale", "yaw_rate_bias", "antenna_offset", "position_delay")


@pytest.fixture(scope="module")
def recorded() -> Dataset:
    """The first 200 s of every sixteenth run, wind columns withheld, commands taken for positions (the search for
    quicker gears has nothing to do with sensors)."""
    try:
        data = load_dataset("esso_osaka[wind=false]")
    except InputError as error:
        pytest.skip(str(error))
    begins = [replace(r, t=r.t[:401], states=r.states[:401], inputs=r.inputs[:401]) for r in data.runs[::16]]
    return replace(data.with_runs(begins), actuators="measured")


@pytest.fixture(scope="module")
def runs(recorded) -> Dataset:
    """Before the receiver's filter, which `correct_late_velocities` takes out first."""
    return put_back(unfiltered(recorded, FILTER)[0], {}, FILTER)


def _with(data: Dataset, fault: Callable[[np.ndarray], None]) -> Dataset:
    changed = []
    for run in data.runs:
        states = run.states.copy()
        fault(states)
        changed.append(Run(run.id, run.t, states, run.inputs, run.inputs_names, run.meta))
    return replace(data, runs=tuple(changed))


def _scores(data: Dataset) -> dict[str, tuple[float, float]]:
    """Score and size of every fault of a sensor beside the plain model, in its first form."""
    plant = Plant.of(data)
    scales = Scales(plant)
    scores = screen(
        null_fit(plant, scales, [t for t in candidates_for(plant) if t.label in FAULTS and not any(t.setting)])
    )
    return {
        s.term.label: (s.score, float(s.estimate[0] * scales.amplitudes(s.term, plant.c.L)[0]))
        for s in reversed(scores)
    }


@pytest.fixture(scope="module")
def untouched(runs) -> dict[str, tuple[float, float]]:
    return _scores(runs)


def _turn(states: np.ndarray) -> None:
    states[:, 2] += np.deg2rad(2.0)


def _scale(states: np.ndarray) -> None:
    states[:, 3:5] *= 1.04


def _bias(states: np.ndarray) -> None:
    states[:, 5] += np.deg2rad(0.3)


def _arm(states: np.ndarray) -> None:
    states[:, 0] += 0.3 * np.cos(states[:, 2])
    states[:, 1] += 0.3 * np.sin(states[:, 2])


@pytest.mark.long
@pytest.mark.parametrize(
    ("effect", "fault", "size"),
    [
        ("heading_bias", _turn, np.deg2rad(2.0)),
        ("speed_scale", _scale, 0.04),
        ("yaw_rate_bias", _bias, np.deg2rad(0.3)),
        ("antenna_offset", _arm, 0.3),
    ],
)
def test_a_fault_put_into_real_runs_stands_out_with_its_size(runs, untouched, effect, fault, size):
    faulty = _scores(_with(runs, fault))
    assert faulty[effect][0] > untouched[effect][0] + 100.0
    assert faulty[effect][1] - untouched[effect][1] == pytest.approx(size, rel=0.15)


@pytest.mark.long
def test_the_lead_of_the_positions_that_the_data_are_known_for_is_found(recorded):
    score, delay = _scores(recorded)["position_delay"]
    assert score > 300.0
    assert -1.5 < delay < -0.3  # the data's own description: velocities lag the positions by about 0.6 s
