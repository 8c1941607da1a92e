"""Absolute difference of heading, mean over the run."""

from __future__ import annotations

import numpy as np

from ..signals import PSI, wrap_angle
from .base import Column, Metric


def heading_error(*, true: np.ndarray, pred: np.ndarray) -> np.ndarray:
    """Heading error |dpsi| [rad], wrapped to [0, pi], (batch, K)."""
    return np.abs(wrap_angle(pred[..., PSI] - true[..., PSI]))


METRIC = Metric(heading_error, (Column("heading_error", "heading error", "rad"),))
