"""Comparison of position with integrated speed, and explanations of their difference. The findings are in
`track_findings`.

Over windows of `track_window` the displacement is compared with the integral of surge and sway along the heading.
Explanations are chosen one after another by the share of the difference that each explains.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from ..signals import PSI, U, V, X, Y
from .recording import Recording
from .selection import Chosen, select
from .statistics import clustered_fit, clusters
from .thresholds import THRESHOLDS

LAGS = {"lag of u, v": (U, V), "lag of position": (X, Y), "lag of heading": (PSI,)}
_SCALES = frozenset({"scale of u and v", "scale of u", "scale of v"})
_LATE = frozenset({"lag of u, v", "lag of position"})
_OVER_GROUND = ("scale of u and v", "lag of position", "off midship")
"""Errors that velocities over ground can have. Once psi rotated them, neither psi nor one axis shows in the track."""


@dataclass(frozen=True)
class Windows:
    """Complex earth-fixed quantities (W,), north + i east, of windows; run (W,): index of the run. span: their length
    [s]."""

    run: np.ndarray
    span: float
    moved: np.ndarray
    surge: np.ndarray
    sway: np.ndarray
    turned: np.ndarray
    velocity_change: np.ndarray
    way_change: np.ndarray


def shifted(recording: Recording, late: dict[int, float]) -> list[tuple[int, np.ndarray]]:
    """Runs as (index, states) with the channels in `late` shifted back by so many seconds; the open ends are cut off.

    The pieces of one run share the index of the first.
    """
    dt, found = recording.dt, []
    first: dict[str, int] = {}
    edge = int(np.ceil(max((abs(lag) for lag in late.values()), default=0.0) / dt - 1e-9))
    for i, run in enumerate(recording.runs):
        S, t = run.states, np.arange(len(run)) * dt
        if late:
            S = S.copy()
            for channel, lag in late.items():
                S[:, channel] = np.interp(t + lag, t, S[:, channel])
        S = S[edge : len(S) - edge]
        if len(S) >= 2:
            found.append((first.setdefault(recording.name_of(run), i), S))
    return found


def windows(recording: Recording, late: dict[int, float]) -> Windows | None:
    """Windows of the data set, each half over the next, or None where there are fewer than 12."""
    width = max(3, round(THRESHOLDS.value("window") * recording.froude / recording.dt))
    pieces = [
        (i, S[a : a + width + 1]) for i, S in shifted(recording, late) for a in range(0, len(S) - width, width // 2)
    ]
    if len(pieces) < THRESHOLDS.count("windows"):
        return None
    S, dt = np.stack([p for _, p in pieces]), recording.dt
    e, z = np.exp(1j * S[..., PSI]), S[..., X] + 1j * S[..., Y]
    own = S[..., U] + 1j * S[..., V]
    return Windows(
        run=np.array([i for i, _ in pieces]), span=width * dt, moved=z[:, -1] - z[:, 0],
        surge=np.trapezoid(S[..., U] * e, dx=dt, axis=1), sway=1j * np.trapezoid(S[..., V] * e, dx=dt, axis=1),
        turned=e[:, -1] - e[:, 0],
        velocity_change=np.sum(np.diff(own, axis=1) * 0.5 * (e[:, 1:] + e[:, :-1]), axis=1),
        way_change=(own * e)[:, -1] - (own * e)[:, 0],
    )  # fmt: skip


def _real(*columns: np.ndarray) -> np.ndarray:
    """Columns (2 W, P): north parts, then east parts."""
    stacked = np.column_stack(columns)
    return np.concatenate([stacked.real, stacked.imag])


def explain_windows(w: Windows, turned: bool, only: Collection[str] | None = None) -> Chosen:
    """Choose explanations of the windows; only: names of those that are tried (None: all)."""
    way, one = w.surge + w.sway, np.full(len(w.run), w.span, dtype=complex)
    groups = {
        "scale of u and v": _real(way), "scale of u": _real(w.surge), "scale of v": _real(w.sway),
        "heading reference": _real(1j * way),
        "through water": _real(one, 1j * one), "lag of u, v": _real(w.velocity_change),
        "lag of position": _real(-w.way_change),
        "lag of heading": _real(w.way_change - w.velocity_change), "off midship": _real(w.turned, 1j * w.turned),
    }  # fmt: skip
    groups = {
        name: g for name, g in groups.items() if (not turned or name in _OVER_GROUND) and (only is None or name in only)
    }
    return select(
        _real(w.moved - way)[:, 0], groups, np.zeros((2 * len(w.run), 0)), w.run, 2,
        float(np.sqrt(np.mean(np.abs(w.moved) ** 2) / 2.0)) + 1e-9,
        exclusive=(frozenset({"scale of u and v", "scale of u"}), _LATE),
    )  # fmt: skip


@dataclass(frozen=True)
class Explained:
    """Windows as recorded (`plain`) and with the lags corrected (`corrected`), the explanations chosen on each, and lag
    [s] by channel."""

    plain: Windows
    corrected: Windows
    first: Chosen
    chosen: Chosen
    late: dict[int, float]


def explain(recording: Recording) -> Explained | None:
    """Explanations of the track beside heading and speeds; None where the ship hardly moves or records are short."""
    late: dict[int, float] = {}
    w = plain = windows(recording, late)
    least = THRESHOLDS.value("least_distance") * recording.dataset.ship.L
    if w is None or plain is None or np.sqrt(np.mean(np.abs(w.moved) ** 2)) < least:
        return None
    first = chosen = explain_windows(w, recording.turned)
    for _ in range(
        8
        # a lag is linear for small ones only; one at a time, so that the error of a great one is not put down to
        # another
    ):
        moves = [name for name in chosen.names if name in LAGS and abs(chosen.value[name][0]) > 0.02 * recording.dt]
        if not moves:
            break
        for channel in LAGS[moves[0]]:
            late[channel] = late.get(channel, 0.0) + float(chosen.value[moves[0]][0])
        again = windows(recording, late)
        if again is None:
            break
        w, chosen = again, explain_windows(again, recording.turned)
    return Explained(
        plain, w, first, replace(chosen, left=first.left | {"all chosen": chosen.left["all chosen"]}), late
    )


def late_velocities(recording: Recording) -> tuple[float, float] | None:
    """Time [s] by which the velocities, as a vector in the earth's axes, lag the position, with its standard error;
    None if they do not."""
    found = explain(recording)
    if found is None or "lag of position" not in found.first.sd:
        return None
    lag = -found.late.get(X, 0.0)
    return (lag, float(found.first.sd["lag of position"][0])) if lag >= least_lag(recording) else None


def lags(recording: Recording) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Time [s] by which the velocities in the ship's axes, and the position, lag the other, each with its standard
    error over the runs.

    Scale of the speed, reference of the heading and place of the antenna are free. None where there are too few
    windows.
    """
    w = windows(recording, {})
    if w is None:
        return None
    way, cluster = w.surge + w.sway, np.tile(clusters(w.run), 2)
    off, others = _real(w.moved - way)[:, 0], (way, 1j * way, w.turned, 1j * w.turned)
    own, position = (
        clustered_fit(off, _real(column, *others), cluster) for column in (w.velocity_change, -w.way_change)
    )
    return (float(own.value[0]), float(own.sd[0])), (float(position.value[0]), float(position.sd[0]))


def keeps_time(recording: Recording) -> bool:
    """Whether the track shows that neither the velocities nor the position lag the other."""
    found, least = lags(recording), THRESHOLDS.value("least_lag") * recording.froude
    return found is not None and all(may_be_none(f) and abs(f[0]) + 2.0 * f[1] < least for f in found)


def may_be_none(lag: tuple[float, float]) -> bool:
    """Whether a lag is zero within its standard error."""
    return abs(lag[0]) < THRESHOLDS.value("within_error") * lag[1]


def through_water(recording: Recording) -> tuple[float, float] | None:
    """Velocity [m/s] north and east of the water, where the recorded velocities are through water, the same in all
    runs; None if they are over ground."""
    found = explain(recording)
    if found is None or "through water" not in found.chosen.names:
        return None
    (north, east), sd = found.chosen.value["through water"], found.chosen.sd["through water"]
    doubt = THRESHOLDS.value("beyond_noise") * float(np.hypot(*sd))
    sure = max(THRESHOLDS.value("least_share") * recording.speed, doubt)
    return (float(north), float(east)) if np.hypot(north, east) > sure else None


def least_lag(recording: Recording) -> float:
    """Smallest lag [s] of a channel that is reported."""
    return max(0.25 * recording.dt, THRESHOLDS.value("least_lag") * recording.froude)


def possible_scale(factor: float) -> bool:
    """Whether a sensor may have this scale factor: beyond twice and half it is another unit, sign or channel."""
    return 0.5 < factor < 2.0
