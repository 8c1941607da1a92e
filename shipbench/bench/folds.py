"""Folds by run: never by window and never by sample; runs of one group stay on one side; windows are cut after the
split."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..errors import InputError
from ..records import Dataset, Run
from ..signals import U, V
from .severity import measured, severities, severity_notes
from .task import Task

_MILD_SHARE = 0.6
"""Share of the runs, the least severe, that split = "extrapolate" trains on."""
_LEAST_STEP = 1.1
"""Severity of the most severe run relative to the training runs, below which all runs count as alike."""


@dataclass(frozen=True)
class Fold:
    """Windows for fitting, for early stopping (or None) and for scoring."""

    index: int
    train: Dataset
    valid: Dataset | None
    test: Dataset


def select_runs(dataset: Dataset, task: Task) -> tuple[Dataset, tuple[str, ...]]:
    """Runs that can be used (long enough; at most `max_runs`, evenly spread), and a note on each reduction.

    Raises:
        InputError: no run is as long as the horizon.
    """
    steps, history = task.steps(dataset.dt), task.history(dataset.dt)
    usable = [r for r in dataset.runs if len(r) > steps + history]
    notes: list[str] = []
    if not usable:
        dataset.windows(steps, history=history)  # raises with the figures
    if len(usable) < len(dataset):
        short = [r.id for r in dataset.runs if len(r) <= steps + history]
        notes.append(
            f"{len(short)} of {len(dataset)} runs are shorter than the horizon and left out: {', '.join(short[:8])}"
        )
    if task.max_runs is not None and len(usable) > task.max_runs:
        notes.append(f"max_runs = {task.max_runs}: {task.max_runs} of {len(usable)} runs are used, evenly spread")
        usable = [usable[i] for i in np.linspace(0, len(usable) - 1, task.max_runs).round().astype(int)]
    if task.split == "published":
        sides = {side: {r.group for r in usable if r.meta.split == side} for side in ("train", "test")}
        for group in sorted(sides["train"] & sides["test"]):
            notes.append(f"the published split has pieces of '{group}' both in training and in test")
    selected = dataset.with_runs(usable)
    return selected, (*notes, *split_notes(selected, task))


def _grouped(runs: Sequence[Run]) -> list[list[Run]]:
    """Runs by group, in the order of the data set."""
    groups: dict[str, list[Run]] = {}
    for run in runs:
        groups.setdefault(run.group, []).append(run)
    return list(groups.values())


def _groups(runs: Sequence[Run], rng: np.random.Generator) -> list[list[Run]]:
    """Runs by group, groups in random order."""
    ordered = _grouped(runs)
    return [ordered[i] for i in rng.permutation(len(ordered))]


def _deal(groups: list[list[Run]], folds: int) -> list[list[Run]]:
    """Groups dealt whole into `folds` parts of nearly equal numbers of runs: the greatest first, each to the smallest
    part."""
    parts: list[list[Run]] = [[] for _ in range(folds)]
    for group in sorted(groups, key=len, reverse=True):
        min(parts, key=len).extend(group)
    return parts


def _carve_valid(runs: Sequence[Run], count: int | None, rng: np.random.Generator) -> tuple[list[Run], list[Run]]:
    """Training and validation runs (train, valid): whole groups, until `count` runs (default: one ninth) are set
    aside."""
    wanted = max(1, round(len(runs) / 9)) if count is None else count
    valid: list[Run] = []
    groups = _groups(runs, rng)
    while len(valid) < wanted and len(groups) > 1:
        valid += groups.pop()
    if count is not None and len(valid) < count:
        raise InputError(
            f"valid_runs = {count}, but only {len(runs)} training runs in {len(_groups(runs, rng))} groups are there, "
            "and one group must remain for training. Give a smaller number."
        )
    chosen = {r.id for r in valid}
    return [r for r in runs if r.id not in chosen], valid


def _published(dataset: Dataset) -> list[tuple[list[Run], list[Run]]]:
    sides = {side: [r for r in dataset.runs if r.meta.split == side] for side in ("train", "test")}
    for side, runs in sides.items():
        if not runs:
            raise InputError(
                f"split = 'published', but no usable run of data set '{dataset.name}' has split = \"{side}\" in its "
                "metadata; "
                "use split = 'folds', or add it under [runs.<id>] in dataset.toml."
            )
    return [(sides["train"], sides["test"])]


def _by_folds(dataset: Dataset, task: Task) -> list[tuple[list[Run], list[Run]]]:
    groups = _groups(dataset.runs, np.random.default_rng(task.fold_seed))
    if task.folds > len(groups):
        what = "runs" if len(groups) == len(dataset) else "groups of runs"
        if len(groups) == 1:
            raise InputError(
                f"data set '{dataset.name}' is one run or one group of runs, which no fold may part: nothing could "
                "be held out. "
                "Cut a long log into windows (shipbench data import --window 300), remove `group` from "
                "dataset.toml, or add runs."
            )
        raise InputError(
            f"folds = {task.folds}, but data set '{dataset.name}' has {len(groups)} {what}; give at most "
            f"{len(groups)} folds."
        )
    parts = [{r.id for r in part} for part in _deal(groups, task.folds)]
    return [([r for r in dataset.runs if r.id not in ids], [r for r in dataset.runs if r.id in ids]) for ids in parts]


def kinds_of(dataset: Dataset) -> list[str]:
    """Kinds of manoeuvre of a data set, in the order of the folds of split = "kind"."""
    return sorted({r.kind for r in dataset.runs})


def _parted(dataset: Dataset, test: list[Run]) -> tuple[list[Run], list[Run]]:
    """Remaining and scored runs (rest, test): runs of a group that is scored train nothing."""
    scored = {r.group for r in test}
    return [r for r in dataset.runs if r.group not in scored], test


def _by_kind(dataset: Dataset) -> list[tuple[list[Run], list[Run]]]:
    kinds = kinds_of(dataset)
    pairs = [_parted(dataset, [r for r in dataset.runs if r.kind == kind]) for kind in kinds]
    empty = [kind for kind, (rest, _) in zip(kinds, pairs, strict=True) if not rest]
    if len(kinds) < 2 or empty:
        why = (
            f"without '{empty[0]}' no run is left to train on"
            if empty and len(kinds) > 1
            else f"every run has manoeuvre = '{kinds[0]}'"
        )
        raise InputError(
            f"split = 'kind', but in data set '{dataset.name}' {why}; name the kinds (two or more) with manoeuvre = "
            '".." under [runs.<id>] '
            "in dataset.toml, or use split = 'folds'."
        )
    return pairs


def mean_speed(run: Run) -> float:
    """Mean resultant speed of a run [m/s]."""
    return float(np.hypot(run.states[:, U], run.states[:, V]).mean())


def _by_severity(dataset: Dataset) -> tuple[list[Run], list[Run]]:
    """Training and scored runs (rest, test) by severity, whole groups: the least severe train, the runs beyond all of
    them are scored.

    A group is as severe as its most severe run. The milder runs of a group that is scored are left out.
    """
    severity = dict(zip((r.id for r in dataset.runs), severities(measured(dataset.runs)).tolist(), strict=True))
    mildest, *others = sorted(_grouped(dataset.runs), key=lambda group: max(severity[r.id] for r in group))
    rest = [*mildest]
    for group in others:
        if len(rest) + len(group) > _MILD_SHARE * len(dataset):
            break
        rest += group
    limit, largest = max(severity[r.id] for r in rest), max(severity.values())
    if largest <= _LEAST_STEP * limit:
        why = (
            f"rudder, drift angle and speed of all runs are alike: severity {largest:.3g} at most, {limit:.3g} in "
            f"the training runs, and more than {_LEAST_STEP:g} times that is needed"
            if others
            else "all runs are one group, which no split may part"
        )
        raise InputError(
            f"split = 'extrapolate', but in data set '{dataset.name}' {why}. Add runs with larger rudder angles or "
            "higher speeds, or use split = 'folds'."
        )
    trained = {r.group for r in rest}
    test = [r for r in dataset.runs if r.group not in trained and severity[r.id] > limit]
    return [r for r in dataset.runs if r.group in trained], test


def _by_speed(dataset: Dataset, task: Task) -> list[tuple[list[Run], list[Run]]]:
    """Folds by mean speed, whole groups: the fastest are scored, until they are one `folds`-th of the runs."""
    groups = _grouped(dataset.runs)
    if len(groups) < 2:
        raise InputError(
            f"split = 'speed', but data set '{dataset.name}' has one group of runs only; two or more are needed. "
            "Use split = 'published'."
        )
    fastest = sorted(groups, key=lambda group: -float(np.mean([mean_speed(r) for r in group])))
    test: list[Run] = []
    for group in fastest[:-1]:
        test += group
        if len(test) * task.folds >= len(dataset):
            break
    return [_parted(dataset, test)]


def _fewer(rest: list[Run], task: Task, index: int) -> tuple[list[Run], int | None]:
    """The training runs of a task with `train_runs`, whole groups in a random order that is the same for every number,
    and its `valid_runs`."""
    if task.train_runs is None:
        return rest, task.valid_runs
    if task.train_runs > len(rest):
        raise InputError(
            f"train_runs = {task.train_runs}, but fold {index} has {len(rest)} training runs; give at most {len(rest)}."
        )
    kept: list[Run] = []
    for group in _groups(rest, np.random.default_rng([task.fold_seed, index, 2])):
        if len(kept) + len(group) <= task.train_runs:
            kept += group
    if len({r.group for r in kept}) < 2:
        raise InputError(
            f"train_runs = {task.train_runs}: in fold {index} that is fewer than two groups of runs, one to fit and "
            "one for early stopping; "
            "give more runs."
        )
    valid = task.valid_runs
    return kept, valid if not valid else max(1, round(valid * len(kept) / len(rest)))


def split_notes(dataset: Dataset, task: Task) -> tuple[str, ...]:
    """Notes on an extrapolation split: the kind that each fold scores, or the ranges of the training and test runs."""
    if task.split == "kind":
        pairs = _by_kind(dataset)
        return tuple(
            f"fold {i} scores '{kind}' ({len(test)} runs) after training on the other kinds ({len(rest)} runs)"
            for i, (kind, (rest, test)) in enumerate(zip(kinds_of(dataset), pairs, strict=True))
        )
    if task.split == "speed":
        [(rest, test)] = _by_speed(dataset, task)
        slow, fast = sorted(map(mean_speed, rest)), sorted(map(mean_speed, test))
        return (
            f"trained on {len(rest)} runs with mean speeds of {slow[0]:.3g} to {slow[-1]:.3g} m/s, "
            f"scored on the {len(test)} fastest with {fast[0]:.3g} to {fast[-1]:.3g} m/s",
        )
    if task.split == "extrapolate":
        rest, test = _by_severity(dataset)
        out = len(dataset) - len(rest) - len(test)
        left = [f"left out: {out} runs that are no more severe than the training runs"] if out else []
        return (*severity_notes(measured(rest), measured(test)), *left)
    return ()


def _pairs(dataset: Dataset, task: Task) -> list[tuple[list[Run], list[Run]]]:
    """Remaining and scored runs (rest, test) of each fold."""
    if task.split == "published":
        return _published(dataset)
    if task.split == "kind":
        return _by_kind(dataset)
    if task.split == "extrapolate":
        return [_by_severity(dataset)]
    return _by_speed(dataset, task) if task.split == "speed" else _by_folds(dataset, task)


def make_folds(dataset: Dataset, task: Task) -> list[Fold]:
    """The folds of a task, the same for every model. The splits "published", "speed" and "extrapolate" are a
    single fold.

    `dataset` holds whole runs (see `select_runs`). Training and validation windows do not overlap; scored windows are
    `stride_s` apart.

    Raises:
        InputError: more folds than groups, too many training or validation runs, no published split, no kinds to tell
            apart, or runs that are all alike.
    """
    steps, history, stride = task.steps(dataset.dt), task.history(dataset.dt), task.stride(dataset.dt)
    cut = cache(lambda run, every: run.windows(history + steps + 1, every))  # the folds share the windows of a run

    def windows(runs: Sequence[Run], every: int = steps) -> Dataset:
        return dataset.with_runs(window for run in runs for window in cut(run, every))

    folds = []
    for index, (rest, test) in enumerate(_pairs(dataset, task)):
        rest, valid_runs = _fewer(rest, task, index)
        train, valid = _carve_valid(rest, valid_runs, np.random.default_rng([task.fold_seed, index, 1]))
        folds.append(Fold(index, windows(train), windows(valid) if valid else None, windows(test, stride or steps)))
    return folds
