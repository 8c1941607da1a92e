"""ED, the distance between the true and the predicted position."""

from __future__ import annotations

import numpy as np

from ..signals import X, Y
from .base import Column, Metric


def ed(*, true: np.ndarray, pred: np.ndarray) -> np.ndarray:
    """Distance sqrt(dx^2 + dy^2) [m], (batch, K). Source: seed paper, eq. (15)."""
    return np.hypot(pred[..., X] - true[..., X], pred[..., Y] - true[..., Y])


METRIC = Metric(ed, (Column("ed", "ED", "m"),))
