"""Headings that were interpolated linearly across 360/0 (or 180/-180): between 359 and 1 stand numbers such as 240 and
120.

The numbers lie between those of two neighbours, but the heading between these goes the other way round, by a few
degrees only.
"""

from __future__ import annotations

import numpy as np

from .thresholds import THRESHOLDS

LEAP = THRESHOLDS.value("heading_leap")
"""Least ratio of a step of such a heading to the neighbouring and to the typical step: no ship turns so within one
sample."""
_Series = dict[str, tuple[np.ndarray, np.ndarray]]


def interpolated(psi: np.ndarray, turn: float = 2.0 * np.pi) -> list[tuple[int, int]]:
    """First and last samples of the stretches of psi (samples,) that were interpolated across the end of the scale;
    turn: a full turn.

    Such a stretch is a straight line: its steps are equal, but for the first and the last, where samples lie between
    the readings. It makes nearly a full turn and begins and ends at once. A ship that turns a circle continues as
    before, on either side of it.
    """
    equal = THRESHOLDS.value("straight_line")
    if len(psi) < 4:
        return []
    moved = np.remainder(np.diff(psi) + 0.5 * turn, turn) - 0.5 * turn
    size = np.abs(moved)
    usual = float(np.median(size[size > 0.0])) if np.any(size > 0.0) else np.inf
    leaps = np.concatenate([[0], (size > LEAP * usual).astype(int), [0]])
    found: set[tuple[int, int]] = set()
    for begin in (0.0, 0.5 * turn):
        number = np.remainder(psi + begin, turn)  # as it was recorded
        for way in (1.0, -1.0):
            rises = way * np.diff(number)
            edges = np.diff(leaps * np.concatenate([[0], rises > 0.0, [0]]))
            for a, b in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
                full = float(np.median(rises[a:b]))
                first = a - 1 if a > 0 and 0.0 < rises[a - 1] < full else a  # a small part of a step
                last = b + 1 if b < len(rises) and 0.0 < rises[b] < full else b
                inner, whole = rises[first + 1 : last - 1], abs(float(number[last] - number[first]))
                straight = last - first >= 2 and bool(np.all(np.abs(inner - full) < equal * full))
                beside = [
                    abs(s)
                    for s in (*moved[max(first - 1, 0) : first], *moved[last : last + 1])
                    if way * s > 0.0 or abs(s) <= LEAP * usual
                ]
                if straight and abs(whole - turn) < whole / LEAP and full > LEAP * max([usual, *beside]):
                    found.add((int(first) + 1, int(last) - 1))
    return sorted(found)


def fill_angle(values: np.ndarray, bad: np.ndarray, turn: float = 2.0 * np.pi) -> np.ndarray:
    """Angle (samples,), continuous over its good samples, with linear interpolation in place of the bad ones."""
    filled, good, at = values.copy(), ~bad, np.arange(len(values))
    filled[good] = np.unwrap(values[good], period=turn)
    filled[bad] = np.interp(at[bad], at[good], filled[good])
    return filled


def without_interpolated(series: _Series) -> tuple[_Series, int]:
    """Channels of a log (times and readings each) without such headings, and the number of these."""
    t, psi = series["psi"]
    keep = np.ones(len(psi), dtype=bool)
    for a, b in interpolated(psi):
        keep[a : b + 1] = False
    return series | {"psi": (t[keep], psi[keep])}, int(np.sum(~keep))
