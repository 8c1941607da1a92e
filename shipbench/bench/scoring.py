"""Scores from predictions, one row per run: status, reason, every metric, the position error at fixed horizons."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..metrics.base import METRICS, Column, state_error
from ..metrics.ed import ed
from ..records import Batch
from ..signals import MOTION, PSI, STATES, X, Y
from .bands import COVERAGE

HORIZONS_S = (10.0, 30.0, 60.0, 120.0)
DIVERGED_DISTANCE = 1e5
"""Largest position error [m] of a prediction that has not diverged."""


BAND = "band_"
"""Begin of the names of the columns of bands."""
_BAND_CHANNELS = {"position": ("position", "m", [X, Y]), "heading": ("heading", "rad", [PSI])}


def horizons(horizon_s: float, dt: float) -> dict[str, int]:
    """Time step index by column name, for those of `HORIZONS_S` that the task reaches and the sampling hits."""
    return {
        f"ed_at_{h:g}s": round(h / dt) - 1
        for h in HORIZONS_S
        if h <= horizon_s + 1e-9 and abs(round(h / dt) * dt - h) < 1e-3 * dt
    }


def columns(metrics: Sequence[str], horizon_s: float, dt: float, bands: bool = False) -> list[Column]:
    """Numeric columns of a row, in order; with `bands` those of `band_scores`."""
    found = [column for name in metrics for column in METRICS.get(name).columns]
    at = horizons(horizon_s, dt)
    found += [Column(name, f"ED at {name[6:-1]} s", "m") for name in at]
    for name, (label, unit, _) in _BAND_CHANNELS.items() if bands else ():
        found += [Column(f"{BAND}{name}_{k[3:]}", f"{label} inside at {k[6:-1]} s", "%") for k in at]
        found += [Column(f"{BAND}{name}_width", f"{label} width", unit)]
        found += [Column(f"{BAND}{name}_score", f"{label} interval score", unit)]
    return found


def band_scores(truth: np.ndarray, S: np.ndarray, W: np.ndarray, dt: float) -> dict[str, np.ndarray]:
    """Columns (batch,) of the 90 % bands S +- W: share of the measurements inside at fixed times [%], and over the time
    steps the mean width and the mean interval score; NaN without a band.

    The interval score is the width, plus 2 / 0.1 times the distance of a measurement outside: the smaller the better.
    Position counts north and east apart. W is (batch, K, 6).

    Source: Gneiting, Raftery, Strictly proper scoring rules, prediction, and estimation, JASA 102 (2007) 359-378,
    eq. (43).
    """
    error = np.abs(state_error(truth, S))[..., MOTION]
    inside = np.where(np.isfinite(W), 100.0 * (error <= W), np.nan)
    score = 2.0 * W + 2.0 / (1.0 - COVERAGE) * np.maximum(error - W, 0.0)
    found = {}
    for name, (_, _, channels) in _BAND_CHANNELS.items():
        for column, knot in horizons(S.shape[1] * dt, dt).items():
            found[f"{BAND}{name}_{column[3:]}"] = inside[:, knot, channels].mean(axis=-1)
        found[f"{BAND}{name}_width"] = 2.0 * W[..., channels].mean(axis=(1, 2))
        found[f"{BAND}{name}_score"] = score[..., channels].mean(axis=(1, 2))
    return found


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
    metrics: Sequence[str], batch: Batch, S: np.ndarray, *, L: float, dt: float, ok: np.ndarray,
    W: np.ndarray | None = None,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Score columns (batch,) by name; NaN for the runs that are not `ok` (batch,), which must not be scored. With the
    half-widths W (batch, K, 6) of bands also `band_scores`."""
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
    for column, scored in band_scores(true, pred, W[ok], dt).items() if W is not None else ():
        put(column, scored)
    return values
