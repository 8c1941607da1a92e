"""Track in a log as a check of its clock: time that passed, by the distance made good."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .constants import EARTH_RADIUS, SIGMA
from .thresholds import THRESHOLDS


def positions(t: np.ndarray, values: np.ndarray, channels: Sequence[str]) -> np.ndarray | None:
    """Positions (n, 2) north, east [m], NaN where the row has none; None where the source has no positions. The earth
    is a sphere here."""
    names = next((pair for pair in (("x", "y"), ("lat", "lon")) if set(pair) <= set(channels)), None)
    if names is None:
        return None
    first, second = (values[:, channels.index(name)] for name in names)
    a, b = np.isfinite(first), np.isfinite(second)
    if b.any() and (a & b).sum() < THRESHOLDS.value("renewed_together") * a.sum():  # renewed in different rows
        second = np.where(a, np.interp(t, t[b], second[b]), np.nan)
    if names == ("x", "y"):
        return np.column_stack([first, second])
    lat, lon = first, second
    there = np.isfinite(lat) & np.isfinite(lon)
    found = np.full((len(values), 2), np.nan)
    if there.any():
        first = lat[there][0]
        found[there, 0] = EARTH_RADIUS * (lat[there] - first)
        found[there, 1] = EARTH_RADIUS * np.cos(first) * (np.unwrap(lon[there]) - lon[there][0])
    return found


def velocities(t: np.ndarray, values: np.ndarray, channels: Sequence[str]) -> np.ndarray | None:
    """Velocities (n, 2) over ground north, east [m/s] that the log states, between its samples by interpolation; None
    where it states none."""
    given = {name: values[:, k] for k, name in enumerate(channels)}
    if {"sog", "cog"} <= set(given):
        stated = given["sog"][:, None] * np.column_stack([np.cos(given["cog"]), np.sin(given["cog"])])
    elif {"u", "v", "psi"} <= set(given):
        c, s = np.cos(given["psi"]), np.sin(given["psi"])
        stated = np.column_stack([given["u"] * c - given["v"] * s, given["u"] * s + given["v"] * c])
    else:
        return None
    there = np.isfinite(stated).all(axis=1)
    if there.sum() < THRESHOLDS.count("line_least_points"):
        return None
    return np.column_stack([np.interp(t, t[there], stated[there, k]) for k in range(2)])


def usual(steps: np.ndarray) -> float:
    """Median of the forward steps [s]; NaN where there is none."""
    ahead = steps[steps > 0.0]
    return float(np.median(ahead)) if len(ahead) else np.nan


@dataclass(frozen=True)
class Jumps:
    """Jumps at joints (m,) between two fixes: time by which the clock went ahead of the track [s], its standard error,
    the part that a change of velocity within the pause could explain, and the component of the jump across the course.
    """

    seconds: np.ndarray
    error: np.ndarray
    turning: np.ndarray
    across: np.ndarray

    def certain(self, least: float, plain: Jumps) -> np.ndarray:
        """Mask of joints that only a clock explains: by `least` [s] or more, along the course, and far outside the
        jumps at joints without a pause.

        Outside means five standard errors, more where `plain` joints scatter by more than theirs (errors that last for
        seconds), and twice the 95 % quantile of `plain`.
        """
        doubt, twice = THRESHOLDS.value("clock_doubt"), THRESHOLDS.value("clock_spread")
        part, chance = THRESHOLDS.value("clock_across"), THRESHOLDS.value("clock_across_doubt")
        with np.errstate(invalid="ignore", divide="ignore"):
            spread = max(1.0, 0.5 * _quantile(np.abs(plain.seconds) / plain.error))
            size, error = np.abs(self.seconds), spread * self.error
            far = (size > doubt * error) & (size > twice * _quantile(np.abs(plain.seconds)))
            return (
                (size >= least) & far & (size > self.turning) & (self.across < np.maximum(part * size, chance * error))
            )


def _quantile(values: np.ndarray) -> float:
    values = values[np.isfinite(values)]
    return float(np.quantile(values, THRESHOLDS.value("clock_quantile"))) if len(values) else 0.0


def jumps(
    t: np.ndarray, p: np.ndarray, v: np.ndarray | None, joints: np.ndarray, low: np.ndarray, high: np.ndarray
) -> Jumps:
    """Jumps of the track against time between the fixes before and at each of `joints`.

    A straight line is fitted to the fixes on either side; where both meet in the middle of the pause, the track jumps
    by velocity times the seconds that did not pass. Where the log states velocities, the fixes less the displacement
    that they explain are nearly constant, and more of them serve.

    Args:
        t, p: (n,) [s], (n, 2) [m] fixes.
        v: (n, 2) stated velocities [m/s], or None.
        joints: (m,) rows.
        low, high: (m,) first row and row after the last that may serve.
    """
    pause = t[joints] - t[joints - 1]
    step = usual(np.diff(t))
    reach = np.ceil(THRESHOLDS.value("line_reach") * np.abs(pause) / step).astype(int)
    most, least = THRESHOLDS.count("line_points"), THRESHOLDS.count("line_least_points")
    counts, strides = np.clip(reach, least + 1, most), np.maximum(reach // most, 1)
    found = _jumps(t, p, np.zeros_like(p), joints, low, high, counts, strides)
    if v is None:
        return found
    way = np.vstack([np.zeros(2), np.cumsum(0.5 * (v[1:] + v[:-1]) * np.diff(t)[:, None], axis=0)])
    stated = _jumps(t, p - way, v, joints, low, high, np.full_like(counts, most), strides)
    doubt = THRESHOLDS.value("clock_doubt")
    with np.errstate(invalid="ignore"):
        better = ~(doubt * found.error + found.turning < doubt * stated.error + stated.turning)
    return Jumps(
        *(np.where(better, getattr(stated, f), getattr(found, f)) for f in ("seconds", "error", "turning", "across"))
    )


def _jumps(
    t: np.ndarray, q: np.ndarray, v: np.ndarray, joints: np.ndarray, low: np.ndarray, high: np.ndarray,
    counts: np.ndarray, strides: np.ndarray
) -> Jumps:  # fmt: skip
    middle = 0.5 * (t[joints] + t[joints - 1])
    number = np.arange(THRESHOLDS.count("line_points"))
    sides = []
    for first, way in ((joints - 1, -1), (joints, 1)):
        rows = first[:, None] + way * strides[:, None] * number
        weight = (number < counts[:, None]) & (rows >= low[:, None]) & (rows < high[:, None])
        rows = np.clip(rows, 0, len(t) - 1)
        sides.append(_line(t[rows] - middle[:, None], q[rows] - q[joints][:, None, :], weight.astype(float)))
    (a0, b0, var0), (a1, b1, var1) = sides
    velocity = 0.5 * (b0 + b1 + v[joints] + v[joints - 1])
    change = b1 + v[joints] - b0 - v[joints - 1]
    leap = a1 - a0
    with np.errstate(invalid="ignore", divide="ignore"):
        speed = np.hypot(*velocity.T)
        seconds = -np.sum(leap * velocity, axis=1) / speed**2
        across = np.abs(leap[:, 0] * velocity[:, 1] - leap[:, 1] * velocity[:, 0]) / speed**2
        turning = 0.25 * np.hypot(*change.T) * np.abs(t[joints] - t[joints - 1]) / speed
        return Jumps(seconds, np.sqrt(var0 + var1) / speed, turning, across)


def _line(s: np.ndarray, q: np.ndarray, w: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit of a weighted straight line: value (m, 2) at s = 0, slope (m, 2) and variance (m,) of the value; NaN for
    fewer than four points."""
    n, s1, s2 = w.sum(axis=1), (w * s).sum(axis=1), (w * s**2).sum(axis=1)
    q0, q1 = np.einsum("mk,mkc->mc", w, q), np.einsum("mk,mkc->mc", w * s, q)
    with np.errstate(invalid="ignore", divide="ignore"):
        det = np.where(n >= THRESHOLDS.count("line_least_points"), n * s2 - s1**2, np.nan)
        value = (s2[:, None] * q0 - s1[:, None] * q1) / det[:, None]
        slope = (n[:, None] * q1 - s1[:, None] * q0) / det[:, None]
        rest = w[:, :, None] * (q - value[:, None, :] - slope[:, None, :] * s[:, :, None]) ** 2
        return value, slope, rest.sum(axis=(1, 2)) / (2.0 * (n - 2.0)) * s2 / det


def was_set_back(t: np.ndarray, p: np.ndarray, joint: int, seconds: float) -> bool | None:
    """Whether the rows from `joint` on are later than their stamps, by `seconds`; None where the track does not show
    it.

    Rows that are merely late lie on the track of the rows before; behind a clock that was set back, the ship was
    further on at the same stamps.

    Args:
        t, p: (n,) [s], (n, 2) [m] fixes in the order of the log, some of them before `joint`.
    """
    before = np.argsort(t[:joint], kind="stable")
    old_t, old_p = t[:joint][before], p[:joint][before]
    new_t, new_p = t[joint:], p[joint:]
    shared = (new_t >= old_t[0]) & (new_t <= old_t[-1]) if joint else np.zeros(len(new_t), bool)
    if joint < 2 or not shared.any():
        return None
    first_other = np.argmax(~shared) if not shared.all() else len(shared)
    shared[max(first_other, 1) :] = False  # until the stamps have caught up
    if not shared.any():
        return None
    expected = np.column_stack([np.interp(new_t[shared], old_t, old_p[:, k]) for k in range(2)])
    away = float(np.median(np.hypot(*(new_p[shared] - expected).T)))
    recent = old_t >= old_t[-1] - max(seconds, old_t[-1] - old_t[-min(THRESHOLDS.count("line_least_points"), joint)])
    length = old_t[-1] - old_t[recent][0]
    speed = float(np.hypot(*(old_p[-1] - old_p[recent][0]))) / length if length > 0 else 0.0
    noise = _scatter(old_t[recent], old_p[recent])
    if speed * seconds <= THRESHOLDS.value("set_back_noise") * noise or speed * seconds == 0.0:
        return None
    return away > THRESHOLDS.value("set_back_share") * speed * seconds


def _scatter(t: np.ndarray, p: np.ndarray) -> float:
    """Noise of the fixes (standard deviation of a coordinate) [m]: of each against the line between its neighbours."""
    span = t[2:] - t[:-2]
    if not (span > 0.0).any():
        return 0.0
    share = np.where(span > 0.0, (t[1:-1] - t[:-2]) / np.where(span > 0.0, span, 1.0), 0.5)[:, None]
    off = p[1:-1] - (1.0 - share) * p[:-2] - share * p[2:]
    return SIGMA * float(np.median(np.abs(off - np.median(off, axis=0)))) / np.sqrt(1.5)
