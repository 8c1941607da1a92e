"""Frame and units of predicted trajectories against the measured runs that they match: what differs, by how much, and
the line that corrects it. Nothing is corrected here."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..effects.unit_or_sign_error import FACTORS
from ..predictors.predictions import Trajectory, size_text
from ..records import Run
from ..ship import Ship
from ..signals import COMMANDS, DELTA, PSI, STATES, N, R, U, V, wrap_angle
from .thresholds import THRESHOLDS

Pair = tuple[Trajectory, Run]


@dataclass(frozen=True)
class _Frame:
    """Frame of the earth: its name, its correction as a line, and the map of track (m, 2) [m] and heading (m,) into
    ours."""

    name: str
    line: str
    to_ours: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


_FRAMES = (
    _Frame(
        "angles in degrees",
        "psi = radians(psi)",
        lambda xy, psi: (xy, np.deg2rad(psi)),
    ),
    _Frame(
        "y to the left (west) and headings counterclockwise",
        "y = -y, psi = -psi, v = -v, r = -r",
        lambda xy, psi: (xy * [1.0, -1.0], -psi),
    ),
    _Frame(
        "y to the left (west) and headings counterclockwise in degrees",
        "y = -y, psi = -radians(psi), v = -v, r = -r",
        lambda xy, psi: (xy * [1.0, -1.0], -np.deg2rad(psi)),
    ),
    _Frame("north and east exchanged", "x, y = y, x", lambda xy, psi: (xy[:, ::-1], psi)),
    _Frame(
        "x to the east, y to the north, and headings counterclockwise from east",
        "x, y = y, x; psi = pi/2 - psi, v = -v, r = -r",
        lambda xy, psi: (xy[:, ::-1], math.pi / 2.0 - psi),
    ),
    _Frame(
        "x to the east, y to the north, and headings counterclockwise from east in degrees",
        "x, y = y, x; psi = pi/2 - radians(psi), v = -v, r = -r",
        lambda xy, psi: (xy[:, ::-1], math.pi / 2.0 - np.deg2rad(psi)),
    ),
)
"""Frames that programs use, beside ours."""


def prediction_notes(S: np.ndarray, runs: Sequence[Run], ship: Ship, dt: float) -> list[str]:
    """Notes as of `frame_notes` on states S (runs, K, 10) that a simulation predicted for the ends of `runs`."""
    steps = S.shape[1]
    pairs = [(Trajectory(float(run.t[-steps]), states), run) for run, states in zip(runs, S, strict=True)]
    return frame_notes(pairs, ship, dt, "the states that the simulation returns")


def frame_notes(pairs: Sequence[Pair], ship: Ship, dt: float, source: str = "the files") -> list[str]:
    """Notes on starts far from the measured ones: the size, the probable cause, and the line that corrects it in
    `source`."""
    seen = [begin for pair in pairs if (begin := _begin(pair, ship, dt)) is not None]
    if not seen:
        return []
    notes = []
    turned = np.array([abs(wrap_angle(b.psi[0] - b.true_psi[0])) for b in seen])
    place = np.array([np.hypot(*(b.xy[0] - b.true_xy[0])) for b in seen])
    other_heading = math.radians(THRESHOLDS.value("other_heading"))
    far = THRESHOLDS.value("other_place") * ship.L
    frame = _explaining(seen, ship)
    if np.median(turned) > other_heading or (frame is not None and np.median(place) > far):
        cause = (
            f"Probable cause: {frame.name}; correct {source} by {frame.line}."
            if frame is not None
            else "No usual frame explains it; check psi, x and y: rad clockwise from north, m north, m east."
        )
        notes.append(
            f"headings at the start differ by {size_text(math.degrees(float(np.median(turned))), 'deg')} (median over "
            f"{len(seen)} trajectories), positions by {size_text(float(np.median(place)), 'm')}. {cause}"
        )
    elif np.median(place) > far:
        notes.append(_origin_note(seen, place, ship, source))
    if frame is not None:
        return notes
    overlaps = [both for trajectory, run in pairs if len((both := _overlap(trajectory, run, dt))[0])]
    turns = turns_against([(mine[:, R], true[:, R]) for mine, true in overlaps], ship, dt)
    return [*notes, *(_unit_notes(pairs, ship, source) or turns)]


def _overlap(trajectory: Trajectory, run: Run, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Predicted and measured states (m, 10) at the time steps that both have."""
    offset = round((trajectory.start - float(run.t[0])) / dt)
    states, truth = trajectory.states[max(0, -offset) :], run.states[max(0, offset) :]
    m = min(len(states), len(truth))
    return states[:m], truth[:m]


def turns_against(rates: Sequence[tuple[np.ndarray, np.ndarray]], ship: Ship, dt: float) -> list[str]:
    """Note where simulated yaw rates change to the other side than the measured ones; both (m,) for each run."""
    steps = max(1, round(THRESHOLDS.value("turn_time") * math.sqrt(ship.L / 130.0) / dt))
    changes = [np.stack([r[steps:] - r[:-steps] for r in pair]) for pair in rates if len(pair[0]) > 2 * steps]
    mine, true = np.concatenate(changes, axis=1) if changes else np.zeros((2, 0))
    known = np.isfinite(mine) & np.isfinite(true)
    mine, true = mine[known], true[known]
    size = math.sqrt(float(mine @ mine) * float(true @ true))
    if size == 0.0 or (likeness := float(mine @ true) / size) > THRESHOLDS.value("against"):
        return []
    return [
        f"the simulated yaw rate changes to the other side than the measured one (correlation {likeness:.2f} of the "
        f"changes in {steps * dt:g} s). Probable cause: the sign of the rudder, whose positive angle turns the ship to "
        "starboard here; where the simulation counts to port, give it -delta_c."
    ]


@dataclass(frozen=True, eq=False)
class _Begin:
    """First seconds of a trajectory and of its run: tracks (m, 2) [m] and headings (m,) [rad]."""

    xy: np.ndarray
    psi: np.ndarray
    true_xy: np.ndarray
    true_psi: np.ndarray


def _begin(pair: Pair, ship: Ship, dt: float) -> _Begin | None:
    """Beginning of a trajectory beside the measured one; None where they do not overlap, or it is not finite."""
    steps = math.ceil(THRESHOLDS.value("frame_time") * math.sqrt(ship.L / 130.0) / dt)
    states, truth = (part[: steps + 1] for part in _overlap(*pair, dt))
    if not len(states) or not np.isfinite(states[:, : PSI + 1]).all():
        return None
    return _Begin(states[:, :PSI], states[:, PSI], truth[:, :PSI], truth[:, PSI])


def _explaining(seen: Sequence[_Begin], ship: Ship) -> _Frame | None:
    """Frame under which the beginnings agree with the measured ones much better than as they are, or None."""

    def error(to_ours: Callable[[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]) -> float:
        found = []
        for b in seen:
            xy, psi = to_ours(b.xy, b.psi)
            turned = abs(float(wrap_angle(psi[0] - b.true_psi[0])))
            way = np.hypot(*((xy[-1] - xy[0]) - (b.true_xy[-1] - b.true_xy[0])))
            made = max(float(np.hypot(*(b.true_xy[-1] - b.true_xy[0]))), 0.1 * ship.L)
            found.append(turned + min(float(way) / made, 2.0))
        return float(np.median(found))

    plain = error(lambda xy, psi: (xy, psi))
    errors = [error(frame.to_ours) for frame in _FRAMES]
    best = int(np.argmin(errors))
    explained = errors[best] <= THRESHOLDS.value("explained") * plain
    return _FRAMES[best] if explained and plain > math.radians(THRESHOLDS.value("other_heading")) / 2.0 else None


def _origin_note(seen: Sequence[_Begin], place: np.ndarray, ship: Ship, source: str) -> str:
    apart = np.array([b.xy[0] - b.true_xy[0] for b in seen])
    middle = np.median(apart, axis=0)
    size = f"positions at the start differ by {float(np.median(place)):.4g} m (median over {len(seen)} trajectories)."
    if np.median(np.hypot(*(apart - middle).T)) <= THRESHOLDS.value("explained") * np.median(place):
        north, east = -middle
        return f"{size} Probable cause: another origin; correct {source} by x = x {north:+.4g}, y = y {east:+.4g}."
    begun = [np.hypot(*b.xy[0]) - np.hypot(*(b.xy[:2] - b.xy[0]).T).max() for b in seen]  # or one step after it
    if np.median(begun) <= THRESHOLDS.value("start_position") * ship.L:
        return (
            f"{size} Probable cause: each trajectory starts at x = y = 0; correct {source} by adding the measured "
            "start, x = x + x_start, y = y + y_start."
        )
    return f"{size} No common origin explains it; check x and y, and the runs that the ids name."


def _unit_notes(pairs: Sequence[Pair], ship: Ship, source: str) -> list[str]:
    """Notes on speeds and actuators in another unit or with another sign, by their values at the start."""
    notes = []
    for column in (U, V, R, N, DELTA):
        name = STATES[column]
        values, truths = [], []
        for trajectory, run in pairs:
            k = round((trajectory.start - float(run.t[0])) / run.dt) if len(run) > 1 else 0
            if 0 <= k < len(run) and np.isfinite(trajectory.states[0, column]):
                values.append(trajectory.states[0, column])
                truths.append(run.states[k, column])
        mine, true = np.array(values), np.array(truths)
        size = float(np.sum(np.abs(true)))
        plain = float(np.sum(np.abs(mine - true)))
        if size == 0.0 or plain <= THRESHOLDS.value("other_unit") * size:
            continue
        if column in (U, V) and plain <= THRESHOLDS.value("start_speed") * math.sqrt(ship.L / 130.0) * len(true):
            continue  # noise of a small speed
        units = {"the other sign": -1.0} | FACTORS[name]
        left = {unit: float(np.sum(np.abs(mine / factor - true))) for unit, factor in units.items()}
        best = min(left, key=lambda unit: left[unit])
        spread = float(np.sum(np.abs(true - true.mean())))
        agrees = max(THRESHOLDS.value("explained") * size, THRESHOLDS.value("other_unit") * spread)
        if left[best] <= min(THRESHOLDS.value("explained") * plain, agrees):
            line = f"{name} = -{name}" if units[best] == -1.0 else f"{name} = {name} / {units[best]:.5g}"
            here, there = float(np.median(np.abs(mine))), float(np.median(np.abs(true)))
            notes.append(
                f"{name} at the start is {here:.3g} where {there:.3g} was measured (medians of the size). Probable "
                f"cause: {best}; correct {source} by {line}."
                + (f" Check whether it takes {name}_c alike." if f"{name}_c" in COMMANDS else "")
            )
    return notes
