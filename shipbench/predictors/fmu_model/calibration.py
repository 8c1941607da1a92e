"""Calibration of an FMU's open parameters: least squares of whole rollouts within bounds, in worker processes.

All columns of a Jacobian are simulated at once, so that no process waits. It begins with short windows, which have one
minimum where long ones may have several, and ends with the runs as they are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...signals import MOTION, PSI, wrap_angle

_STEP = 1e-4
"""Step of the finite differences, relative to the range between the bounds."""
_SHORT = 4
"""Share of a run in the first windows, 1/4."""
_LEAST_SAMPLES = 10
"""Least samples of a short window."""
_LOST = 10.0
"""Residual of a run that failed, in typical sizes of the motion."""
_TOLERANCE = 1e-7
_ROUGH = 5e-2
"""Tolerance on short windows, which only give a start."""
_MOST_EVALUATIONS = 40


@dataclass(frozen=True, eq=False)
class Rollouts:
    """Windows of equal length: start states s0 (runs, 10), inputs U (runs, K, inputs), truth (runs, K, 10)."""

    s0: np.ndarray
    U: np.ndarray
    truth: np.ndarray

    def shortened(self) -> Rollouts | None:
        """The same samples in shorter windows, or None where they would be too short."""
        K = self.U.shape[1]
        short = K // _SHORT
        if short < _LEAST_SAMPLES:
            return None
        starts = range(0, short * _SHORT, short)
        s0 = [self.s0 if k == 0 else self.truth[:, k - 1] for k in starts]
        U, truth = ([a[:, k : k + short] for k in starts] for a in (self.U, self.truth))
        return Rollouts(np.concatenate(s0), np.concatenate(U), np.concatenate(truth))


@dataclass(frozen=True, eq=False)
class Calibrated:
    """Result: values, their standard deviations (from the scatter between runs; NaN where a parameter does not act),
    the count of simulated runs, and the residual before and after, in typical sizes of the motion."""

    values: np.ndarray
    deviations: np.ndarray
    simulated: int
    before: float
    after: float


Simulate = Callable[[Rollouts, np.ndarray], np.ndarray]
"""Function (windows, values (columns, parameters)) -> states (columns, runs, K, 10), NaN where a run failed."""


def calibrate(
    simulate: Simulate, windows: Rollouts, start: np.ndarray, low: np.ndarray, high: np.ndarray
) -> Calibrated:
    """Calibrate parameters from `start` within `low` and `high` (parameters,)."""
    from scipy.optimize import least_squares

    z = np.clip((start - low) / (high - low), 1e-3, 1.0 - 1e-3)
    whole = _Problem(simulate, windows, low, high)
    before, short = whole.size(z), windows.shortened()
    stages = [whole] if short is None else [_Problem(simulate, short, low, high), whole]
    for problem in stages:
        tolerance = _TOLERANCE if problem is whole else _ROUGH
        found = least_squares(
            problem.residuals, z, problem.jacobian, bounds=(0.0, 1.0), method="trf",
            xtol=tolerance, ftol=tolerance, gtol=1e-10, max_nfev=_MOST_EVALUATIONS,
        )  # fmt: skip
        z = found.x
    spread = _deviations(found.jac, found.fun, len(windows.s0)) * (high - low)
    count = sum(problem.simulated for problem in stages)
    return Calibrated(low + z * (high - low), spread, count, before, float(np.sqrt(np.mean(found.fun**2))))


class _Problem:
    """Residuals and their Jacobian of one stage, in parameters from 0 (low) to 1 (high)."""

    def __init__(self, simulate: Simulate, windows: Rollouts, low: np.ndarray, high: np.ndarray) -> None:
        self.simulate, self.windows, self.low, self.high = simulate, windows, low, high
        self.simulated = 0
        self._last: tuple[np.ndarray, np.ndarray] | None = None
        self.scale = typical_sizes(windows.s0, windows.truth)

    def residuals(self, z: np.ndarray) -> np.ndarray:
        """Residuals of all windows, flat."""
        self._last = z.copy(), self._many(z[None])[0]
        return self._last[1]

    def size(self, z: np.ndarray) -> float:
        """Root mean square of the residuals."""
        return float(np.sqrt(np.mean(self.residuals(z) ** 2)))

    def jacobian(self, z: np.ndarray) -> np.ndarray:
        """Jacobian by finite differences that stay within the bounds."""
        steps = np.where(z + _STEP <= 1.0, _STEP, -_STEP)
        here = self._last[1] if self._last is not None and (self._last[0] == z).all() else self.residuals(z)
        return (self._many(z + np.diag(steps)) - here).T / steps

    def _many(self, z: np.ndarray) -> np.ndarray:
        S = self.simulate(self.windows, self.low + z * (self.high - self.low))
        self.simulated += S.shape[0] * S.shape[1]
        error = (S - self.windows.truth)[..., MOTION]
        error[..., PSI] = wrap_angle(error[..., PSI])
        scaled = error / self.scale
        return np.where(np.isfinite(scaled), np.clip(scaled, -1e6, 1e6), _LOST).reshape(len(z), -1)


def typical_sizes(s0: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """Typical size (6,) of the motion's change from the starts s0 (runs, 10) in truth (runs, K, 10); one of both
    positions."""
    moved = (truth - s0[:, None])[..., MOTION]
    size = np.sqrt(np.mean(moved**2, axis=(0, 1)))
    size[:2] = size[:2].max()
    return np.where(size > 0.0, size, 1.0)


def _deviations(jacobian: np.ndarray, residuals: np.ndarray, runs: int) -> np.ndarray:
    """Standard deviations of the parameters from the linearised fit, also for errors that persist over a run.

    Source: Liang and Zeger (1986), Longitudinal data analysis using generalized linear models, Biometrika 73, 13-22;
    a run is a cluster.
    """
    found = np.full(jacobian.shape[1], np.nan)
    acts = np.abs(jacobian).max(axis=0) > 0.0
    J = jacobian[:, acts]
    inverse = np.linalg.pinv(J.T @ J)
    of_run = np.einsum("rnk,rn->rk", J.reshape(runs, -1, J.shape[1]), residuals.reshape(runs, -1))
    spread = inverse @ (of_run.T @ of_run) @ inverse * (runs / max(runs - 1, 1))
    found[acts] = np.sqrt(np.maximum(np.diag(spread), 0.0))
    return found
