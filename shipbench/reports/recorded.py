"""Recorded runs as linked plots: tracks and time histories of a data set, for pages that show data and no
prediction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..leaderboard.histories import EAST, NORTH, SIGNALS
from ..leaderboard.plots import outline
from ..records import Dataset, Run
from ..render.linked import Line, linked_plots, linked_run
from ..signals import DELTA, F_B, F_S, PSI, STATES, N, X, Y

RUNS = 24
"""Most runs of one page."""
_SAMPLES = 60_000
"""Time steps of all runs of one page together: some 3 MB, beside Plotly's 1.2 MB."""
_COMMANDS = (DELTA, N, F_B, F_S)


def recorded_plots(
    dataset: Dataset, runs: Mapping[str, Sequence[Run]], notes: Mapping[str, str], start: str = ""
) -> dict[str, Any]:
    """Linked plots of tracks, states and commands.

    Args:
        dataset: whose ship and inputs the runs are of.
        runs: by name the pieces of a run, in the order of time; between two pieces the lines are broken.
        notes: by name the text that the run selector shows beside it.
        start: name of the run that is shown first.
    """
    everything = np.concatenate([piece.states for pieces in runs.values() for piece in pieces])
    signals = [s for s in SIGNALS if s[0] not in (F_B, F_S) or np.any(everything[:, s[0]] != 0.0)]
    commands = {
        f"{STATES[i]}_c": (factor, q)
        for i, factor, q in signals
        if i in _COMMANDS and f"{STATES[i]}_c" in dataset.inputs
    }
    columns = [EAST, NORTH, *(q for _, _, q in signals)]
    most = _SAMPLES // len(runs)
    drawn = []
    for name, pieces in runs.items():
        t, S, U = _joined(pieces)
        states = {"east": S[:, Y], "north": S[:, X]} | {q.name: factor * S[:, i] for i, factor, q in signals}
        ordered = {q.name: factor * U[:, dataset.inputs.index(key)] for key, (factor, q) in commands.items()}
        kept = thinned(np.stack([*states.values(), *ordered.values()], axis=1), most)
        lines = [
            {key: column[kept] for key, column in line.items()} for line in (states, ordered)[: 2 if commands else 1]
        ]
        whole = S[np.isfinite(S).all(axis=1)]
        hulls = [
            outline(float(s[X]), float(s[Y]), float(s[PSI]), dataset.ship.L, dataset.ship.B)
            for s in whole[np.linspace(0, len(whole) - 1, 5).round().astype(int)]
        ]
        drawn.append(linked_run(name, notes.get(name, ""), t[kept], columns, lines, hulls))
    series = [Line("recorded", "measured"), Line("command", 0)][: 2 if commands else 1]
    first = list(runs).index(start) if start in runs else 0
    return linked_plots(columns, series, [q.name for _, _, q in signals], drawn, ("east", "north"), first)


def _joined(pieces: Sequence[Run]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, states and inputs of the pieces, with a row of NaN where one ends and another begins."""
    t, S, U = [pieces[0].t], [pieces[0].states], [pieces[0].inputs]
    for before, piece in pairwise(pieces):
        t += [before.t[-1:], piece.t]
        S += [np.full((1, piece.states.shape[1]), np.nan), piece.states]
        U += [np.full((1, piece.inputs.shape[1]), np.nan), piece.inputs]
    return np.concatenate(t), np.concatenate(S), np.concatenate(U)


def thinned(columns: np.ndarray, most: int) -> np.ndarray:
    """Indices of about `most` of the rows of `columns` (n, k), in order: evenly spread, and in each stretch between
    them the rows where a column is least and greatest, so that a single wrong sample stays visible."""
    n, k = columns.shape
    if n <= most:
        return np.arange(n)
    stretches = max(1, most // (2 * k + 1))
    edges = np.linspace(0, n, stretches + 1).round().astype(int)
    kept = {0, n - 1}
    for a, b in pairwise(edges):
        part = columns[a:b]
        gaps = ~np.isfinite(part)
        kept.update(
            (a, *(a + np.where(gaps, np.inf, part).argmin(axis=0)), *(a + np.where(gaps, -np.inf, part).argmax(axis=0)))
        )
        kept.update((a + np.flatnonzero(gaps.all(axis=1))).tolist())  # breaks of the lines
    return np.array(sorted(int(i) for i in kept))
