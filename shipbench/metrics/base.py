"""Metric: a function of the true and the predicted states, with its label and unit.

One file per metric; the file's name is the metric's name and the file binds a `Metric` to `METRIC`. The function takes
keyword-only arguments, and only those of these that it needs:

- `true`, `pred`: (batch, K, 10), states at the K predicted time steps, order and units of `signals.STATES`;
- `s0`: (batch, 10), the state that the predictor was given. It is known, so it is never scored;
- `U`: (batch, K, inputs), the recorded commands and environment, `U[:, k]` held on the interval that ends at time step
k;
- `L`: the ship's length [m]; `dt`: sample time [s].
"""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..registry import Registry
from ..signals import PSI, STATES, wrap_angle

METRICS = Registry("metric", "metrics", "METRIC", helpers=frozenset({"base"}))


@dataclass(frozen=True)
class Column:
    """Number per run: its name in the rows, the label and unit that tables and axes print."""

    name: str
    label: str
    unit: str


@dataclass(frozen=True)
class Metric:
    """Function with the data to print its values.

    Args:
        function: keyword-only; returns (batch, K) if `per_knot`, else (batch,); with several columns they are a
            further, last axis.
        columns: of the returned values, in that order.
        per_knot: the per-run value is the mean over the K time steps.
        smaller_is_better: direction of ranking.
    """

    function: Callable[..., np.ndarray]
    columns: tuple[Column, ...]
    per_knot: bool = True
    smaller_is_better: bool = True

    def values(
        self, *, true: np.ndarray, pred: np.ndarray, s0: np.ndarray, L: float, dt: float, U: np.ndarray | None = None
    ) -> np.ndarray:
        """Values of the metric, (batch, K[, columns]) or (batch[, columns]).

        Raises:
            InputError: the shapes of truth and prediction differ, or the metric needs `U` and none is given.
        """
        if (
            true.shape != pred.shape
            or true.ndim != 3
            or true.shape[2] != len(STATES)
            or s0.shape != (len(true), len(STATES))
        ):
            raise InputError(
                f"{self.columns[0].label}: true {true.shape}, pred {pred.shape}, s0 {s0.shape}; accepted: true and "
                "pred "
                f"(batch, K, {len(STATES)}), s0 (batch, {len(STATES)})."
            )
        known = {"true": true, "pred": pred, "s0": s0, "L": L, "dt": dt, "U": U}
        needed = inspect.signature(self.function).parameters
        if "U" in needed and U is None:
            raise InputError(f"{self.columns[0].label}: the metric needs the inputs; give U (batch, K, inputs).")
        return self.function(**{name: known[name] for name in needed})

    def per_run(
        self, *, true: np.ndarray, pred: np.ndarray, s0: np.ndarray, L: float, dt: float, U: np.ndarray | None = None
    ) -> dict[str, np.ndarray]:
        """Values (batch,) of each column: the mean over time steps where the metric is one per time step."""
        values = self.values(true=true, pred=pred, s0=s0, L=L, dt=dt, U=U)
        if self.per_knot:
            values = values.mean(axis=1)
        if len(self.columns) == 1:
            return {self.columns[0].name: values}
        return {column.name: values[:, i] for i, column in enumerate(self.columns)}


def state_error(true: np.ndarray, pred: np.ndarray) -> np.ndarray:
    """Error `pred - true` (batch, K, 10); the heading's difference is wrapped to (-pi, pi]."""
    error = pred - true
    error[..., PSI] = wrap_angle(error[..., PSI])
    return error


def fit_percent(*, true: np.ndarray, pred: np.ndarray) -> np.ndarray:
    """Fit 100 (1 - |pred - true| / |true - mean(true)|) of each signal [%], (K, 10) to (10,): the NRMSE fit of MATLAB's
    `compare`.

    100 is exact, 0 no better than the mean; NaN where the true signal is constant.

    Source: MATLAB documentation of `compare`.
    """
    with np.errstate(all="ignore"):
        error = np.linalg.norm(state_error(true, pred), axis=0)
        centred = true - true.mean(axis=0)
        spread = np.linalg.norm(centred, axis=0)
        constant = np.max(np.abs(centred), axis=0) <= 1e-9 * np.maximum(1.0, np.max(np.abs(true), axis=0))
        return np.where(constant, np.nan, 100.0 * (1.0 - error / np.where(constant, 1.0, spread)))
