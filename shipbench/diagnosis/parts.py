"""Parts of runs that are too few but long: a sea trial is often one log of half an hour, and what changed in it did so at some time."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..records import Dataset

_SECONDS = 120.0
"""Least length of a part, at 130 m."""
_FEWEST, _MOST = 8, 24
"""Parts in all: fewer say too little of whether they agree."""


def runs_in_words(dataset: Dataset) -> str:
    """Their number."""
    return "1 run" if len(dataset) == 1 else f"{len(dataset)} runs"


def in_parts(dataset: Dataset, few: int) -> tuple[Dataset, list[str]]:
    """The data set with its runs cut into parts that count as runs, and a line for the reader, where it has less than `few` and they are long enough.
    Parts of one run are of one group: none is held out without the others."""
    if len(dataset) >= few:
        return dataset, []
    seconds = [float(run.t[-1] - run.t[0]) for run in dataset.runs]
    total = sum(seconds)
    length = max(_SECONDS * (dataset.ship.L / 130.0) ** 0.5, total / _MOST)
    parts = []
    for run, lasts in zip(dataset.runs, seconds, strict=True):
        edges = np.linspace(0, len(run) - 1, max(1, int(lasts / length)) + 1).round().astype(int)
        parts += [run.slice(a, b + 1, f" + {run.t[a] - run.t[0]:.0f} s") for a, b in pairwise(edges)]
    if len(parts) < _FEWEST:
        return dataset, []
    line = (
        f"{runs_in_words(dataset)} of {total:.0f} s in all: cut into {len(parts)} parts of about {total / len(parts):.0f} s, which count as runs. "
        "What a run has as a whole (its wind and current, its load, the error of a sensor on that day) passes for the ship's own: sail other days "
        "and courses."
    )
    return dataset.with_runs(parts), [line]
