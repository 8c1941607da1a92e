"""Forward selection among explanations of the data: groups of columns by likelihood and clustered t."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .statistics import Fit, clustered_fit, clusters, inliers
from .thresholds import THRESHOLDS


@dataclass(frozen=True)
class Chosen:
    """Explanations in the order of choice, coefficients and standard errors of each, and the share of the squares that
    models leave.

    left: "plain", every explanation alone, and "all chosen" -> root of residual squares over root of the squares of
    `whole`. held: explanation -> residual squares of all chosen ones in held-out runs, over those of the others without
    it. out: residual mean square of all in held-out runs.
    """

    names: tuple[str, ...]
    value: dict[str, np.ndarray]
    sd: dict[str, np.ndarray]
    left: dict[str, float]
    rows: int
    held: dict[str, float]
    out: float


def select(
    y: np.ndarray, groups: Mapping[str, np.ndarray], nuisance: np.ndarray, run: np.ndarray, parts: int, whole: float,
    exclusive: Sequence[frozenset[str]] = (),
) -> Chosen:  # fmt: skip
    """Choose among `groups` (name -> columns (T, k)) beside the always present `nuisance` (T, q).

    Args:
        y: (T,) equations, `parts` blocks of the same windows one after another.
        run: (T / parts,) index of the run of each window.
        whole: root mean square that `left` is given in.
        exclusive: sets of groups of which one at most is chosen.
    """
    keep = _trimmed(y, np.column_stack([nuisance, *(g for g in groups.values() if g.shape[1] <= 2)]), parts)
    cluster = np.tile(clusters(run), parts)[keep]
    y, nuisance, groups = y[keep], nuisance[keep], {name: g[keep] for name, g in groups.items()}

    def fit(names: Sequence[str]) -> Fit:
        return clustered_fit(y, np.column_stack([nuisance, *(groups[n] for n in names)]), cluster)

    def share(squares: float) -> float:
        return float(np.sqrt(squares / len(y))) / whole

    def held_out(names: Sequence[str]) -> float:
        """Residual squares in every other cluster of a fit to those between, and the other way round."""
        X = np.column_stack([nuisance, *(groups[n] for n in names)])
        odd = np.unique(cluster, return_inverse=True)[1] % 2 == 1
        return sum(
            float(np.sum((y[~a] - X[~a] @ np.linalg.lstsq(X[a], y[a], rcond=None)[0]) ** 2)) for a in (odd, ~odd)
        )

    least = THRESHOLDS.value("explanation_gain")

    def significant(name: str, fitted: Fit) -> bool:
        """Whether one or two columns differ significantly from zero; more columns are judged by their gain alone."""
        width = groups[name].shape[1]
        return width > 2 or bool(fitted.p[-width:].min() < THRESHOLDS.value("chance"))

    now = fit(())
    names: list[str] = []
    left = {"plain": share(now.squares)} | {name: share(fit((name,)).squares) for name in groups}
    while True:
        barred = {other for s in exclusive if s & set(names) for other in s}
        tried = {name: fit((*names, name)) for name in groups if name not in names and name not in barred}
        gains = {name: _gain(now, f, groups[name].shape[1]) for name, f in tried.items()}
        sure = {name: gain for name, gain in gains.items() if gain > least and significant(name, tried[name])}
        if not sure:
            break
        best = max(sure, key=lambda n: sure[n])
        names.append(best)
        now = tried[best]
    value, sd, at = {}, {}, nuisance.shape[1]
    for name in names:
        width = groups[name].shape[1]
        value[name], sd[name] = now.value[at : at + width], now.sd[at : at + width]
        at += width
    held = {out: held_out([n for n in names if n != out]) for out in names}
    every = held_out(names)
    return Chosen(
        tuple(names), value, sd, left | {"all chosen": share(now.squares)}, len(y),
        {n: every / max(without, 1e-300) for n, without in held.items()},
        every / len(y),
    )  # fmt: skip


def _gain(old: Fit, new: Fit, more: int) -> float:
    return new.rows * float(np.log(max(old.squares, 1e-300) / max(new.squares, 1e-300))) - more * float(
        np.log(new.rows)
    )


def _trimmed(y: np.ndarray, X: np.ndarray, parts: int) -> np.ndarray:
    """Rows within the bulk of the richest model's residuals: other checks find jumps and spikes, which must not decide
    here."""
    keep = np.ones(len(y), dtype=bool)
    for _ in range(4):
        value, *_ = np.linalg.lstsq(X[keep], y[keep], rcond=None)
        keep = inliers(y - X @ value, parts)
    return keep
