"""Confidence intervals of least squares over whole rollouts."""

from __future__ import annotations

import numpy as np


def intervals(q: np.ndarray, e: np.ndarray, J: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """95 % intervals (num, 2) of the scaled parameters: sandwich covariance clustered over runs, Student's t; NaN at a
    bound."""
    from scipy.special import stdtrit  # Student's t; scipy.stats would take a second to import

    free = (q > low + 1e-6) & (q < high - 1e-6)
    interval = np.full((len(q), 2), np.nan)
    runs = len(e)
    if runs < 2 or not free.any():
        return interval
    bread = np.linalg.pinv(np.einsum("bksp,bksq->pq", J, J)[np.ix_(free, free)])
    scores = np.einsum("bksp,bks->bp", J, e)[:, free]
    with np.errstate(invalid="ignore"):  # a variance that rounds below zero has no interval
        spread = np.sqrt(np.diag(bread @ (scores.T @ scores * runs / (runs - 1)) @ bread))
    half = float(stdtrit(runs - 1, 0.975)) * spread
    interval[free] = np.stack([q[free] - half, q[free] + half], axis=1)
    return interval
