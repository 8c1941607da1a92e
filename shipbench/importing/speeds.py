"""Speeds from positions: the derivative of a smoothing spline whose stiffness is estimated from the data; never
differences of samples."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .thresholds import THRESHOLDS


@dataclass(frozen=True)
class Smoothed:
    """Derivatives on the grid (count, signals), the spline's time constant [s] and the removed scatter (r.m.s., unit of
    the signals)."""

    rate: np.ndarray
    time_constant: float
    noise: float


def derivative(t: np.ndarray, values: np.ndarray, grid: np.ndarray, dt: float, scale: float) -> Smoothed:
    """Time derivatives of noisy signals of one sensor.

    A cubic smoothing spline (`scipy.interpolate.make_smoothing_spline`; Woltring 1986): the curve f of least sum (v -
    f)^2 + lam * integral f''^2. It is the Rauch-Tung-Striebel smoother of a body whose acceleration is white noise
    (Wahba 1978). Its time constant (lam * step)^(1/4) is the one that best predicts held-out blocks of samples, each 5
    `scale` long: blocks, because a receiver's errors last for seconds, and a cross-validation that leaves out single
    samples takes them for motion (Chu & Marron 1991). It is not let below `scale`.

    Args:
        t, values: (m,), (m, signals) samples, t increasing [s].
        grid: (count,) times of the result [s].
        dt: step of the grid [s]; samples that are much faster are first averaged in bins of a quarter of it.
        scale: shortest time constant [s]. Froude's time sqrt(L / g) serves: waves are faster, manoeuvres slower. On
            simulated manoeuvres of 130 m at 1 Hz the error is then 0.002 m/s without noise and 0.009 m/s with 0.2 m of
            it; in the first and last 5 s 0.012 and 0.027 m/s.
    """
    from scipy.interpolate import make_smoothing_spline

    t, values = _binned(t, values, dt / THRESHOLDS.count("spline_bins"))
    if len(t) < THRESHOLDS.count("spline_least_samples"):
        slope = np.polyfit(t - t[0], values, 1)[0] if len(t) > 1 else np.zeros(values.shape[1])
        return Smoothed(np.tile(slope, (len(grid), 1)), scale, 0.0)
    step = float(np.median(np.diff(t)))
    s = (t - t[0]) / step  # unit spacing keeps the penalty matrix well scaled
    time = _best_time(s, values - values.mean(axis=0), scale / step)
    trend = _ends(s, values, THRESHOLDS.value("spline_end") * time)
    spline = make_smoothing_spline(s, values - trend(s), lam=time**4)
    at = np.clip((grid - t[0]) / step, s[0], s[-1])
    rate = (spline.derivative()(at) + trend.derivative()(at)) / step
    return Smoothed(rate, max(time * step, scale), float(np.sqrt(np.mean((values - trend(s) - spline(s)) ** 2))))


def _ends(s: np.ndarray, values: np.ndarray, reach: float) -> Any:
    """Cubic whose accelerations at both ends are those of parabolas through the samples up to `reach` from there.

    Without it the spline, which has no acceleration at its ends, would be wrong there by acceleration times time
    constant.
    """
    from scipy.interpolate import CubicSpline

    accelerations = []
    for near in (s <= s[0] + reach, s >= s[-1] - reach):
        enough = near.sum() >= THRESHOLDS.count("spline_least_samples")
        accelerations.append(
            2.0 * np.polyfit(s[near] - s[near].mean(), values[near], 2)[0] if enough else np.zeros(values.shape[1])
        )
    first, last = accelerations
    length = s[-1] - s[0]
    # End values of the cubic with these accelerations and no value or slope at the beginning.
    rise = length**2 * (first / 3.0 + last / 6.0)
    return CubicSpline([s[0], s[-1]], np.array([np.zeros_like(rise), rise]), bc_type=((2, first), (2, last)))


def _best_time(s: np.ndarray, values: np.ndarray, scale: float) -> float:
    """Time constant [steps] with the least error on held-out blocks; of a long signal two parts are used."""
    from scipy.interpolate import make_smoothing_spline

    times = scale * THRESHOLDS.value("spline_factor") ** np.arange(THRESHOLDS.count("spline_candidates"))
    parts, length = [slice(0, None)], THRESHOLDS.count("spline_block")
    if len(s) > 2 * length:
        parts = [slice(k - length // 2, k + length // 2) for k in (len(s) // 4, 3 * len(s) // 4)]
    errors = np.zeros(len(times))
    for part in parts:
        a, b = s[part], values[part]
        block = np.floor((a - a[0]) / max(THRESHOLDS.value("spline_held_out") * scale, 2.0)).astype(int)
        for third in range(3):
            held_out = (block % 3 == third) & (block > 0) & (block < block[-1])
            if held_out.any() and (~held_out).sum() >= THRESHOLDS.count("spline_least_samples"):
                for k, time in enumerate(times):
                    spline = make_smoothing_spline(a[~held_out], b[~held_out], lam=time**4)
                    errors[k] += np.sum((b[held_out] - spline(a[held_out])) ** 2)
    return float(times[np.argmin(errors)])


def _binned(t: np.ndarray, values: np.ndarray, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Means of times and values in bins of `width`, where there are several samples to a bin."""
    if len(t) < 2 or np.median(np.diff(t)) > 0.5 * width:
        return t, values
    which = np.floor((t - t[0]) / width + 1e-6).astype(int)
    starts = np.flatnonzero(np.diff(which, prepend=-1))
    sizes = np.diff([*starts, len(t)])
    return np.add.reduceat(t, starts) / sizes, np.add.reduceat(values, starts, axis=0) / sizes[:, None]
