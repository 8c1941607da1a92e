"""Resampling of irregular samples to a uniform grid: low-pass and decimate faster ones, interpolate slower ones, keep
the mean of held ones."""

from __future__ import annotations

import numpy as np

from .thresholds import THRESHOLDS


def usual_step(t: np.ndarray) -> float:
    """Median time between samples [s]; infinite for fewer than two."""
    return float(np.median(np.diff(t))) if len(t) > 1 else np.inf


def sample(t: np.ndarray, v: np.ndarray, start: float, dt: float, count: int, antialias: bool = True) -> np.ndarray:
    """Values (count,) at start + k dt of a continuous signal that was sampled at times t (m,).

    Where the samples come faster than dt, a zero-phase Bessel low-pass (order 4, forward and backward, -3 dB each way
    at 0.8 of the new Nyquist frequency; `scipy.signal.bessel`, `sosfiltfilt`) keeps what the grid cannot show from
    folding into it. Bessel, because it does not overshoot: a step of the rudder stays one. Slower samples are
    interpolated linearly.
    """
    grid = start + dt * np.arange(count)
    fine = int(np.ceil(dt / usual_step(t) - THRESHOLDS.value("equal_rates"))) if len(t) > 1 else 1
    if fine < 2 or not antialias:
        return np.interp(grid, t, v)
    from scipy.signal import bessel, sosfiltfilt

    # A uniform grid of the samples' own rate that contains the wanted one, as far as there are samples around it.
    step = dt / fine
    before = int((start - t[0]) / step + 1e-6)
    after = max(int((t[-1] - grid[-1]) / step + 1e-6), 0)
    dense = start + step * np.arange(-before, fine * (count - 1) + after + 1)
    values = np.interp(dense, t, v)
    pad = min(len(values) - 1, THRESHOLDS.count("filter_padding") * fine)
    if pad < 1:
        return np.interp(grid, t, v)
    order, cutoff = THRESHOLDS.count("filter_order"), THRESHOLDS.value("filter_cutoff") / fine
    smooth = sosfiltfilt(bessel(order, cutoff, output="sos", norm="mag"), values, padtype="odd", padlen=pad)
    return smooth[before::fine][:count]


def interval_means(t: np.ndarray, v: np.ndarray, start: float, dt: float, count: int) -> np.ndarray:
    """Mean (count,) over [t_k, t_k+1) of a signal that holds each value until the next one: a command keeps its
    impulse.

    Of the last interval it is the mean up to the last sample and its usual step, where there are samples in it.
    """
    edges = start + dt * np.arange(count + 1)
    step = usual_step(t)
    if t[-1] >= edges[-2]:
        edges[-1] = min(edges[-1], t[-1] + min(step, dt))
    inside = t[(t > edges[0]) & (t < edges[-1])]
    knots = np.unique(np.r_[edges, inside])
    # A sample within rounding of an edge belongs to the interval that begins there.
    at = np.maximum(np.searchsorted(t, knots[:-1] + 1e-6 * min(step, dt), side="right") - 1, 0)
    area = np.r_[0.0, np.cumsum(v[at] * np.diff(knots))]
    return np.diff(np.interp(edges, knots, area)) / np.diff(edges)


def interval_values(t: np.ndarray, v: np.ndarray, start: float, dt: float, count: int) -> np.ndarray:
    """Value (count,) of a continuous input for [t_k, t_k+1): the mean of its samples there, or where they are slower,
    interpolated at the middle."""
    if usual_step(t) < (1.0 - THRESHOLDS.value("equal_rates")) * dt:
        return interval_means(t, v, start, dt, count)
    return np.interp(start + dt * (np.arange(count) + 0.5), t, v)
