"""Time constants and rate limits of the actuators from commands and recorded positions."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import least_squares

from ..physics.actuators import lag_with_rate_limit
from ..records import Batch
from ..signals import DELTA, F_B, F_S, N

if TYPE_CHECKING:
    from ..compiled import Rollout

DEFAULT_ACTUATORS = np.array([6.0, 10.0, 1.0, np.deg2rad(2.5), 2.0, 3e4])
"""T_n [s], rate_n [rpm/s], T_delta [s], rate_delta [rad/s], T_F [s], rate_F [N/s]: used for an actuator that never
moves in the data."""

_NO_LIMIT = 1e3
"""Factor of the mean command step per second above which a rate limit counts as none."""


def fit_actuators(batch: Batch, dt: float) -> np.ndarray:
    """Fit (T, rate) of shaft, rudder and thrusters over whole rollouts from s0.

    Returns:
        (6,) in the order of `DEFAULT_ACTUATORS`. A limit that the data never reach is reported as large, not as found.
    """
    groups = (((N, 0),), ((DELTA, 1),), ((F_B, 2), (F_S, 3)))
    found = DEFAULT_ACTUATORS.copy()
    for g, channels in enumerate(groups):
        s0 = np.concatenate([batch.s0[:, s] for s, _ in channels])
        command = np.concatenate([batch.U[:, :, c] for _, c in channels])
        truth = np.concatenate([batch.truth[:, :, s] for s, _ in channels])
        scale = float(np.std(truth))
        if scale < 1e-9 * (1.0 + float(np.max(np.abs(command)))):
            continue
        found[2 * g : 2 * g + 2] = _fit_one(s0, command, truth, scale, dt)
    return found


@cache
def _rollout() -> Rollout:
    """Actuators (runs, K, 1) that follow held commands; p = (T, rate, dt)."""
    import casadi as ca

    from ..compiled import Rollout

    x, w, p = ca.SX.sym("x"), ca.SX.sym("w"), ca.SX.sym("p", 3)
    return Rollout(ca.Function("step", [x, w, p], [lag_with_rate_limit(x, w, p[2], p[0], p[1])], {"cse": True}))


def _fit_one(s0: np.ndarray, command: np.ndarray, truth: np.ndarray, scale: float, dt: float) -> np.ndarray:
    def residual(log_params: np.ndarray) -> np.ndarray:
        predicted = _rollout()(s0[:, None], command[:, :, None], np.array([*np.exp(log_params), dt]))[:, :, 0]
        return ((predicted - truth) / scale).ravel()

    low, high = np.log([0.02 * dt, 1e-3 * scale / dt]), np.log([100.0 * dt, _NO_LIMIT * scale / dt])
    fits = []
    for T0, rate0 in ((2.0 * dt, 0.3 * scale / dt), (5.0 * dt, 10.0 * scale / dt), (0.5 * dt, 0.1 * scale / dt)):
        fits.append(least_squares(residual, np.log([T0, rate0]), bounds=(low, high), x_scale=1.0, max_nfev=40))
    return np.exp(min(fits, key=lambda f: f.cost).x)
