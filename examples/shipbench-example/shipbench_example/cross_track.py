"""Distance of the predicted position from the true one, across the true heading: what matters in a narrow channel."""

from __future__ import annotations

import numpy as np

from shipbench.metrics.base import Column, Metric


def cross_track(*, true: np.ndarray, pred: np.ndarray) -> np.ndarray:
    """|(p - p_true) x heading| [m], (batch, K); true and pred are states (batch, K, 10). Arguments are keyword-only;
    take what you need."""
    north, east, psi = pred[..., 0] - true[..., 0], pred[..., 1] - true[..., 1], true[..., 2]
    return np.abs(east * np.cos(psi) - north * np.sin(psi))


# one value per knot; a run's figure is the mean over the knots
METRIC = Metric(cross_track, (Column("cross_track", "cross-track error", "m"),))
