"""Distance between the true and the predicted position at the end of the horizon."""

from __future__ import annotations

import numpy as np

from .base import Column, Metric
from .ed import ed


def final_displacement(*, true: np.ndarray, pred: np.ndarray) -> np.ndarray:
    """Distance ED at the last time step [m], (batch,)."""
    return ed(true=true, pred=pred)[:, -1]


METRIC = Metric(final_displacement, (Column("final_displacement", "final displacement", "m"),), per_knot=False)
