"""Identification of columns without heads from the ship's kinematics: position, heading, yaw rate and velocities.

The heading changes by the yaw rate, and the track's velocity, rotated into body axes by the heading, is surge and sway.
In a log in which the ship turns, no other choice of columns fulfils both. Rudder, shaft speed and the rest have no such
relation and are left to the reader.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...units import unit_factor
from ..thresholds import THRESHOLDS
from .assign import Assigned, Entry
from .columns import Column


@dataclass(frozen=True)
class _Motion:
    """Means (m,) of each column over a window and their change over it [1/s]."""

    means: np.ndarray
    changes: np.ndarray


def identify(columns: Sequence[Column], t: np.ndarray, found: Assigned) -> None:
    """Add the channels that the motion identifies to `found`, each marked as not sure."""
    known = THRESHOLDS.value("headless_known") * len(t)
    free = [c for c in columns if c.name not in found.used() and not c.head.name and len(c.known) > known]
    free = [c for c in free if np.ptp(c.known) > 0]
    if found.entries or not THRESHOLDS.count("headless_least") <= len(free) <= THRESHOLDS.count("headless_most"):
        return
    motion = _motion(np.array([c.values for c in free]), t)
    if motion is None:
        return
    best = max(_choices(motion), default=None, key=lambda choice: choice[0])
    if best is None:
        return
    _, units, places = best
    for channel, place in places.items():
        column = free[place]
        found.entries[channel] = Entry(
            channel, {"column": column.name, "unit": units[channel]}, (column,), ["no head; identified by the motion"]
        )
    told = ", ".join(f"{channel} '{free[place].name}' [{units[channel]}]" for channel, place in places.items())
    found.notes.append(
        f"NOT SURE: the columns have no heads; taken as {told}: only so heading, yaw rate, track and speeds agree."
    )
    if earth := [f"'{free[k].name}'" for k in _in_earth_axes(motion, places)]:
        found.notes.append(
            f"{' and '.join(earth)} are velocities in earth axes and not taken; u and v come from the track. To take "
            'them, map them as u and v, and write velocities = "earth" into dataset.toml.'
        )
    found.notes.append(
        "NOT SURE: x is taken as north. A log with x east and angles counter-clockwise would look the same."
    )


def _motion(values: np.ndarray, t: np.ndarray) -> _Motion | None:
    new = (
        np.r_[True, np.diff(np.maximum.accumulate(np.nan_to_num(t, nan=-np.inf))) > 0]
        & np.isfinite(t)
        & np.isfinite(values).all(axis=0)
    )
    t, values = t[new], values[:, new]
    if len(t) < THRESHOLDS.count("headless_samples"):
        return None
    window = max(THRESHOLDS.value("yaw_window"), THRESHOLDS.value("headless_window") * float(np.median(np.diff(t))))
    points = min(THRESHOLDS.count("headless_points"), len(t))
    at = np.linspace(t[0] + window / 2, t[-1] - window / 2, points)
    parts = np.array(
        [[np.interp(at + shift * window, t, v) for shift in (-0.5, -0.25, 0.0, 0.25, 0.5)] for v in values]
    )
    return _Motion(parts.mean(axis=1), (parts[:, 4] - parts[:, 0]) / window)


def _choices(motion: _Motion) -> list[tuple[float, dict[str, str], dict[str, int]]]:
    """Choices of heading, yaw rate and position that agree, as (score, units, places)."""
    found = []
    count, turn = len(motion.means), np.deg2rad(THRESHOLDS.value("headless_turn"))
    for psi, r in itertools.permutations(range(count), 2):
        fit = _line(motion.means[r], motion.changes[psi])
        if fit is None or fit[1] < THRESHOLDS.value("headless_correlation"):
            continue
        for psi_unit, r_unit in itertools.product(("deg", "rad"), ("deg/s", "rad/s", "deg/min")):
            heading = motion.means[psi] * unit_factor("psi", psi_unit)
            if np.ptp(heading) < turn or not _is_unit(fit[0] * unit_factor("psi", psi_unit), unit_factor("r", r_unit)):
                continue
            for x, y in itertools.permutations([k for k in range(count) if k not in (psi, r)], 2):
                scored = _track(motion, heading, x, y)
                if scored is None:
                    continue
                units = {"x": "m", "y": "m", "psi": psi_unit, "r": r_unit} | scored[1]
                found.append((scored[0] + fit[1], units, {"x": x, "y": y, "psi": psi, "r": r} | scored[2]))
    return found


def _track(motion: _Motion, heading: np.ndarray, x: int, y: int) -> tuple[float, dict[str, str], dict[str, int]] | None:
    """Agreement of a position with the heading, and with the columns of surge and sway where there are any."""
    north, east = motion.changes[x], motion.changes[y]
    surge, sway = north * np.cos(heading) + east * np.sin(heading), east * np.cos(heading) - north * np.sin(heading)
    ahead, most = THRESHOLDS.value("headless_ahead"), THRESHOLDS.value("headless_sway")
    if np.mean(surge > 0) < ahead or np.sqrt(np.mean(sway**2)) > most * np.sqrt(np.mean(surge**2)):
        return None
    units: dict[str, str] = {}
    places: dict[str, int] = {}
    score = 0.0
    for channel, wanted, along_axis in (("v", sway, east), ("u", surge, north)):
        for k in range(len(motion.means)):
            fit, unit = _speed(motion.means[k], wanted)
            earth = _speed(motion.means[k], along_axis)[0]
            if fit and unit and k not in (x, y) and not (earth and earth[1] > fit[1]):
                units[channel], places[channel] = unit, k
                score += fit[1]
                break
    way = np.unwrap(np.arctan2(east, north))
    apart = np.angle(np.exp(1j * (way - heading)))
    followed = 1.0 - float(np.var(apart) / np.var(way)) if np.var(way) > 0 else 0.0
    if "v" not in places and followed < THRESHOLDS.value("headless_followed"):
        return None
    return score + followed, units, places


def _speed(column: np.ndarray, wanted: np.ndarray) -> tuple[tuple[float, float] | None, str | None]:
    """Line of a velocity `wanted` over a column, and the unit in which the column is that velocity."""
    fit, least = _line(column, wanted), THRESHOLDS.value("headless_correlation")
    units = (u for u in ("m/s", "kn") if fit and fit[1] > least and _is_unit(fit[0], unit_factor("u", u)))
    return fit, next(units, None)


def _in_earth_axes(motion: _Motion, places: dict[str, int]) -> list[int]:
    """Columns of velocities to the north and to the east, where both are there and no channel."""
    rest = [k for k in range(len(motion.means)) if k not in places.values()]
    found = [
        next((k for k in rest if _speed(motion.means[k], motion.changes[places[axis]])[1]), None) for axis in ("x", "y")
    ]
    return [k for k in found if k is not None] if None not in found else []


def _line(of: np.ndarray, wanted: np.ndarray) -> tuple[float, float] | None:
    """Slope through zero and correlation of `wanted` over `of`."""
    if np.std(of) == 0 or np.std(wanted) == 0:
        return None
    return float(np.sum(of * wanted) / np.sum(of * of)), float(np.corrcoef(of, wanted)[0, 1])


def _is_unit(slope: float, factor: float) -> bool:
    return slope > 0 and abs(np.log(slope / factor)) < THRESHOLDS.value("same_unit")
