"""Scores from predictions, one row per run: status, reason, every metric, the position error at fixed horizons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..metrics.base import METRICS, Column
from ..metrics.ed import ed
from ..records import Batch
from ..signals import STATES

HORIZONS_S = (10.0, 30.0, 60.0, 120.0)
DIVERGED_DISTANCE = 1e5
"""Largest position error [m] of a prediction that has not diverged."""


def horizons(horizon_s: float, dt: float) -> dict[str, int]:
    """Time step index by column name, for those of `HORIZONS_S` that the task reaches and the sampling hits."""
    return {
        f"ed_at_{h:g}s": round(h / dt) - 1
        for h in HORIZONS_S
        if h <= horizon_s + 1e-9 and abs(round(h / dt) * dt - h) < 1e-3 * dt
    }


def columns(metrics: Sequence[str], horizon_s: float, dt: float) -> list[Column]:
    """Numeric columns of a row, in order."""
    found = [column for name in metrics for column in METRICS.get(name).columns]
    return found + [Column(name, f"ED at {name[6:-1]} s", "m") for name in horizons(horizon_s, dt)]


def divergence(truth: np.ndarray, S: np.ndarray, dt: float) -> list[str]:
    """Reason for each run why it counts as diverged, or "": the first time step that is not finite or too far from the
    truth."""
    with np.errstate(all="ignore"):
        distance = np.hypot(S[..., 0] - truth[..., 0], S[..., 1] - truth[..., 1])
    finite = np.isfinite(S)
    bad = ~finite.all(axis=2) | ~(distance <= DIVERGED_DISTANCE)
    reasons = []
    for i in range(len(S)):
        if not bad[i].any():
            reasons.append("")
            continue
        k = int(np.argmax(bad[i]))
        if finite[i, k].all():
            what = f"{distance[i, k]:.3g} m from the true position (limit {DIVERGED_DISTANCE:g} m)"
        else:
            j = int(np.argmin(finite[i, k]))
            what = f"{STATES[j]} is {S[i, k, j]}"
        reasons.append(f"{what} at t = {(k + 1) * dt:g} s after the start")
    return reasons


def measure(
    metrics: Sequence[str], batch: Batch, S: np.ndarray, *, L: float, dt: float, ok: np.ndarray
) -> dict[str, np.ndarray]:
    """Score columns (batch,) by name; NaN for the runs that are not `ok` (batch,), which must not be scored."""
    steps = S.shape[1]
    values: dict[str, np.ndarray] = {}

    def put(name: str, scored: np.ndarray) -> None:
        values[name] = np.full(len(S), np.nan)
        values[name][ok] = scored

    true, pred, s0, U = batch.truth[ok], S[ok], batch.s0[ok], batch.U[ok]
    for name in metrics:
        for column, scored in METRICS.get(name).per_run(true=true, pred=pred, s0=s0, L=L, dt=dt, U=U).items():
            put(column, scored)
    distance = ed(true=true, pred=pred)
    for column, knot in horizons(steps * dt, dt).items():
        put(column, distance[:, knot])
    return values
