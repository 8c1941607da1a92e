"""Headings that somebody interpolated linearly across 360/0 (or 180/-180): between 359 and 1 stand numbers such as 240 and 120.

The numbers lie between those of two neighbours, but the heading between these goes the other way round, by a few degrees only.
"""

from __future__ import annotations

import numpy as np

LEAP = 10.0
"""Times the steps beside it, and the usual step, that a step of such a heading has at least: no ship turns so, then not, within a sample."""
_Series = dict[str, tuple[np.ndarray, np.ndarray]]


def interpolated(psi: np.ndarray, turn: float = 2.0 * np.pi) -> list[tuple[int, int]]:
    """First and last samples of the stretches of psi (samples,) that were interpolated across the end of the scale; turn: a whole turn."""
    if len(psi) < 4:
        return []
    size = np.abs(np.remainder(np.diff(psi) + 0.5 * turn, turn) - 0.5 * turn)
    usual = float(np.median(size[size > 0.0])) if np.any(size > 0.0) else np.inf
    leaps = np.concatenate([[0], (size > LEAP * usual).astype(int), [0]])
    found: set[tuple[int, int]] = set()
    for begin in (0.0, 0.5 * turn):
        number = np.remainder(psi + begin, turn)  # as it was recorded
        for way in (1.0, -1.0):
            edges = np.diff(leaps * np.concatenate([[0], way * np.diff(number) > 0.0, [0]]))
            for a, b in zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1), strict=True):
                step = abs(float(number[b] - number[a])) / (b - a)
                beside = max([usual, *(s for s in (*size[max(a - 1, 0) : a], *size[b : b + 1]) if s <= LEAP * usual)])  # not a way back
                if b - a >= 2 and abs(step - turn / (b - a)) < step / LEAP and step > LEAP * beside:
                    found.add((int(a) + 1, int(b) - 1))
    return sorted(found)


def fill_angle(values: np.ndarray, bad: np.ndarray, turn: float = 2.0 * np.pi) -> np.ndarray:
    """An angle (samples,), continuous over its good samples, with straight lines in place of the bad ones."""
    filled, good, at = values.copy(), ~bad, np.arange(len(values))
    filled[good] = np.unwrap(values[good], period=turn)
    filled[bad] = np.interp(at[bad], at[good], filled[good])
    return filled


def without_interpolated(series: _Series) -> tuple[_Series, int]:
    """The channels of a log (times and readings each) without headings that were interpolated so, and the number of these."""
    t, psi = series["psi"]
    keep = np.ones(len(psi), dtype=bool)
    for a, b in interpolated(psi):
        keep[a : b + 1] = False
    return series | {"psi": (t[keep], psi[keep])}, int(np.sum(~keep))
