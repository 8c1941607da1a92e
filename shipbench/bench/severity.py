"""Severity of a run: how far rudder, drift angle and speed go, each relative to its mean over the runs of a data set.

Severity is the largest of the three ratios. Runs up to a severity therefore stay inside a box of the three
measures, and every run beyond it leaves the box in one of them at least. Ratios, not ranks: where all runs have nearly
the same speed, a rank would sort them by noise, and a ratio leaves the choice to the other two. Means, not medians: the
median rudder angle is zero where half of the runs are straight.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..records import Run
from ..render.table import display_unit, significant
from ..signals import DELTA, U, V

_UNDER_WAY = 0.5
"""Share of a run's mean speed from which the drift angle counts: it is undefined at rest."""


@dataclass(frozen=True)
class Measure:
    """Measure of a run: its name, its stored unit and its largest value in the run."""

    name: str
    unit: str
    of: Callable[[Run], float]


def _rudder(run: Run) -> float:
    return float(np.abs(run.states[:, DELTA]).max())


def _drift(run: Run) -> float:
    u, v = np.abs(run.states[:, U]), np.abs(run.states[:, V])
    speed = np.hypot(u, v)
    return float(np.arctan2(v, u)[speed >= _UNDER_WAY * speed.mean()].max())


def _speed(run: Run) -> float:
    return float(np.hypot(run.states[:, U], run.states[:, V]).max())


MEASURES = (Measure("rudder", "rad", _rudder), Measure("drift angle", "rad", _drift), Measure("speed", "m/s", _speed))
"""Measures of severity. The speeds of one ship have the ratios of their Froude numbers."""


def measured(runs: Sequence[Run]) -> np.ndarray:
    """Measures of the runs (runs, 3): largest |rudder| [rad], drift angle under way [rad] and speed [m/s]."""
    return np.array([[measure.of(run) for measure in MEASURES] for run in runs])


def severities(measures: np.ndarray) -> np.ndarray:
    """Severity of each run (runs,) from `measures` (runs, 3). A measure that is zero in all runs counts nothing."""
    mean = measures.mean(axis=0)
    return (measures / np.where(mean > 0.0, mean, 1.0)).max(axis=1)


def severity_notes(trained: np.ndarray, tested: np.ndarray) -> tuple[str, str]:
    """Notes on the ranges of `trained` and of `tested` (runs, 3): the largest of each measure in training, and the
    range of each measure in the tested runs beyond it."""
    digits = significant(3)
    within, beyond = [], []
    for measure, largest, values in zip(MEASURES, trained.max(axis=0), tested.T, strict=True):
        unit, factor = display_unit(measure.unit)
        within.append(f"{measure.name} up to {digits(float(largest) * factor)} {unit}")
        if (out := values[values > largest]).size:
            low, high = (digits(float(end) * factor) for end in (out.min(), out.max()))
            beyond.append(f"{measure.name} {low} to {high} {unit} in {len(out)} of {len(tested)}")
    return (
        f"trained on the {len(trained)} least severe runs: {', '.join(within)}",
        f"tested on runs beyond: {', '.join(beyond)}",
    )
