"""Indices of standard manoeuvres (IMO MSC.137(76), ITTC): advance, transfer, tactical diameter of turns, overshoot
angles of zig-zags.

They are computed for any track that begins on a straight course under recorded commands. In a rollout the commands are
the true ship's, also for the model: its rudder is reversed when the true one was, so its overshoot is counted from its
own heading at that moment.
"""

from __future__ import annotations

import numpy as np

from ..signals import PSI, R, U, V, X, Y
from .base import Column, Metric

DELTA_C = 1
"""Column of the rudder command in U."""
SMALLEST = np.deg2rad(5.0)
"""Smallest rudder angle [rad] of a manoeuvre; below it is course keeping."""
STEADY = 0.1
"""Largest |r| L / speed of a straight course; hard turns have 0.5 to 1."""
NEAR, SHARE = 0.1, 0.9
"""Tolerance of the manoeuvre's angle, 10 %, and least share of samples within it, 90 %; in the rest the rudder moves to
the other side."""

NAMES = ("advance", "transfer", "tactical_diameter", "overshoot_1", "overshoot_2")
_LABELS = ("advance", "transfer", "tactical diameter", "first overshoot", "second overshoot")
_UNITS = ("L", "L", "L", "rad", "rad")


def turning_indices(path: np.ndarray, L: float) -> tuple[float, float, float]:
    """Advance and transfer (at 90 degrees of heading change) and tactical diameter (at 180) in ship lengths; NaN where
    not reached.

    path: (samples, 10) states from the moment the rudder is put over; advance is along the course there, transfer
    perpendicular to it.
    """
    course = path[0, PSI]
    east, north = path[:, Y] - path[0, Y], path[:, X] - path[0, X]
    ahead, aside = north * np.cos(course) + east * np.sin(course), east * np.cos(course) - north * np.sin(course)
    turned = np.maximum.accumulate(np.abs(path[:, PSI] - course))

    def at(angle: float, values: np.ndarray) -> float:
        return float(np.interp(angle, turned, values)) / L if turned[-1] > angle else float("nan")

    return at(np.pi / 2, ahead), abs(at(np.pi / 2, aside)), abs(at(np.pi, aside))


def overshoots(psi: np.ndarray, reversals: np.ndarray, side: float) -> tuple[float, float]:
    """First and second overshoot angle [rad]: how far the heading goes on after the first and the second reversal of
    the rudder.

    psi: (samples,) heading [rad]. reversals: samples at which the rudder order changes side. side: +1 if the first
    order was to starboard. Not-a-number where the heading does not come back before the next reversal or the end.
    """
    found = [float("nan")] * 2
    for i, start in enumerate(reversals[:2]):
        end = reversals[i + 1] if len(reversals) > i + 1 else len(psi) - 1
        beyond = side * (-1) ** i * (psi[start : end + 1] - psi[start])
        peak = int(np.argmax(beyond))
        if peak < end - start:
            found[i] = float(beyond[peak])
    return found[0], found[1]


def _orders(start: np.ndarray, path: np.ndarray, orders: np.ndarray, L: float) -> tuple[int, np.ndarray] | None:
    """Sample at which the rudder is put over from a straight course, and those at which it is reversed; None for any
    other commands."""
    angle = float(np.max(np.abs(orders)))
    if angle < SMALLEST:
        return None
    reached = int(np.argmax(np.abs(orders) >= (1.0 - NEAR) * angle))
    small = np.flatnonzero(
        np.abs(orders[:reached]) <= 0.5 * angle
    )  # course keeping, until the rudder leaves for its angle
    begin = int(small[-1]) + 1 if len(small) else 0
    before = start if begin == 0 else path[begin - 1]
    speed = float(np.hypot(before[U], before[V]))
    straight = speed > 0 and abs(before[R]) * L / speed < STEADY and np.all(np.abs(orders[:begin]) <= 0.5 * angle)
    held = np.mean(np.abs(orders[begin:]) >= (1.0 - NEAR) * angle) >= SHARE
    return (begin, begin + 1 + np.flatnonzero(np.diff(np.sign(orders[begin:])) != 0)) if straight and held else None


def trial_indices(*, s0: np.ndarray, states: np.ndarray, true: np.ndarray, U: np.ndarray, L: float) -> np.ndarray:
    """Indices `NAMES` of each run, (batch, 5) in ship lengths and rad; NaN where the commands are no such manoeuvre or
    the track does not get there.

    A turn: from a straight course the rudder goes to one angle and stays. A zig-zag: it goes to one angle, then to and
    fro between that angle on both sides. s0 (batch, 10), states and true (batch, K, 10), U (batch, K, inputs). The
    manoeuvre and its beginning follow from the commands and the true track, so that they are the same for every model.
    """
    found = np.full((len(states), len(NAMES)), np.nan)
    for i, (start, path, truth, orders) in enumerate(zip(s0, states, true, U[..., DELTA_C], strict=True)):
        manoeuvre = _orders(start, truth, orders, L)
        if manoeuvre is None:
            continue
        begin, reversals = manoeuvre
        track = np.concatenate([start[None], path])[begin:]
        if len(reversals):
            found[i, 3:] = overshoots(track[:, PSI], reversals - begin, float(np.sign(orders[begin])))
        else:
            found[i, :3] = turning_indices(track, L)
    return found


def trial_index_errors(*, true: np.ndarray, pred: np.ndarray, s0: np.ndarray, U: np.ndarray, L: float) -> np.ndarray:
    """Predicted less true indices, (batch, 5)."""
    return trial_indices(s0=s0, states=pred, true=true, U=U, L=L) - trial_indices(
        s0=s0, states=true, true=true, U=U, L=L
    )


COLUMNS = tuple(Column(f"{n}_error", label, unit) for n, label, unit in zip(NAMES, _LABELS, _UNITS, strict=True))
METRIC = Metric(trial_index_errors, COLUMNS, per_knot=False)
