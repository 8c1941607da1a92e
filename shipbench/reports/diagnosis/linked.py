"""Measured runs and open-loop predictions of the baseline and the extended model, as linked plots
(`render/linked.py`)."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...diagnosis.result import Diagnosis, Trace
from ...leaderboard.histories import EAST, ERROR, FITTED, NORTH, SIGNALS, near, shown
from ...metrics.base import fit_percent
from ...metrics.ed import ed
from ...render.linked import Line, linked_plots, linked_run
from ...signals import ACTUATORS, F_B, F_S, STATES
from ..recorded import RUNS, thinned
from .text import figure

FITS = [STATES[i] for i in FITTED]
_SAMPLES = 25_000
"""Time steps of all runs of one page together: some 2.5 MB, beside Plotly's 1.2 MB."""


def changed(d: Diagnosis) -> bool:
    """Whether there is an extended model to draw beside the baseline."""
    return (
        d.trace is not None
        and d.verdict == "found"
        and not np.array_equal(d.trace.before, d.trace.after, equal_nan=True)
    )


def rollouts(trace: Trace, extended: bool) -> list[np.ndarray]:
    """Predictions (B, K + 1, 6) of the baseline model and, where there is one, of the extended model."""
    return [trace.before, trace.after][: 2 if extended else 1]


def position_errors(trace: Trace, predicted: np.ndarray) -> np.ndarray:
    """Mean position error ED of each segment (B,) [m], without the sample that is given; NaN where no position is
    measured, infinite where a measured one is not predicted."""
    with np.errstate(all="ignore"):
        error = ed(true=trace.measured, pred=predicted)[:, 1:]
    known = np.isfinite(trace.measured[:, 1:, :2]).all(axis=2)
    error = np.where(np.isfinite(error), error, np.inf)
    return np.where(
        known.any(axis=1), np.where(known, error, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1), np.nan
    )


def fits(measured: np.ndarray, predicted: np.ndarray) -> np.ndarray:
    """Fit of every motion signal (6,) [%] over the time steps at which measurement and prediction (K + 1, 6) are
    known."""
    known = np.isfinite(measured) & np.isfinite(predicted)
    channels = known.any(axis=0)
    steps = known[:, channels].all(axis=1)
    steps[0] = False  # the first one was given
    found = np.full(measured.shape[1], np.nan)
    if steps.any():
        both = [np.where(channels, values[steps], 0.0) for values in (measured, predicted)]
        found = np.where(channels, fit_percent(true=both[0], pred=both[1]), np.nan)
    return found


def chosen_segments(trace: Trace, extended: bool) -> list[int]:
    """Segments to draw, from the greatest error of the baseline model to the least: all, or `RUNS` evenly spread with
    the one of the least gain."""
    before, after = (position_errors(trace, p) for p in (trace.before, trace.after))
    order = [int(b) for b in np.argsort(-np.nan_to_num(before, nan=-1.0), kind="stable")]
    if len(order) <= RUNS:
        return order
    kept = {order[i] for i in np.linspace(0, len(order) - 1, RUNS - 1 if extended else RUNS).round().astype(int)}
    with np.errstate(invalid="ignore"):
        gains = before - after
    if extended and np.isfinite(gains).any():
        kept.add(int(np.nanargmin(gains)))
    return [b for b in order if b in kept]


def rollout_plots(trace: Trace, extended: bool, models: tuple[str, str]) -> dict[str, Any]:
    """Tracks and time histories of the chosen segments; the one with the greatest error is shown first."""
    segments = chosen_segments(trace, extended)
    predictions = rollouts(trace, extended)
    signals = [
        s for s in SIGNALS if s[0] not in (F_B, F_S) or np.any(np.nan_to_num(trace.inputs[..., s[0] - ACTUATORS.start]))
    ]
    motions = [s for s in signals if s[0] < ACTUATORS.start]
    columns = [EAST, NORTH, *(q for _, _, q in signals), ERROR]
    errors = [position_errors(trace, p) for p in predictions]
    runs = []
    for b in segments:
        S = np.concatenate([trace.measured[b], trace.inputs[b]], axis=-1)
        S = S[: int(np.flatnonzero(np.isfinite(S).any(axis=-1))[-1]) + 1]
        kept = thinned(np.concatenate([S, *(p[b, : len(S)] for p in predictions)], axis=1), _SAMPLES // len(segments))
        lines = [shown(S[kept], S[kept], signals)]
        for predicted in predictions:
            close = near(predicted[b, : len(S)], S)[kept]
            lines.append(shown(close, S[kept], motions) | {ERROR.name: ed(true=S[kept], pred=close)})
        cells = [
            [_error(e[b]), *_fits(fits(trace.measured[b], p[b]))] for e, p in zip(errors, predictions, strict=True)
        ]
        runs.append(
            linked_run(
                _name(trace, b), " to ".join(_error(e[b]) for e in errors), trace.t[kept], columns, lines, cells=cells
            )
        )
    names = [Line("measured", "measured"), *(Line(name, i) for i, name in enumerate(models[: len(predictions)]))]
    return linked_plots(columns, names, [ERROR.name, *(q.name for _, _, q in signals)], runs, ("east", "north"))


def _name(trace: Trace, b: int) -> str:
    """Name of the run, and where it is cut into several segments the time at which this one starts."""
    return trace.names[int(trace.run[b])] + (f" from {trace.start[b]:.0f} s" if trace.start[b] > 0 else "")


def _error(value: float) -> str:
    return f"{figure(value)} m" if np.isfinite(value) else "lost" if np.isinf(value) else "-"


def _fits(values: np.ndarray) -> list[str]:
    return [f"{values[i]:.0f} %" if np.isfinite(values[i]) else "-" for i in FITTED]
