"""The scores of one data set as all tables of its leaderboard use them: statistics with intervals, ranking, matched errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InputError, unknown_name
from .results import Frame
from .statistics import Bootstrap, Matched, interval

STATISTICS = ("mean", "median", "std", "iqr")
CEILING = "oracle"
FLOOR = "hold"
"""The baseline of the skill where none is named."""


def cluster_of(rows: Frame) -> Frame:
    """The unit of resampling of each row: the group of runs where rows tell it, else the run that the window was cut from."""
    if "group" not in rows:
        return rows["parent"]
    known = rows.groupby(["fold", "run"])["group"].transform("first")  # of the same window in rows that tell it
    return known.fillna(rows["parent"])


@dataclass(frozen=True, eq=False)
class Scores:
    """Rows of one data set; `columns` are the numeric columns by name; `windows` tells what the true ship does (or None); `asked_baseline`:
    the model that skill is counted from, where one was named; `beside_paper`: the source paper's figures are of such a task."""

    dataset: str
    rows: Frame
    columns: dict[str, dict[str, str]]
    windows: Frame | None = None
    asked_baseline: str | None = None
    beside_paper: bool = False

    @cached_property
    def boot(self) -> Bootstrap:
        """Draws of runs, the same for every table."""
        return Bootstrap(self.rows["cluster"].tolist())

    @cached_property
    def scored(self) -> Frame:
        """Rows with a score."""
        return self.rows[self.rows["status"] == "ok"]

    @cached_property
    def shares(self) -> dict[str, tuple[int, int]]:
        """Model -> (scored rows, expected rows): every window that any model was given, times the model's seeds."""
        windows = len(self.rows[["fold", "run"]].drop_duplicates())
        return {
            str(model): (int((part["status"] == "ok").sum()), max(len(part), windows * part["seed"].nunique()))
            for model, part in self.rows.groupby("model", sort=False)
        }

    @cached_property
    def models(self) -> list[str]:
        """Models by mean ED; those with a run that is not scored come after all that have none."""
        means = self.means("ed")

        def order(model: str) -> tuple[bool, bool, float, str]:
            scored, expected = self.shares[model]
            return scored == 0, scored < expected, means[model]["mean"] if scored else 0.0, model

        return sorted(self.shares, key=order)

    @property
    def ranked(self) -> list[str]:
        """Models that have a rank: all but the ceiling."""
        return [m for m in self.models if m != CEILING]

    @property
    def baseline(self) -> str | None:
        """The model that skill is counted from, or None where the default one is not there.

        Raises:
            InputError: the one that was asked for is not among the models.
        """
        if self.asked_baseline is None:
            return FLOOR if FLOOR in self.models else None
        if self.asked_baseline not in self.models:
            text = unknown_name("model", self.asked_baseline, self.models)
            raise InputError(f"--baseline: data set '{self.dataset}' has no rows of it: {text}")
        return self.asked_baseline

    def means(self, column: str) -> dict[str, dict[str, float]]:
        """By model the statistics over the runs of a fold, then their mean over folds and seeds (sigma: n - 1; IQR: linear quantiles)."""
        if self.scored.empty:
            return {m: {} for m in self.shares}
        grouped = self.scored.groupby(["model", "fold", "seed"])[column]
        quartiles = grouped.quantile([0.25, 0.75]).unstack()
        statistics = grouped.agg(["mean", "median", "std"])
        statistics["iqr"] = quartiles[0.75] - quartiles[0.25]
        found = statistics.groupby("model").mean()
        return {m: dict(found.loc[m]) if m in found.index else {} for m in self.shares}

    def figures(self, column: str, statistics: tuple[str, ...] = ("mean",), factor: float = 1.0) -> dict[str, dict[str, float]]:
        """By model `column_statistic`, `.._low` and `.._high` with the 95 % interval over runs, for tables."""
        means = self.means(column)
        found: dict[str, dict[str, float]] = {}
        for model in self.shares:
            part = self.scored[(self.scored["model"] == model) & self.scored[column].notna()]
            drawn = self._replicates(part, column, statistics) if len(part) else np.full((1, len(statistics)), np.nan)
            runs = part["cluster"].nunique()
            line: dict[str, float] = {}
            for i, name in enumerate(statistics):
                low, high = interval(drawn[:, i], runs)
                key = f"{column}_{name}"
                line |= {key: factor * means[model].get(name, float("nan")), f"{key}_low": factor * low, f"{key}_high": factor * high}
            found[model] = line
        return found

    def _replicates(self, part: Frame, column: str, statistics: tuple[str, ...]) -> np.ndarray:
        """(resamples, statistics) of one model's rows, with the weights of the means over folds and seeds."""
        cells = part.groupby(["fold", "seed"])[column]
        values, codes = part[column].to_numpy(float), self.boot.codes(part["cluster"].tolist())
        weights = 1.0 / cells.transform("size").to_numpy(float)
        drawn = [self.boot.means(codes, values[:, None], weights[:, None])[:, 0]]
        if len(statistics) > 1:
            places = cells.indices.values()
            spreads = np.stack([self.boot.spread(codes[at], values[at]) for at in places])
            known = np.isfinite(spreads)
            with np.errstate(invalid="ignore"):
                drawn += list((np.where(known, spreads, 0.0).sum(axis=0) / known.sum(axis=0)).T)  # folds without a drawn run are left out
        return np.stack(drawn, axis=1)

    @cached_property
    def matched(self) -> Matched:
        """ED of every model on the same windows, averaged over its seeds."""
        keys = self.rows[["fold", "run", "cluster"]].drop_duplicates(["fold", "run"]).sort_values(["fold", "run"])
        errors = np.full((len(keys), len(self.models)), np.nan)
        for j, model in enumerate(self.models):
            part = self.rows[self.rows["model"] == model]
            by_window = part.assign(ed=part["ed"].where(part["status"] == "ok")).groupby(["fold", "run"])["ed"]
            mean = by_window.mean().where(by_window.count() == part["seed"].nunique())  # a window that one seed lost is lost
            errors[:, j] = mean.reindex(list(zip(keys["fold"], keys["run"], strict=True))).to_numpy(float)
        weights = 1.0 / keys.groupby("fold")["run"].transform("size").to_numpy(float)
        return Matched(self.models, errors, weights, self.boot.codes(keys["cluster"].tolist()), self.boot)

    def values(self, column: str, model: str) -> dict[str, Any]:
        """Mean of `column` of each seed of a model, as the ranking counts it."""
        part = self.scored[self.scored["model"] == model]
        return dict(part.groupby(["seed", "fold"])[column].mean().groupby("seed").mean())
