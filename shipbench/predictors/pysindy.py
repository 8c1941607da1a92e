"""Sparse equations of motion found by PySINDy: accelerations of u, v, r as polynomials of velocities and actuators
(needs the extra `pysindy`).

d(nu)/dt = Xi Theta(u, v, r, n, delta, F_b, F_s, measured wind ahead and abeam, depth), Xi sparse by sequentially
thresholded least squares (Brunton, Proctor and Kutz 2016, PNAS 113, eq. 2 to 7). All variables and accelerations are
divided by their root mean square first, so that one threshold suits them all. The actuators follow their commands by a
lag with a rate limit fitted to the data, as in `physics`.

Source: Brunton, Proctor and Kutz (2016), Discovering governing equations from data by sparse identification, PNAS 113.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np
import pysindy

from ..estimation.actuator_fit import fit_actuators
from ..integrate import motion_rhs, rk4_step
from ..physics.actuators import lag_with_rate_limit
from ..records import Dataset
from ..signals import ACTUATORS, COMMANDS, MOTION, PSI, STATES, VELOCITY
from ._features import InputFeatures
from ._numbers import WEIGHT, check_numbers
from ._saved import check_shapes, sample_time
from .base import History, PredictorBase

_BEYOND = 10.0
"""Factor of the largest training velocity above which a run has diverged: polynomials grow fast outside the data."""


@dataclass
class PySINDy(PredictorBase):
    """SINDy model of the accelerations; the settings are PySINDy's own defaults, not tuned here.

    Args:
        degree: of the polynomials.
        threshold: terms whose coefficient (of scaled variables) stays below it are dropped.
        alpha: ridge penalty of the least squares.
        derivative: "finite_difference" (second order) or "smoothed" (of velocities smoothed by a Savitzky-Golay filter,
            for noisy data).
    """

    name: ClassVar[str] = "pysindy"
    needs: ClassVar[tuple[str, ...]] = ("pysindy",)
    seeded: ClassVar[bool] = False
    degree: int = 2
    threshold: float = 0.1
    alpha: float = 0.05
    derivative: str = "finite_difference"

    def __post_init__(self) -> None:
        check_numbers(self, {"degree": (1, 10), "threshold": WEIGHT, "alpha": WEIGHT})
        if self.derivative not in ("finite_difference", "smoothed"):
            raise ValueError(f"derivative = '{self.derivative}'; accepted: 'finite_difference' or 'smoothed'")
        self._dt = 0.0
        self._found: dict[str, np.ndarray] = {}

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return bool(self._found)

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Find the equations from all runs of `train` and `valid` (no early stopping); `seed` has no effect."""
        data = train.merged(valid)
        self.inputs, self._dt = data.inputs, data.dt
        methods = {"finite_difference": pysindy.FiniteDifference, "smoothed": pysindy.SmoothedFiniteDifference}
        nu, rates, others = [], [], []
        for run in data.runs:
            method = methods[self.derivative]()
            rates.append(np.asarray(method(run.states[:, VELOCITY], self._dt)))
            nu.append(np.asarray(method.smoothed_x_))
            others.append(
                np.concatenate([run.states[:, ACTUATORS], self._environment(run.inputs, run.states[:, PSI])], axis=1)
            )
        scale_x, scale_rate, scale_w = (_root_mean_square(np.concatenate(a)) for a in (nu, rates, others))
        # A channel that never moves is no regressor: beside the constant term it would make the problem singular.
        moving = np.concatenate(others).std(axis=0) > 1e-9 * scale_w
        found = pysindy.SINDy(
            optimizer=pysindy.STLSQ(threshold=self.threshold, alpha=self.alpha),
            feature_library=pysindy.PolynomialLibrary(degree=self.degree),
        )
        found.fit(
            [x / scale_x for x in nu], t=self._dt, x_dot=[rate / scale_rate for rate in rates],
            u=[w[:, moving] / scale_w[moving] for w in others] if moving.any() else None,
        )  # fmt: skip
        self._found = {
            "powers": np.asarray(found.feature_library.powers_), "coefficients": np.asarray(found.coefficients()),
            "moving": moving,
            "scale_x": scale_x, "scale_rate": scale_rate, "scale_w": scale_w,
            "actuators": fit_actuators(data.batch(), self._dt),
            "largest": np.abs(np.concatenate(nu)).max(axis=0),
        }  # fmt: skip
        return self

    def _environment(self, held: np.ndarray, psi: np.ndarray) -> np.ndarray:
        """Columns of U beyond the four commands (..., extras), wind as components from ahead and from starboard."""
        return InputFeatures(self.inputs)(held, psi)[..., len(COMMANDS) :]

    def _accelerations(self, nu: np.ndarray, others: np.ndarray) -> np.ndarray:
        """Accelerations (batch, 3) [m/s2, m/s2, rad/s2] at velocities (batch, 3), actuators and environment (batch, 4 +
        extras)."""
        f = self._found
        variables = np.concatenate([nu / f["scale_x"], (others / f["scale_w"])[:, f["moving"]]], axis=1)
        terms = np.prod(variables[:, None, :] ** f["powers"], axis=2)
        # A sum row by row: a matrix product may round differently for another size of batch.
        return (terms[:, None, :] * f["coefficients"]).sum(axis=2) * f["scale_rate"]

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        S = np.full((len(s0), U.shape[1], len(STATES)), np.nan)
        state, actuator = tuple(s0[:, MOTION].T), s0[:, ACTUATORS]
        limit = _BEYOND * np.maximum(self._found["largest"], 1e-12)
        with np.errstate(all="ignore"):  # a run that diverges becomes NaN and stays so; the others go on
            for k in range(U.shape[1]):
                middle, end = (self._actuators_after(actuator, U[:, k], share * self._dt) for share in (0.5, 1.0))
                state = self._step(state, (actuator, middle, end), U[:, k])
                gone = (np.abs(np.stack(state[3:], axis=1)) > limit).any(axis=1)
                state = tuple(np.where(gone, np.nan, component) for component in state)
                actuator = end
                S[:, k, MOTION], S[:, k, ACTUATORS] = np.stack(state, axis=1), actuator
        return S

    def _actuators_after(self, now: np.ndarray, held: np.ndarray, dt: float) -> np.ndarray:
        T, rate = self._found["actuators"].reshape(3, 2)[[0, 1, 2, 2]].T
        return lag_with_rate_limit(now, held[:, : len(COMMANDS)], dt, T, rate)

    def _step(self, state: tuple[Any, ...], actuators: tuple[np.ndarray, ...], held: np.ndarray) -> tuple[Any, ...]:
        def accelerations(psi: Any, u: Any, v: Any, r: Any, stage: int) -> Any:
            others = np.concatenate([actuators[stage], self._environment(held, psi)], axis=1)
            return self._accelerations(np.stack([u, v, r], axis=1), others).T

        return rk4_step(motion_rhs(accelerations), state, self._dt)

    def describe(self) -> str:
        """Equations, one per acceleration, in variables divided by their root mean square (given below them)."""
        f = self._found
        extras = [f"environment {i + 1}" for i in range(len(f["moving"]) - 4)]
        controls = [name for name, used in zip([*STATES[ACTUATORS], *extras], f["moving"], strict=True) if used]
        names = [*STATES[VELOCITY], *controls]
        lines = []
        for name, row in zip(STATES[VELOCITY], f["coefficients"], strict=True):
            terms = [f"{c:+.4g}" + "".join(f" {v}" + (f"^{p}" if p > 1 else "") for v,
                    p in zip(names, powers, strict=True) if p)
                     for c, powers in zip(row, f["powers"], strict=True) if c]  # fmt: skip
            lines.append(f"d{name}/dt = {' '.join(terms) or '0'}")
        sizes = [*f["scale_x"], *f["scale_w"][f["moving"]]]
        rates = ", ".join(f"d{n}/dt {s:.4g}" for n, s in zip(STATES[VELOCITY], f["scale_rate"], strict=True))
        return "\n".join(
            [
                *lines,
                "divided by: " + ", ".join(f"{n} {s:.4g}" for n, s in zip(names, sizes, strict=True)) + "; " + rates,
            ]
        )

    def num_parameters(self) -> int:
        """Number of coefficients that are not zero, and of lags and rates of the actuators."""
        return int(np.count_nonzero(self._found["coefficients"]) + np.size(self._found["actuators"]))

    def _arrays(self) -> dict[str, np.ndarray]:
        return self._found

    def _meta(self) -> dict[str, Any]:
        return {"dt": self._dt}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        others = InputFeatures(self.inputs).count
        terms, used = arrays["powers"].shape[0], 3 + int(np.count_nonzero(arrays["moving"]))
        check_shapes(
            arrays,
            {
                "powers": (terms, used),
                "coefficients": (3, terms),
                "moving": (others,),
                "scale_w": (others,),
                "actuators": (6,),
            },
        )
        check_shapes(arrays, {"scale_x": (3,), "scale_rate": (3,), "largest": (3,)})
        self._found, self._dt = arrays, sample_time(meta)


def _root_mean_square(a: np.ndarray) -> np.ndarray:
    """Root mean square of the columns; 1 for a column that is zero throughout."""
    size = np.sqrt(np.mean(a**2, axis=0))
    return np.where(size > 0.0, size, 1.0)


PREDICTOR = PySINDy
