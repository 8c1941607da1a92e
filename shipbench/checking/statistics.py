"""Least squares with standard errors for dependent samples within a run, and robust scales of noise."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .thresholds import THRESHOLDS


@dataclass(frozen=True)
class Fit:
    """Coefficients value and their standard errors sd (P,); p (P,): two-sided p-values; squares: residual sum; rows:
    number of equations."""

    value: np.ndarray
    sd: np.ndarray
    p: np.ndarray
    squares: float
    rows: int


def clustered_fit(y: np.ndarray, X: np.ndarray, cluster: np.ndarray) -> Fit:
    """Regress y (T,) on X (T, P); rows of one `cluster` (T,) may depend on one another.

    Sandwich covariance (Liang and Zeger 1986) with the small-sample factor G/(G-1), t distribution with G-1 degrees of
    freedom.
    """
    from scipy.stats import t as student

    inverse = np.linalg.pinv(X.T @ X, hermitian=True)
    value = inverse @ (X.T @ y)
    left = y - X @ value
    _, index = np.unique(cluster, return_inverse=True)
    count = int(index.max()) + 1
    scores = np.zeros((count, X.shape[1]))
    np.add.at(scores, index, X * left[:, None])
    middle = scores.T @ scores * count / max(count - 1, 1)
    sd = np.sqrt(np.maximum(np.diag(inverse @ middle @ inverse), 1e-300))
    return Fit(value, sd, 2.0 * student.sf(np.abs(value) / sd, max(count - 1, 1)), float(left @ left), len(y))


def clusters(run: np.ndarray) -> np.ndarray:
    """Cluster of each row: its run, or a stretch of its run where there are fewer runs than `windows`. run (T,): index
    of the run, ascending."""
    found, fewest = np.unique(run), THRESHOLDS.count("windows")
    if len(found) >= fewest:
        return run
    pieces = -(-fewest // max(len(found), 1))
    cluster = np.zeros(len(run), dtype=int)
    for number, r in enumerate(found):
        rows = np.flatnonzero(run == r)
        cluster[rows] = number * pieces + (np.arange(len(rows)) * pieces) // max(len(rows), 1)
    return cluster


def spread(values: np.ndarray) -> float:
    """Standard deviation of the bulk (1.4826 times the median absolute deviation)."""
    return float(1.4826 * np.median(np.abs(values - np.median(values)))) if len(values) else 0.0


def stretches(flags: np.ndarray) -> list[tuple[int, int]]:
    """Intervals (start, stop) of every unbroken stretch of True, stop excluded."""
    edges = np.diff(np.concatenate([[0], flags.astype(int), [0]]))
    return list(zip(np.flatnonzero(edges == 1).tolist(), np.flatnonzero(edges == -1).tolist(), strict=True))


def inliers(residual: np.ndarray, groups: int = 1) -> np.ndarray:
    """Mask of rows (T,) whose residual lies within `limit` robust standard deviations; with `groups` of 2, equations (2
    T/2) of one window go together."""
    size = np.sqrt(np.sum(residual.reshape(groups, -1) ** 2, axis=0))
    typical = float(np.median(size))
    return np.tile(size <= THRESHOLDS.value("beyond_noise") * max(typical, 1e-12), groups)


def times(number: int, runs: int) -> str:
    """Text such as "once in one run", "3 times in 2 runs"."""
    return f"{'once' if number == 1 else f'{number} times'} in {'one run' if runs == 1 else f'{runs} runs'}"


def some(names: Sequence[str], most: int = 4) -> str:
    """Text of a list of names cut short: "a, b, c and 5 more"."""
    names = list(names)
    return ", ".join(names) if len(names) <= most else f"{', '.join(names[:most])} and {len(names) - most} more"
