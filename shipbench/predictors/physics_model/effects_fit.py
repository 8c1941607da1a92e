"""The fit of eq. (2) to (8) together with the values of effects: those of forces are symbols of the rollout beside p,
those of gears and sensors enter before and after it and are differenced."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...estimation.extension import Extension, measured, true_start
from ...physics import eq2
from ...ship import Particulars
from ...signals import MOTION
from .fit import Data, Fit, Forces, bounds, descend, intervals, parameter_scale, rollout_function, subproblem

_P = eq2.NUM_PARAMETERS
_DIFFERENCE = 1e-3
"""Step of the differences, in typical sizes."""

_PRIOR = 10.0
"""Standard deviation of the prior of an effect's value, in typical sizes: it acts only in directions that the data do
not identify."""

_FIRST, _FIRST_GEAR = 0.1, 1.0
"""Starting values, in typical sizes: some forces have no slope at zero, and a rate limit acts only where it is
reached."""


def fit_extension(
    data: Data, base: Fit, extension: Extension, ship: Particulars, repath: Callable[[Extension], np.ndarray],
    commanded: bool, iterations: int,
    tolerance: float,
) -> tuple[Fit, Extension]:  # fmt: skip
    """Fit p0..p10 and the effects' values together, starting from the plain fit `base`; effects' shape parameters stay
    as they are in `extension`.

    A value has a zero-mean prior of ten typical sizes, whose weight against the rollouts counts every run as one
    observation. The parameters in `Extension.held` stay zero.

    Args:
        repath: the actuators' path under an extension's dynamics; evaluated again at every step where only commands are
            recorded.
    """
    model = _Extended(data, extension, ship, repath, commanded)
    start = np.concatenate([base.p / model.p_scale, model.first])
    ridge = np.concatenate([np.zeros(_P), np.full(len(start) - _P, base.cost / (len(data.batch.s0) * _PRIOR**2))])
    start = np.clip(start, model.low, model.high)
    solver = subproblem(len(start), model.p_scale)
    q, e, J, cost, taken = descend(
        model.linearise, model.residuals, solver, start, model.low, model.high, ridge, iterations, tolerance
    )
    fitted = model.extension_at(q)
    if not np.isfinite(cost):
        return Fit(q[:_P] * model.p_scale, np.full((_P, 2), np.nan), cost, taken), fitted
    half = intervals(q, e, J, model.low, model.high)
    fitted.set_intervals(model.slots, half[_P:] * model.q_scale[:, None])
    return Fit(q[:_P] * model.p_scale, half[:_P] * model.p_scale[:, None], float(np.sum(e * e)), taken), fitted


class _Extended:
    """Residuals and their derivatives with respect to p/scale and the effects' values in typical sizes."""

    def __init__(
        self,
        data: Data,
        extension: Extension,
        ship: Particulars,
        repath: Callable[[Extension], np.ndarray],
        commanded: bool,
    ) -> None:
        self.data, self.extension, self.repath, self.weight = data, extension, repath, data.weight()
        self.forces = extension.slots(ship.L, "force")
        self.slots = [*self.forces, *extension.slots(ship.L, "sensor", *(["gear"] if commanded else []))]
        self.p_scale, self.q_scale = parameter_scale(data.c), np.array([s.scale for s in self.slots])
        low, high = bounds(self.p_scale)
        low[list(extension.held())], high[list(extension.held())] = 0.0, 0.0
        gear = np.array([extension.terms[s.term].effect.enters == "gear" for s in self.slots], dtype=bool)
        self.first = np.where(gear, _FIRST_GEAR, _FIRST)
        self.regear = bool(gear.any())
        self.scale = np.concatenate([self.p_scale, self.q_scale])
        self.low = np.concatenate([low, [s.parameter.low for s in self.slots]]) / self.scale
        self.high = np.concatenate([high, [s.parameter.high for s in self.slots]]) / self.scale
        fitted = {(s.term, s.at) for s in self.forces}
        forces: Forces = tuple(
            (t.effect, tuple(None if (i, j) in fitted else v for j, v in enumerate(q)))
            for i, (t, q) in enumerate(zip(extension.terms, extension.values, strict=True))
            if t.effect.enters == "force"
        )
        self.timed = bool(forces)
        runs, steps = data.path.shape[:2]
        args = (data.c, data.dt / data.substeps, data.wind is not None)
        self.full, self.plain = (rollout_function(*args, s, forces, ship, runs * steps) for s in (True, False))
        self.num = _P + len(self.forces)

    def extension_at(self, q: np.ndarray) -> Extension:
        return self.extension.with_values(self.slots, q[_P:] * self.q_scale)

    def _inputs(self, at: Extension) -> tuple[np.ndarray, np.ndarray]:
        """True start (batch, 10) and the rollout's inputs."""
        path = self.repath(at) if self.regear else self.data.path
        return true_start(self.data.batch.s0, at.active("sensor"), self.data.dt), self.data.inputs(path, self.timed)

    def _measured(self, start: np.ndarray, X: np.ndarray, at: Extension) -> np.ndarray:
        """Sensor readings of the motion X (batch, K, 6)."""
        sensors = at.active("sensor")
        if not sensors:
            return X
        S = np.zeros((X.shape[0], X.shape[1] + 1, start.shape[1]))
        S[:, 0], S[:, 1:, MOTION] = start, X
        return measured(S, sensors, self.data.dt)[:, 1:, MOTION]

    def residuals(self, q: np.ndarray) -> np.ndarray:
        at = self.extension_at(q)
        start, w = self._inputs(at)
        X = self.data.motion(self.plain, start, w, (q * self.scale)[: self.num])
        with np.errstate(all="ignore"):
            return (self._measured(start, X, at) - self.data.truth) * self.weight

    def linearise(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        at = self.extension_at(q)
        start, w = self._inputs(at)
        motion, slope = self.data.linearised(self.full, start, w, (q * self.scale)[: self.num])
        slope = slope * self.scale[: self.num]
        J = np.empty((*motion.shape, len(q)))
        with np.errstate(all="ignore"):
            e = (self._measured(start, motion, at) - self.data.truth) * self.weight
            if at.active("sensor"):
                for i in range(self.num):
                    sides = [self._measured(start, motion + s * _DIFFERENCE * slope[..., i], at) for s in (1.0, -1.0)]
                    slope[..., i] = (sides[0] - sides[1]) / (2.0 * _DIFFERENCE)
            J[..., : self.num] = slope * self.weight[:, None]
            for i in range(self.num, len(q)):
                step = np.where(np.arange(len(q)) == i, _DIFFERENCE, 0.0)
                J[..., i] = (self.residuals(q + step) - self.residuals(q - step)) / (2.0 * _DIFFERENCE)
        return e, J
