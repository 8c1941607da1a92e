"""Result of a leaderboard in one or two sentences, in tiles, and in the short table of a terminal: best model, its
lead, significance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..render.html import Tile, short_name
from ..render.table import Table, number
from .scores import Scores
from .statistics import Pair

_CERTAIN = 0.05
"""p-value (after Holm) below which the difference of two models is significant."""


def lead(scores: Scores) -> str:
    """Sentences on the best model, its lead over the second, and the significance."""
    ranked = [model for model in scores.ranked if scores.shares[model][0]]
    if not ranked:
        return "No model has a score; the reasons stand in the table Status and cost, in Python in scores.results.rows."
    first, errors = ranked[0], scores.figures("ed")
    mean = f"'{first}' has a mean position error (ED) of {_metres(errors[first]['ed_mean'])}"
    if len(ranked) == 1:
        return f"{mean}{_between(errors[first]['ed_mean_low'], errors[first]['ed_mean_high'])}, over {_runs(scores)}."
    second = ranked[1]
    behind = (
        f"'{first}' is first: mean position error (ED) {_metres(errors[first]['ed_mean'])}, '{second}' "
        f"{_metres(errors[second]['ed_mean'])}."
    )
    return " ".join([behind, *_partly(scores, first, second), _certainty(scores, first, second)])


def lead_tiles(scores: Scores, horizon: float) -> list[Tile]:
    """Tiles of the first two models, their difference, windows, and windows without a score; `horizon` [s] is
    predicted."""
    errors, found = scores.figures("ed"), []
    ranked = [model for model in scores.ranked if scores.shares[model][0]]
    for label, model in zip(("First", "Second"), ranked, strict=False):
        mean, low, high = (errors[model][f"ed_mean{end}"] for end in ("", "_low", "_high"))
        found.append(Tile(label, short_name(model), f"mean position error ED {_metres(mean)}{_between(low, high)}"))
    pair = next((p for p in scores.pairs if [p.first, p.second] == ranked[:2]), None)
    if pair is not None and np.isfinite(pair.p_holm) and pair.difference != 0.0:
        sure = "significant" if pair.p_holm < _CERTAIN else "not significant"
        found.append(
            Tile(
                "Difference in ED",
                sure,
                f"{_metres(abs(pair.difference))}{_between(*sorted((-pair.high, -pair.low)))}, {_p(scores, pair)}",
            )
        )
    windows = len(scores.rows[["fold", "run"]].drop_duplicates())
    missing = sum(expected - scored for scored, expected in scores.shares.values())
    return [
        *found, Tile("Windows", str(windows), f"of {horizon:g} s, from {_runs(scores)}"),
        Tile("Models", str(len(scores.models)), "on the same windows"),
        Tile("Not scored", str(missing),
            "predictions; the reasons stand under Status and cost" if missing else "every prediction was scored"),
    ]  # fmt: skip


def _partly(scores: Scores, *models: str) -> list[str]:
    """Sentences on models that cover a part of the windows only."""
    return [
        f"'{model}' covers {scores.shares[model][0]} of {scores.shares[model][1]} windows."
        for model in models
        if model in scores.matched.comparable and model not in scores.matched.complete
    ]


def _certainty(scores: Scores, first: str, second: str) -> str:
    pair = next((p for p in scores.pairs if (p.first, p.second) == (first, second)), None)
    if pair is None:
        return "They are not compared, since one of them lacks a score on some runs."
    if not np.isfinite(pair.p_holm):
        return f"Its significance is unknown with {_runs(scores)}."
    if pair.difference == 0.0:
        return f"They do not differ on {_runs(scores)}."
    sure = "The difference is significant" if pair.p_holm < _CERTAIN else "The difference is not significant"
    size = f"{_metres(abs(pair.difference))}{_between(*sorted((-pair.high, -pair.low)))}, {_p(scores, pair)}"
    if pair.windows == len(scores.matched.codes):
        return f"{sure}: {size}, {_runs(scores)}."
    better = first if pair.difference < 0 else second
    return f"On the {pair.windows} windows of both, '{better}' is better by {size}."


def _p(scores: Scores, pair: Pair) -> str:
    """Text of a pair's p-value; of several pairs it is Holm's, which is more cautious than the interval beside it."""
    value = "p < 0.001" if pair.p_holm < 0.001 else f"p = {pair.p_holm:.3f}"
    pairs = sum(np.isfinite(p.p) for p in scores.pairs)
    return f"{value} (after Holm for {pairs} pairs)" if pairs > 1 else value


def _between(low: float, high: float) -> str:
    return f" (95 %: {number(2)(low)} to {_metres(high)})" if np.isfinite([low, high]).all() else ""


def _metres(value: float) -> str:
    return f"{number(2)(value)} m"


def _runs(scores: Scores) -> str:
    runs = scores.matched.clusters
    return f"{runs} run{'s' * (runs != 1)}"


def short_table(full: Table) -> Table:
    """Table of mean errors alone, without the notes on the other figures."""
    columns = [c for c in full.columns if c.format is None or c.key.endswith("_mean")]
    return replace(
        full,
        title="Errors over the horizon",
        columns=columns,
        notes=[_SHORT, *(n for n in full.notes if not n.startswith(_LONG))],
    )


_LONG = ("ED in", "In italics")
_SHORT = "Mean over runs and folds; below it the 95 % interval, by a bootstrap over runs."
