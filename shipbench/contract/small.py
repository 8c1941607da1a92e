"""Small data on which the contract is checked in seconds: simulated port manoeuvres, or a few windows of a data set."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError
from ..physics.mmg import load_mmg_ship
from ..predictors.context import Context
from ..records import Dataset, Run
from ..signals import COMMANDS
from ..simulate.harbour import draw_plan, fly

NUM_RUNS, STEPS, MIN_RUNS = 16, 30, 6
_ENVIRONMENT = {"wind_speed": (2.0, 8.0), "wind_from": (-3.0, 3.0), "depth": (12.0, 30.0)}
"""Range from which the constant value of each run is drawn, in the units of `signals.UNITS`."""


def small_harbour(
    num: int = NUM_RUNS, horizon: int = STEPS, seed: int = 4, inputs: tuple[str, ...] = COMMANDS
) -> Dataset:
    """Simulated port manoeuvres, `num` runs of a 130 m container ship, `horizon` seconds at 1 s.

    `inputs` may add environment channels; they are constant in a run and do not act on the ship.
    """
    ship = load_mmg_ship("container130")
    rng = np.random.default_rng(seed)
    S, C = fly(ship, draw_plan(rng, num, ship.L, horizon, 30), rng, horizon, 30)
    t = np.arange(horizon + 1.0)
    extras = [np.repeat(rng.uniform(*_ENVIRONMENT[name], (num, 1)), len(t), axis=1) for name in inputs[len(COMMANDS) :]]
    held = np.concatenate([C, *[e[..., None] for e in extras]], axis=2)
    runs = tuple(Run(f"run{i}", t, S[i], held[i], inputs) for i in range(num))
    return Dataset(
        "small_harbour", ship.particulars, 1.0, runs, simulation="container130" if inputs == COMMANDS else None
    )


def few_windows(data: Dataset, skips: Callable[[Context, int], Sequence[str]] | None = None) -> Dataset:
    """Windows of `data`, evenly spread: at most `NUM_RUNS` of at most `STEPS` steps; without those for which `skips`
    gives a reason.

    Raises:
        InputError: there are fewer than `MIN_RUNS` windows.
    """
    longest = max(len(run) for run in data.runs) - 1
    windows = data.windows(min(STEPS, longest))
    if skips is not None:
        reasons = skips(Context.of(windows), min(STEPS, longest))
        if not (kept := [i for i, reason in enumerate(reasons) if not reason]):
            raise InputError(
                f"the model predicts no window of '{data.name}': {reasons[0]}. Give runs that it predicts."
            )
        windows = windows.subset(kept)
    if len(windows) < MIN_RUNS:
        found = f"data set '{data.name}' has {len(windows)} windows of {min(STEPS, longest)} steps"
        raise InputError(f"{found}; the check needs {MIN_RUNS}. Leave --dataset out, or give more runs.")
    return windows.subset(np.linspace(0, len(windows) - 1, min(NUM_RUNS, len(windows))).round().astype(int).tolist())


def copied(data: Dataset) -> Dataset:
    """Copy of the data in arrays of their own, so that nobody can write into the originals."""
    return data.with_runs(
        replace(r, t=r.t.copy(), states=r.states.copy(), inputs=r.inputs.copy(), meta=replace(r.meta))
        for r in data.runs
    )


def what_changed(before: Dataset, after: Dataset) -> str:
    """Name of the first difference between two copies of the same data, or ""."""
    for a, b in zip(before.runs, after.runs, strict=True):
        for name in ("t", "states", "inputs"):
            if not np.array_equal(getattr(a, name), getattr(b, name)):
                return f"{name} of run '{a.id}' ({int((getattr(a, name) != getattr(b, name)).sum())} values)"
        if a.meta != b.meta:
            return f"meta of run '{a.id}'"
    return ""
