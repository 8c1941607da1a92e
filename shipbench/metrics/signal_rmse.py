"""Root mean square error of every other signal, each in its own unit: errors of different units are never averaged."""

from __future__ import annotations

import numpy as np

from ..signals import STATES, UNITS
from .base import Column, Metric, state_error

SIGNALS = ("psi", "u", "v", "r", "n", "delta", "F_b", "F_s")


def signal_rmse(*, true: np.ndarray, pred: np.ndarray) -> np.ndarray:
    """Root mean square sqrt(mean_k(error^2)) of each of `SIGNALS` (batch, 8), in the units of `signals.UNITS`; the
    heading's difference is wrapped."""
    error = state_error(true, pred)[..., [STATES.index(s) for s in SIGNALS]]
    return np.sqrt(np.mean(error**2, axis=1))


METRIC = Metric(signal_rmse, tuple(Column(f"rmse_{s}", f"RMSE {s}", UNITS[s]) for s in SIGNALS), per_knot=False)
