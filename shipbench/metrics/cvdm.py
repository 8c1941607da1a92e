"""cVDM, the mean relative error of pose and velocities, in percent."""

from __future__ import annotations

import numpy as np

from ..signals import PSI, R, U, V, X, Y
from .base import Column, Metric, state_error

R_MAX = np.pi / 100.0
"""Yaw rate that scales its error [rad/s] (seed paper, eq. 17)."""


def cvdm(*, true: np.ndarray, pred: np.ndarray, s0: np.ndarray) -> np.ndarray:
    """Error 100 (|dx|/Lt + |dy|/Lt + |dpsi|/pi + |du|/Ut + |dv|/Ut + |dr|/r_max) [%], (batch, K); its mean over time
    steps is the cVDM.

    Lt [m] is the length of the true track from s0 through the K time steps, Ut [m/s] the mean resultant speed at the K
    time steps. A run whose true ship does not move (Lt = 0 or Ut = 0) has no scale: its cVDM is NaN, and tables count
    such runs.

    Source: seed paper, eq. (17).
    """
    track = np.concatenate([s0[:, None, :2], true[..., :2]], axis=1)
    Lt = np.hypot(*np.moveaxis(np.diff(track, axis=1), -1, 0)).sum(axis=1)
    Ut = np.hypot(true[..., U], true[..., V]).mean(axis=1)
    moves = (Lt > 0) & (Ut > 0)
    Lt, Ut = (np.where(moves, scale, np.nan)[:, None] for scale in (Lt, Ut))
    error = np.abs(state_error(true, pred))
    position = (error[..., X] + error[..., Y]) / Lt
    velocity = (error[..., U] + error[..., V]) / Ut
    return 100.0 * (position + error[..., PSI] / np.pi + velocity + error[..., R] / R_MAX)


METRIC = Metric(cvdm, (Column("cvdm", "cVDM", "%"),))
