"""Scores of one data set for all tables of its leaderboard: statistics with intervals, ranking, matched errors."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InputError, unknown_name
from ..storage import Frame
from .statistics import Bootstrap, Matched, Pair, interval

STATISTICS = ("mean", "median", "std", "iqr")
CEILING = "oracle"
FLOOR = "hold"
"""Baseline of the skill where none is given."""


def cluster_of(rows: Frame) -> Frame:
    """Unit of resampling of each row: the group of runs where rows state it, else the run that the window was cut
    from."""
    if "group" not in rows:
        return rows["parent"]
    known = rows.groupby(["fold", "run"])["group"].transform("first")  # of the same window in rows that tell it
    return known.fillna(rows["parent"])


@dataclass(frozen=True, eq=False)
class Scores:
    """Rows of one data set.

    `columns`: the numeric columns by name. `windows`: motion of the true ship (or None). `asked_baseline`: model that
    skill is relative to, where one was given. `beside_paper`: the source paper's figures are of such a task.
    """

    dataset: str
    rows: Frame
    columns: dict[str, dict[str, str]]
    windows: Frame | None = None
    asked_baseline: str | None = None
    beside_paper: bool = False

    @cached_property
    def boot(self) -> Bootstrap:
        """Resamples of runs, the same for every table."""
        return Bootstrap(self.rows["cluster"].tolist())

    @cached_property
    def scored(self) -> Frame:
        """Rows with a score."""
        return self.rows[self.rows["status"] == "ok"]

    @cached_property
    def shares(self) -> dict[str, tuple[int, int]]:
        """Scored and expected rows by model: every window that any model was given, times the model's seeds."""
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
        """Models that have a rank: all but the oracle."""
        return [m for m in self.models if m != CEILING]

    @property
    def baseline(self) -> str | None:
        """Model that skill is relative to, or None where the default one is not there.

        Raises:
            InputError: the one that was asked for is not among the models.
        """
        if self.asked_baseline is None:
            return FLOOR if FLOOR in self.models else None
        if self.asked_baseline not in self.models:
            text = unknown_name("model", self.asked_baseline, self.models)
            raise InputError(f"--baseline: data set '{self.dataset}' has no rows of it: {text}")
        return self.asked_baseline

    @cached_property
    def _cells(self) -> dict[str, tuple[Frame, np.ndarray, np.ndarray]]:
        """Scored rows of each model, their runs as places in `boot`, and the number of their cell (fold and seed)."""
        found = {}
        for model in self.shares:
            part = self.scored[self.scored["model"] == model]
            codes = self.boot.codes(part["cluster"].tolist())
            found[model] = part, codes, part.groupby(["fold", "seed"]).ngroup().to_numpy()
        return found

    def _values(self, column: str, model: str) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
        """Values of a model that are numbers (n,), their runs (n,), and the places of each cell among them."""
        part, codes, cells = self._cells[model]
        values = part[column].to_numpy(float)
        known = np.isfinite(values)
        values, codes, cells = values[known], codes[known], cells[known]
        return values, codes, [np.flatnonzero(cells == cell) for cell in np.unique(cells)]

    def means(self, column: str) -> dict[str, dict[str, float]]:
        """Statistics by model over the runs of a fold, then their mean over folds and seeds (sigma: n - 1; IQR: linear
        quantiles)."""
        return {model: self._means(*self._values(column, model)) for model in self.shares}

    @staticmethod
    def _means(values: np.ndarray, codes: np.ndarray, places: list[np.ndarray]) -> dict[str, float]:
        if not places:
            return {}
        groups = [values[at] for at in places]
        quartiles = np.array([np.quantile(g, [0.25, 0.5, 0.75]) for g in groups])
        spreads = [np.std(g, ddof=1) for g in groups if len(g) > 1]  # one run alone has none
        return {
            "mean": float(np.mean([g.mean() for g in groups])), "median": float(np.mean(quartiles[:, 1])),
            "std": float(np.mean(spreads)) if spreads else float("nan"),
            "iqr": float(np.mean(quartiles[:, 2] - quartiles[:, 0])),
        }  # fmt: skip

    def figures(
        self, column: str, statistics: tuple[str, ...] = ("mean",), factor: float = 1.0
    ) -> dict[str, dict[str, float]]:
        """Table values by model: `column_statistic`, `.._low` and `.._high` with the 95 % interval over runs."""
        found: dict[str, dict[str, float]] = {}
        for model in self.shares:
            values, codes, places = self._values(column, model)
            means = self._means(values, codes, places)
            drawn = (
                self._replicates(values, codes, places, statistics) if places else np.full((1, len(statistics)), np.nan)
            )
            runs = len(np.unique(codes))
            line: dict[str, float] = {}
            for i, name in enumerate(statistics):
                low, high = interval(drawn[:, i], runs)
                key = f"{column}_{name}"
                line |= {
                    key: factor * means.get(name, float("nan")),
                    f"{key}_low": factor * low,
                    f"{key}_high": factor * high,
                }
            found[model] = line
        return found

    def _replicates(
        self, values: np.ndarray, codes: np.ndarray, places: list[np.ndarray], statistics: tuple[str, ...]
    ) -> np.ndarray:
        """Replicates (resamples, statistics) of one model's values, with the weights of the means over folds and
        seeds."""
        weights = np.empty(len(values))
        for at in places:
            weights[at] = 1.0 / len(at)
        drawn = [self.boot.means(codes, values[:, None], weights[:, None])[:, 0]]
        if len(statistics) > 1:
            spreads = np.stack([self.boot.spread(codes[at], values[at]) for at in places])
            known = np.isfinite(spreads)
            with np.errstate(invalid="ignore"):
                drawn += list(
                    (np.where(known, spreads, 0.0).sum(axis=0) / known.sum(axis=0)).T
                )  # folds without a drawn run are left out
        return np.stack(drawn, axis=1)

    @cached_property
    def matched(self) -> Matched:
        """ED of every model on the same windows, averaged over its seeds."""
        keys = self.rows[["fold", "run", "cluster"]].drop_duplicates(["fold", "run"]).sort_values(["fold", "run"])
        errors = np.full((len(keys), len(self.models)), np.nan)
        asked = np.ones(errors.shape, bool)
        windows = list(zip(keys["fold"], keys["run"], strict=True))
        for j, model in enumerate(self.models):
            part = self.rows[self.rows["model"] == model]
            by_window = part.assign(ed=part["ed"].where(part["status"] == "ok")).groupby(["fold", "run"])["ed"]
            mean = by_window.mean().where(
                by_window.count() == part["seed"].nunique()
            )  # a window that one seed lost is lost
            errors[:, j] = mean.reindex(windows).to_numpy(float)
            skipped = part.assign(skipped=part["status"] == "skipped").groupby(["fold", "run"])["skipped"].all()
            asked[:, j] = ~skipped.reindex(windows).fillna(False).to_numpy(bool)
        weights = 1.0 / keys.groupby("fold")["run"].transform("size").to_numpy(float)
        return Matched(self.models, errors, weights, self.boot.codes(keys["cluster"].tolist()), self.boot, asked)

    @cached_property
    def pairs(self) -> list[Pair]:
        """Comparisons of every two ranked models that are comparable, on the same windows."""
        return self.matched.pairs(self.ranked)

    def values(self, column: str, model: str) -> dict[str, Any]:
        """Mean of `column` for each seed of a model, with the weights of the ranking."""
        part = self.scored[self.scored["model"] == model]
        return dict(part.groupby(["seed", "fold"])[column].mean().groupby("seed").mean())
