"""Splitting of few but long runs: a sea trial is often one log of half an hour, within which something may change."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...errors import InputError
from ...estimation.forward import SEGMENT
from ...records import Dataset
from ..thresholds import THRESHOLDS
from .base import Prepared

LEAST_RUNS, LEAST_SAMPLES = THRESHOLDS.count("least_runs"), THRESHOLDS.count("least_samples")
"""Fewest runs and samples with which a cause is reported."""


def runs_in_words(dataset: Dataset) -> str:
    """Number of the runs, in words."""
    return "1 run" if len(dataset) == 1 else f"{len(dataset)} runs"


def is_too_little(dataset: Dataset) -> bool:
    """Check whether runs or samples are too few for any cause to be reported."""
    return len(dataset) < LEAST_RUNS or sum(map(len, dataset.runs)) < LEAST_SAMPLES


def split_long_runs(prepared: Prepared) -> Prepared:
    """Cut runs into parts that count as runs, where they are too few and long enough. Parts of one run are of one
    group: none is held out without the others."""
    dataset = prepared.dataset
    if len(dataset) >= LEAST_RUNS:
        return prepared
    seconds = [float(run.t[-1] - run.t[0]) for run in dataset.runs]
    total = sum(seconds)
    shortest = THRESHOLDS.value("run_duration") * (dataset.ship.L / 130.0) ** 0.5
    length = max(shortest, total / THRESHOLDS.count("most_parts"))
    parts = []
    for run, lasts in zip(dataset.runs, seconds, strict=True):
        edges = np.linspace(0, len(run) - 1, max(1, int(lasts / length)) + 1).round().astype(int)
        parts += [run.slice(a, b + 1, f" + {run.t[a] - run.t[0]:.0f} s") for a, b in pairwise(edges)]
    if len(parts) < LEAST_RUNS:
        return prepared
    line = (
        f"{runs_in_words(dataset)} of {total:.0f} s in all: cut into {len(parts)} parts of about "
        f"{total / len(parts):.0f} s, which count as runs. "
        "What a run has as a whole (its wind and current, its load, the error of a sensor on that day) passes for "
        "the ship's own: sail other days "
        "and courses."
    )
    return prepared.corrected(dataset.with_runs(parts), line)


def refuse_too_little(prepared: Prepared) -> Prepared:
    """Refuse runs that cannot be fitted; warn of unreliable results.

    Raises:
        InputError: too few samples, samples too rare, or a ship that never moves.
    """
    dataset = prepared.dataset
    samples = sum(len(r) for r in dataset.runs)
    if samples < 20:
        raise InputError(
            f"data set '{dataset.name}' has {samples} samples in {runs_in_words(dataset)}; a diagnosis needs at "
            "least 20, better 24 runs of 120 s."
        )
    L = dataset.ship.L
    rarest = SEGMENT * (L / 130.0) ** 0.5
    if dataset.dt > rarest:
        raise InputError(
            f"data set '{dataset.name}' has a sample every {dataset.dt:g} s. A ship of {L:g} m turns in less. "
            f"Accepted: up to {rarest:.3g} s. "
            "Give t and dt in dataset.toml in seconds."
        )
    states = np.concatenate([r.states for r in dataset.runs])
    if np.max(np.hypot(states[:, 3], states[:, 4])) < 0.01 * L**0.5:
        raise InputError(
            f"data set '{dataset.name}': the ship never moves faster than {0.01 * L**0.5:.2f} m/s; check the "
            "columns u and v and their units."
        )
    warnings = []
    if is_too_little(dataset):
        warnings.append(
            f"{runs_in_words(dataset)} and {samples} samples are too few to name a cause "
            f"(at least {LEAST_RUNS} runs and {LEAST_SAMPLES} samples): candidates are ranked, none is named."
        )
    if np.std(states[:, 7]) < 1e-3 and np.std(states[:, 5]) < 1e-5:
        warnings.append("the rudder is never used and the ship never turns: rudder and hull cannot be identified.")
    return prepared.corrected(dataset, *warnings)


def sort_by_time(prepared: Prepared) -> Prepared:
    """Sort runs by time, where all have a beginning: a change begins with one of them."""
    dataset = prepared.dataset
    began = {run.id: run.began for run in dataset.runs}
    known = {name: moment for name, moment in began.items() if moment is not None}
    if len(known) < len(began):
        return prepared
    return prepared.corrected(dataset.with_runs(sorted(dataset.runs, key=lambda run: known[run.id])))
