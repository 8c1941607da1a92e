"""Time series of the plots of a diagnosis: rollouts before and after, latent force and residuals, along the runs."""

from __future__ import annotations

import numpy as np

from ...estimation.calibration import calibration_of
from ...estimation.forward import Segments
from ...estimation.linearisation import Scales
from ...estimation.open_loop import distance, rollout_plant
from ...records import Dataset
from ..result import Trace
from ..selection.analysis import Analysis
from .held_out_gain import horizon, recorded_gears


def trace_of(dataset: Dataset, found: Analysis, rollouts: tuple[np.ndarray, np.ndarray] | None = None) -> Trace:
    """Trace of open-loop rollouts of the calibrated ship without and with the causes, fitted to all runs (the gain is
    held out, these plots are not), and of latent forces before and after.

    rollouts: motions (B, K + 1, 6) of a simulation without and with its correction, which are shown instead.
    """
    null, final, changed = found.selection.null, found.final, found.changed_gears
    gears, seconds = recorded_gears(dataset, null), horizon(dataset.ship.L)
    plain = rollout_plant(dataset, gears, seconds)
    before = distance(plain, Scales(plain), calibration_of(null))[1] if rollouts is None else rollouts[0]
    after = before if rollouts is None else rollouts[1]
    if rollouts is None and found.unknown is None and (final.model.terms or changed):
        driven = rollout_plant(dataset, gears | changed, seconds)
        after = distance(driven, Scales(driven), calibration_of(final))[1]
    seg = plain.seg
    short, B = null.plant, len(null.estimate)

    def force(z: np.ndarray) -> np.ndarray:
        """Force at the samples, (B, K + 1, 3)."""
        return short.hat @ (np.moveaxis(z[:, 6:].reshape(B, 3, short.knots), 1, 2) * null.scales.w)

    sd = np.sqrt(np.maximum(np.diagonal(null.cov, axis1=1, axis2=2), 0.0))
    unit = null.scales.noise * np.exp(0.5 * null.hyper.log_noise)
    white = null.scales.colour.whitened((short.seg.states[..., :6] - null.columns.predicted) / unit)
    white[..., ~short.seg.seen] = np.nan
    lines = [_along(short.seg, v, seg) for v in (force(null.estimate), force(sd), force(final.estimate), white)]
    hide, knots = seg.mask[..., None], slice(None, None, 5)  # enough for plots
    t = np.arange(plain.steps + 1) * seg.dt

    def shown(values: np.ndarray) -> np.ndarray:
        return np.where(hide, values, np.nan)

    return Trace(
        run=seg.run, names=tuple(r.id for r in dataset.runs), start=seg.start, t=t, measured=shown(seg.states[..., :6]),
        before=shown(before),
        after=shown(after), inputs=shown(seg.states[..., 6:]), knots=t[knots], force=shown(lines[0])[:, knots],
        force_sd=shown(lines[1])[:, knots], force_after=shown(lines[2])[:, knots],
        white=shown(lines[3]), held_out=False,
    )  # fmt: skip


def _along(short: Segments, values: np.ndarray, long: Segments) -> np.ndarray:
    """Values (B, K + 1, C) on short segments, mapped to long ones of the same runs."""
    first = np.round(short.start / short.dt).astype(int)
    length = int(np.max(first + short.mask.sum(axis=1)))
    runs = np.full((short.runs, length, values.shape[-1]), np.nan)  # pieces that thinning left out have no force
    for b, run in enumerate(short.run):
        count = int(short.mask[b].sum())
        runs[run, first[b] : first[b] + count] = values[b, :count]
    start = np.round(long.start / long.dt).astype(int)
    at = np.minimum(start[:, None] + np.arange(long.mask.shape[1]), length - 1)
    return runs[long.run[:, None], at]
