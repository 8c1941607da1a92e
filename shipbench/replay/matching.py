"""Runs of predicted trajectories: by id, also in another spelling, by date and time of the start, or by the measured
state nearest to it."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from datetime import timedelta
from functools import cached_property

import numpy as np

from ..errors import InputError
from ..predictors.predictions import Trajectory, size_text
from ..records import Dataset, Run
from ..render.escaping import csv_text
from ..signals import PSI, R, U, V, X, Y, wrap_angle
from .reading import Track, Tracks, coarse
from .thresholds import THRESHOLDS

_PARTS = re.compile(r"\d+|[^\W\d_]+")
"""Words and numbers of an id."""
_WINDOW = re.compile(r"(?P<run>.+)@(?P<start>[-+.\de]+)s")
"""Id of a window: the run and the time of its start."""
_SHOWN = 8
"""Most ids that a message or note lists."""


@dataclass(frozen=True, eq=False)
class Match:
    """Track of a run; `shift` [s] is added to its time to give the time of the run. `note` says how it was matched, ""
    for the same id."""

    track: Track
    run: Run
    shift: float
    note: str = ""


def match_tracks(found: Tracks, data: Dataset, where: str) -> tuple[list[Match], list[str]]:
    """Matches of tracks with runs, and notes on those that match none. Time alone decides between runs where dates are
    given; the start state only where one stretch of one run fits.

    Raises:
        InputError: no track matches any run.
    """
    matches: list[Match] = []
    left: list[tuple[Track, str]] = []
    ids = {csv_text(run.id): run for run in data.runs} | {run.id: run for run in data.runs}
    nearest, spelled, numbered = _Nearest(data), _unique(data.runs, _spelling), _unique(data.runs, _numbers)
    for track in found.tracks:
        match = _by_id(track, ids, data.dt) or _by_date(track, data)
        if match is None and (run := spelled.get(_spelling(track.id))) is not None:
            match = _of_run(track, run, data.dt, f"{track.id} -> {run.id}, by its name in another spelling")
        if match is None and (run := numbered.get(_numbers(track.id))) is not None:
            match = nearest.agreeing(_of_run(track, run, data.dt, f"{track.id} -> {run.id}, by its number"))
        if match is None:
            match, why = nearest.match(track)
            if match is None:
                left.append((track, why))
        if match is not None:
            matches.append(match)
    if not matches:
        raise InputError(
            f"predictions {where}: no trajectory matches a run of '{data.name}'. Ids received: "
            f"{_listed([t.id for t in found.tracks])}. Accepted: {_listed([r.id for r in data.runs])}; or a start that "
            f"was measured. {left[0][0].id}: {left[0][1]}. Name the trajectories as the runs."
        )
    notes = _told(matches)
    if left:
        notes.append(
            f"{len(left)} of {len(found.tracks)} trajectories match no run and are left out: "
            + "; ".join(f"{track.id} ({why})" for track, why in left[:_SHOWN])
            + (f" and {len(left) - _SHOWN} more" if len(left) > _SHOWN else "")
        )
    return matches, notes


def _listed(ids: Sequence[str]) -> str:
    return ", ".join([*ids[:_SHOWN], *([f"and {len(ids) - _SHOWN} more"] if len(ids) > _SHOWN else [])])


def _told(matches: Sequence[Match]) -> list[str]:
    by_id = sum(not match.note for match in matches)
    notes = [f"{by_id} trajectories matched by run id"] if by_id else []
    others = [match.note for match in matches if match.note]
    more = [f"{len(others) - _SHOWN} more matched in the same way"] if len(others) > _SHOWN else []
    return [*notes, *others[:_SHOWN], *more]


def _by_id(track: Track, ids: dict[str, Run], dt: float) -> Match | None:
    """Match by the id of a run or of a window of it. Time may count from the start of the window, or of the run."""
    run, start = ids.get(track.id), 0.0
    if run is None and (window := _WINDOW.fullmatch(track.id)) is not None:
        run, start = ids.get(window["run"]), float(window["start"])
    if run is None:
        return None
    return _of_run(track, run, dt, "", start if track.id not in ids else None)


def _of_run(track: Track, run: Run, dt: float, note: str, start: float | None = None) -> Match:
    """Match whose time counts from the beginning `start` [s], that of the run by default, or from that of the run."""
    begin = float(run.t[0]) if start is None else start
    counted_anew = track.t[0] < begin - 0.5 * dt
    return Match(track, run, begin if counted_anew else 0.0, note)


def _spelling(name: str) -> tuple[str, ...]:
    """Words and numbers of an id, without case, separators and leading zeros: "Run 3" as "run03"."""
    return tuple(part.lstrip("0") or "0" for part in _PARTS.findall(name.lower()))


def _numbers(name: str) -> tuple[str, ...]:
    """Numbers of an id: ("3",) of "Test_03"."""
    return tuple(part for part in _spelling(name) if part.isdigit())


def _unique(runs: Sequence[Run], part: Callable[[str], tuple[str, ...]]) -> dict[tuple[str, ...], Run]:
    """Runs by a part of their ids that no other run has, and that is not empty."""
    counts = Counter(part(run.id) for run in runs)
    return {key: run for run in runs if counts[key := part(run.id)] == 1 and key}


def _by_date(track: Track, data: Dataset) -> Match | None:
    """Match by date and time, where one run alone lasts over the start of the track."""
    if track.began is None:
        return None
    start = track.began + timedelta(seconds=float(track.t[0]))
    fits = []
    for run in data.runs:
        if run.began is not None:
            at = (start - run.began).total_seconds() + float(run.t[0])
            if run.t[0] - 0.5 * data.dt <= at <= run.t[-1]:
                fits.append((run, at))
    if len(fits) != 1:
        return None
    run, at = fits[0]
    note = f"{track.id} -> {run.id} from t = {at:g} s, by date and time"
    return Match(track, run, at - float(track.t[0]), note)


class _Nearest:
    """Search for the measured sample nearest to a start state, over all runs."""

    def __init__(self, data: Dataset) -> None:
        self.data = data
        self.first = np.cumsum([0, *(len(run) for run in data.runs)])

    @cached_property
    def states(self) -> np.ndarray:
        """States of all runs, one below the other (samples, 10)."""
        return np.concatenate([run.states for run in self.data.runs])

    @cached_property
    def accelerations(self) -> np.ndarray:
        """Change of speed from each sample to the next (samples,) [m/s]."""
        return np.concatenate([_steps(np.hypot(run.states[:, U], run.states[:, V])) for run in self.data.runs])

    def at(self, place: int) -> tuple[Run, int]:
        """Run and sample of a row of `states`."""
        run = int(np.searchsorted(self.first, place, side="right")) - 1
        return self.data.runs[run], place - int(self.first[run])

    def agreeing(self, match: Match) -> Match | None:
        """Match by number, where heading and speed at the start are those measured in that run; else None. The place
        may differ: its origin may be another."""
        run, first = match.run, match.track.states[0]
        k = round((float(match.track.t[0]) + match.shift - float(run.t[0])) / self.data.dt)
        if not 0 <= k < len(run) or not np.isfinite(first[PSI : R + 1]).all():
            return None
        here = self.first[self.data.runs.index(run)] + k
        _, turned, faster = self.apart(first)
        if max(turned[here], faster[here]) > 1.0:
            return None
        return replace(match, note=f"{match.note}; heading and speed at the start agree")

    def apart(self, first: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Distance, heading and speed between a start state and every sample, each over its limit (samples,)."""
        s, L, dt = self.states, self.data.ship.L, self.data.dt
        speed = np.hypot(s[:, U], s[:, V])
        distance = np.hypot(s[:, X] - first[X], s[:, Y] - first[Y])
        faster = np.abs(speed - math.hypot(first[U], first[V]))
        turned = np.abs(wrap_angle(s[:, PSI] - first[PSI]))
        return (
            distance / (speed * dt + THRESHOLDS.value("start_position") * L),
            turned / (np.abs(s[:, R]) * dt + math.radians(THRESHOLDS.value("start_heading"))),
            faster / (self.accelerations + THRESHOLDS.value("start_speed") * math.sqrt(L / 130.0)),
        )

    def match(self, track: Track) -> tuple[Match | None, str]:
        """Match, or None and the reason."""
        first = track.states[0]
        if not np.isfinite(first[: R + 1]).all():
            return None, "its first state is not finite"
        apart = np.max(self.apart(first), axis=0)
        best = int(np.argmin(apart))
        run, k = self.at(best)
        far = math.hypot(run.states[k, X] - first[X], run.states[k, Y] - first[Y])
        turned = abs(float(wrap_angle(run.states[k, PSI] - first[PSI])))
        told = f"{size_text(far, 'm')}, {size_text(math.degrees(turned), 'deg')} off"
        if apart[best] > 1.0:
            return None, f"the nearest measured state, {run.id} at t = {run.t[k]:g} s, is {told}"
        places = np.flatnonzero(apart <= 1.0)
        runs = [self.at(int(i))[0].id for i in places]
        near = THRESHOLDS.value("frame_time") * math.sqrt(self.data.ship.L / 130.0)
        if len(set(runs)) > 1 or np.abs(places - best).max() * self.data.dt > near:
            return None, f"its start fits several places: {_listed(list(dict.fromkeys(runs)))}"
        note = f"{track.id} -> {run.id} from t = {run.t[k]:g} s, by start state: {told}"
        return Match(track, run, float(run.t[k] - track.t[0]), note), ""


def _steps(values: np.ndarray) -> np.ndarray:
    """Change of a signal to the next sample, or from the last one."""
    return np.abs(np.diff(values, append=values[-1:])) if len(values) > 1 else np.zeros(len(values))


def on_grid(match: Match, data: Dataset, where: str) -> tuple[Trajectory, bool]:
    """Trajectory at the samples of its run, and whether it was interpolated.

    Raises:
        InputError: it has fewer samples than the data set, or a gap.
    """
    track, dt = match.track, data.dt
    steps = np.diff(track.t)
    if (usual := float(np.median(steps))) > dt * (1.0 + 1e-3):
        raise coarse(where, f"trajectory '{track.id}'", usual, data)
    if (steps > dt * (1.0 + 1e-3)).any():
        k = int(np.argmax(steps))
        raise InputError(
            f"predictions {where}: trajectory '{track.id}' has a gap, from t = {track.t[k]:g} s to {track.t[k + 1]:g} "
            f"s. Accepted: steps of at most {dt:g} s, as in the data set. Write it without a gap, or as two."
        )
    zero, t = float(match.run.t[0]), track.t + match.shift
    first, last = math.ceil((t[0] - zero) / dt - 1e-3), math.floor((t[-1] - zero) / dt + 1e-3)
    grid = zero + dt * np.arange(first, last + 1)
    if len(grid) == len(t) and (np.abs(grid - t) <= 1e-3 * dt).all():
        return Trajectory(float(grid[0]) if len(grid) else zero, track.states), False
    states = np.column_stack([np.interp(grid, t, values) for values in track.states.T])
    return Trajectory(float(grid[0]) if len(grid) else zero, states), True
