"""Uncertainty by a bootstrap over runs: intervals, paired tests and win rates.

The resampling unit is the run (the cluster): windows of one run are drawn together, since they share a ship, a day and
a manoeuvre. Folds are no unit: five of them can never reach p < 0.0625. The same draws serve every model and every
table, so that differences are paired. Several seeds of a model are averaged within the run: intervals are over runs,
for the seeds that were run; the spread over seeds has its own column.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

RESAMPLES = 4999
LEVEL = 0.95
DRAW_SEED = 0
"""Seed of the resampling alone, fixed so that a page rendered twice is the same page."""
_CELLS = 200_000
"""Number of values in a block of resamples: 1.6 MB."""


class Bootstrap:
    """Resamples of the runs of one data set: `counts` (resamples, runs), the number of draws of each run."""

    def __init__(self, clusters: Sequence[str], resamples: int = RESAMPLES, seed: int = DRAW_SEED) -> None:
        self.names = sorted(set(clusters))
        num = len(self.names)
        self.counts = np.empty((resamples, num))
        rng = np.random.default_rng(seed)
        for rows in _blocks(resamples, num):  # the whole table as integers beside it would double the memory
            self.counts[rows] = rng.multinomial(num, np.full(num, 1.0 / num), size=len(self.counts[rows]))
        self._index = {name: i for i, name in enumerate(self.names)}

    def codes(self, clusters: Sequence[str]) -> np.ndarray:
        """Index of each name in `names`, (n,)."""
        return np.array([self._index[name] for name in clusters], dtype=int)

    def totals(self, codes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Sum of `values` (n, columns) over each run, (runs, columns)."""
        summed = np.zeros((len(self.names), values.shape[1]))
        np.add.at(summed, codes, values)
        return summed

    def means(self, codes: np.ndarray, values: np.ndarray, weights: np.ndarray) -> np.ndarray:
        """Weighted mean of each column in each resample, (resamples, columns); values (n, columns), those not finite
        are left out."""
        known = np.isfinite(values)
        weighted = np.where(known, weights, 0.0)
        with np.errstate(invalid="ignore", divide="ignore"):
            return (self.counts @ self.totals(codes, np.where(known, weighted * values, 0.0))) / (
                self.counts @ self.totals(codes, weighted)
            )

    def spread(self, codes: np.ndarray, values: np.ndarray) -> np.ndarray:
        """Median, standard deviation (n - 1) and interquartile range of `values` (n,) in each resample, (resamples,
        3)."""
        order = np.argsort(values)
        values, codes = values[order], codes[order]
        return np.concatenate(
            [_spread(self.counts[rows, codes], values) for rows in _blocks(len(self.counts), len(values))]
        )

    def p_value(self, differences: np.ndarray, weights: np.ndarray) -> float:
        """Two-sided p-value of no mean difference, by the symmetric bootstrap-t over runs; never below 1 / (resamples +
        1).

        Args:
            differences: (runs,) weighted sums of the differences in each run.
            weights: (runs,) sums of the weights.

        Source: Hall (1992), The Bootstrap and Edgeworth Expansion, section 3.6; the error of the ratio is the
        linearised one.
        """
        num = len(differences)
        if num < 2:
            return float("nan")
        mean = differences.sum() / weights.sum()
        if mean == 0.0:
            return 1.0
        scale, rest = num / (num - 1.0), differences - mean * weights
        error = np.sqrt(scale * np.sum(rest**2)) / weights.sum()
        sums = self.counts @ np.stack([rest, weights, rest**2, rest * weights, weights**2], axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            moved = sums[:, 0] / sums[:, 1]  # the resample's mean less the mean
            errors = (
                np.sqrt(scale * np.maximum(sums[:, 2] - 2 * moved * sums[:, 3] + moved**2 * sums[:, 4], 0.0))
                / sums[:, 1]
            )
            drawn = np.abs(moved) / errors
            seen = abs(mean) / error
        return float((1 + np.sum(drawn >= seen)) / (len(self.counts) + 1))


def _blocks(rows: int, columns: int) -> Iterator[slice]:
    """Slices of a table's rows in blocks that stay in the processor's cache."""
    step = max(8, _CELLS // max(columns, 1) // 8 * 8)
    return (slice(start, min(start + step, rows)) for start in range(0, rows, step))


def _spread(drawn: np.ndarray, ordered: np.ndarray) -> np.ndarray:
    """Spread as in `Bootstrap.spread`, of `ordered` (n,), each drawn as often as `drawn` (resamples, n) states."""
    reached = np.cumsum(drawn, axis=1)
    total = reached[:, -1]
    apart = np.arange(len(total)) * (total.max() + 1.0)  # makes of all rows one ascending list, to be searched at once
    ascending = (reached + apart[:, None]).ravel()

    def at(edge: np.ndarray) -> np.ndarray:
        """Value of that rank in each resample."""
        place = np.searchsorted(ascending, edge + apart, side="right") - np.arange(len(total)) * len(ordered)
        return ordered[np.minimum(place, len(ordered) - 1)]

    def quantile(q: float) -> np.ndarray:
        place = q * np.maximum(total - 1.0, 0.0)
        below, above = at(np.floor(place)), at(np.ceil(place))
        return below + (place - np.floor(place)) * (above - below)

    with np.errstate(invalid="ignore", divide="ignore"):
        centre = drawn @ ordered / total
        variance = (drawn @ ordered**2 - total * centre**2) / (total - 1.0)
    found = np.stack([quantile(0.5), np.sqrt(np.maximum(variance, 0.0)), quantile(0.75) - quantile(0.25)], axis=1)
    found[total < 1] = np.nan
    return found


@cache
def _tail(clusters: int) -> float:
    """Share of the resamples that is cut off at each end."""
    from scipy.special import ndtr, stdtrit  # scipy.stats takes a second to load

    return float(ndtr(-np.sqrt(clusters / (clusters - 1.0)) * stdtrit(clusters - 1, 0.5 + LEVEL / 2)))


def interval(replicates: np.ndarray, clusters: int) -> tuple[float, float]:
    """95 % interval of `replicates` (resamples,) that were drawn from `clusters` runs; NaN for fewer than two runs.

    Percentiles, widened for few runs: the level is that of sqrt(n / (n - 1)) t(n - 1) instead of the normal quantile.

    Source: Hesterberg (2015), What teachers should know about the bootstrap, section 5.2 (expanded percentile
    interval).
    """
    known = replicates[np.isfinite(replicates)]
    if clusters < 2 or not len(known):
        return float("nan"), float("nan")
    tail = _tail(clusters)
    low, high = np.quantile(known, [tail, 1.0 - tail])
    return float(low), float(high)


@dataclass(frozen=True)
class Pair:
    """Two models on the same windows: mean error of `first` less that of `second`, its interval, the number of windows
    in which `first` is better, and the p-value."""

    first: str
    second: str
    difference: float
    low: float
    high: float
    better: int
    windows: int
    p: float
    p_holm: float


@dataclass(frozen=True, eq=False)
class Matched:
    """Errors of every model on the same windows, (windows, models), seeds averaged; NaN where a model has no score.

    `weights` (windows,) make the weighted mean the mean over folds of the fold means. `codes` (windows,) are the runs
    of the windows. `asked` (windows, models) is false where a model does not predict a window by what it is, as
    trajectories from a file that cover other ones; None: all are asked.
    """

    models: list[str]
    errors: np.ndarray
    weights: np.ndarray
    codes: np.ndarray
    boot: Bootstrap
    asked: np.ndarray | None = None

    def of(self, model: str) -> np.ndarray:
        """Errors of one model (windows,)."""
        return self.errors[:, self._places[model]]

    @cached_property
    def _places(self) -> dict[str, int]:
        return {model: i for i, model in enumerate(self.models)}

    @cached_property
    def complete(self) -> list[str]:
        """Models with a score in every window: leaving out the windows where a model fails would favour it."""
        return [m for m in self.models if np.isfinite(self.of(m)).all()]

    @cached_property
    def comparable(self) -> list[str]:
        """Models with a score in every window that they are asked for, one at least."""
        return [m for m in self.models if self._asks(m).any() and np.isfinite(self.of(m)[self._asks(m)]).all()]

    def _asks(self, model: str) -> np.ndarray:
        """Mask of the windows that a model is asked for (windows,)."""
        return np.ones(len(self.codes), bool) if self.asked is None else self.asked[:, self._places[model]]

    def common(self, first: str, second: str) -> Matched | None:
        """Errors on the windows that both models are asked for, or None where there is none."""
        both = self._asks(first) & self._asks(second)
        if both.all() or not both.any():
            return self if both.any() else None
        key = both.tobytes()
        if key not in self._parts:
            names, codes = np.unique(self.codes[both], return_inverse=True)
            boot = Bootstrap([self.boot.names[i] for i in names], len(self.boot.counts))
            self._parts[key] = Matched(self.models, self.errors[both], self.weights[both], codes, boot)
        return self._parts[key]

    @cached_property
    def _parts(self) -> dict[bytes, Matched]:
        return {}

    def means(self, models: Sequence[str]) -> np.ndarray:
        """Mean error of each of `models` in each resample, (resamples, models)."""
        return self.boot.means(self.codes, np.stack([self.of(m) for m in models], axis=1), self.weights[:, None])

    def mean(self, model: str) -> float:
        """Mean error over all windows."""
        return float(np.sum(self.weights * self.of(model)) / np.sum(self.weights))

    @property
    def clusters(self) -> int:
        """Number of runs."""
        return len(np.unique(self.codes))

    def skill(self, model: str, baseline: str) -> tuple[float, float, float]:
        """Skill 1 - error / error of `baseline` with its interval, on the windows that both are asked for; NaN unless
        both are comparable and the baseline has an error."""
        on = self.common(model, baseline)
        if not {model, baseline} <= set(self.comparable) or on is None or not on.mean(baseline) > 0:
            return (float("nan"),) * 3
        drawn = on.means([model, baseline])
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio = drawn[:, 0] / drawn[:, 1]
        return (1.0 - on.mean(model) / on.mean(baseline), *interval(1.0 - ratio, on.clusters))

    def wins(self, model: str, others: Sequence[str]) -> np.ndarray:
        """Share of `others` that `model` beats in each window (windows,); a tie counts half, a window without a score
        is lost. One of the two that is not asked for a window leaves it out; NaN where that leaves no other model."""
        own = np.nan_to_num(self.of(model), nan=np.inf)
        theirs = np.nan_to_num(np.stack([self.of(other) for other in others]), nan=np.inf)
        won = np.where(own < theirs, 1.0, np.where(own == theirs, 0.5, 0.0))
        asked = np.stack([self._asks(other) for other in others]) & self._asks(model)
        count = asked.sum(axis=0)
        return np.where(count > 0, np.where(asked, won, 0.0).sum(axis=0) / np.maximum(count, 1), np.nan)

    def win_rate(self, model: str, others: Sequence[str]) -> tuple[float, float, float]:
        """Mean of `wins` with its interval."""
        won = self.wins(model, others)
        known = np.isfinite(won)
        if not known.any():
            return (float("nan"),) * 3
        drawn = self.boot.means(self.codes, won[:, None], self.weights[:, None])[:, 0]
        mean = float(np.average(won[known], weights=self.weights[known]))
        return mean, *interval(drawn, len(np.unique(self.codes[known])))

    def pairs(self, models: Sequence[str]) -> list[Pair]:
        """Comparisons of every two of `models` that are comparable, in the order given, on the windows that both are
        asked for; p adjusted over all of them after Holm (1979)."""
        from statsmodels.stats.multitest import multipletests

        names = [m for m in models if m in self.comparable]
        both = ((a, b) for i, a in enumerate(names) for b in names[i + 1 :])
        found = [on._pair(a, b) for a, b in both if (on := self.common(a, b)) is not None]
        known = [i for i, pair in enumerate(found) if np.isfinite(pair.p)]
        if not known:
            return found
        adjusted = multipletests([found[i].p for i in known], method="holm")[1]
        for i, p in zip(known, adjusted, strict=True):
            found[i] = Pair(**{**vars(found[i]), "p_holm": float(p)})
        return found

    def _pair(self, first: str, second: str) -> Pair:
        difference = self.of(first) - self.of(second)
        both = self.boot.totals(self.codes, np.stack([self.weights * difference, self.weights], axis=1))
        p = self.boot.p_value(both[:, 0], both[:, 1])
        drawn = self.boot.means(self.codes, difference[:, None], self.weights[:, None])[:, 0]
        mean = float(np.average(difference, weights=self.weights))
        low, high = interval(drawn, self.clusters)
        return Pair(first, second, mean, low, high, int(np.sum(difference < 0)), len(difference), p, float("nan"))
