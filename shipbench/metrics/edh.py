"""EDH, the distance plus the displacement of the ship's ends by the heading error."""

from __future__ import annotations

import numpy as np

from ..signals import PSI, wrap_angle
from .base import Column, Metric
from .ed import ed


def edh(*, true: np.ndarray, pred: np.ndarray, L: float) -> np.ndarray:
    """ED + L/2 |dpsi| [m], (batch, K), with dpsi [rad] wrapped to (-pi, pi]. Source: seed paper, eq. (16)."""
    return ed(true=true, pred=pred) + 0.5 * L * np.abs(wrap_angle(pred[..., PSI] - true[..., PSI]))


METRIC = Metric(edh, (Column("edh", "EDH", "m"),))
