"""Root mean square of the position error over the run."""

from __future__ import annotations

import numpy as np

from .base import Column, Metric
from .ed import ed


def position_rmse(*, true: np.ndarray, pred: np.ndarray) -> np.ndarray:
    """Root mean square sqrt(mean_k(dx^2 + dy^2)) [m], (batch,)."""
    return np.sqrt(np.mean(ed(true=true, pred=pred) ** 2, axis=1))


METRIC = Metric(position_rmse, (Column("position_rmse", "position RMSE", "m"),), per_knot=False)
