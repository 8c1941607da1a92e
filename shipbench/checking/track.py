"""Position against integrated speed: scale, lag, heading's reference, velocities through water.

Over windows of 30 s (at 130 m, Froude-scaled) the way made good is compared with the integral of surge and sway along the heading.
Explanations are chosen one after another by how much of the difference each takes away.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..data.units import LENGTHS
from ..signals import PSI, U, V, X, Y
from .finding import Curve, Finding, Picture, Severity, toml_line
from .recording import Recording
from .selection import Chosen, select
from .statistics import clustered_fit, clusters

WINDOW = 30.0
"""Seconds at 130 m."""
LEAST_ARM = 0.02
"""Share of the ship's length."""
LEAST_SCALE, LEAST_SWAY_SCALE, LEAST_HEADING, LEAST_CURRENT, LEAST_LAG = 0.02, 0.15, np.deg2rad(1.0), 0.03, 0.8
"""What matters at all: shares, rad, share of the speed, s at 130 m (and a quarter of a sample)."""
_SURE, _SMALL = 6.0, 3.0
"""Standard errors from which a drift is taken out unasked, and below which a lag may be none."""
_NO_LAG = 0.7
"""Seconds at 130 m, which the track must rule out by two standard errors where no lag is to be looked for by other means."""
_LAGS = {"lag of u, v": (U, V), "lag of position": (X, Y), "lag of heading": (PSI,)}
_SCALES = frozenset({"scale of u and v", "scale of u", "scale of v"})
_LATE = frozenset({"lag of u, v", "lag of position"})


@dataclass(frozen=True)
class Windows:
    """Complex earth-fixed quantities (W,), north + i east, of windows; run (W,): index of the run. span: their length [s]."""

    run: np.ndarray
    span: float
    moved: np.ndarray
    surge: np.ndarray
    sway: np.ndarray
    turned: np.ndarray
    velocity_change: np.ndarray
    way_change: np.ndarray


def shifted(recording: Recording, late: dict[int, float]) -> list[tuple[int, np.ndarray]]:
    """(index, states) of every run with the channels in `late` put back by so many seconds; the ends that this leaves open are cut off.

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
    """All windows of the data set, each half over the next, or None where there are fewer than 12."""
    width = max(3, round(WINDOW * recording.froude / recording.dt))
    pieces = [(i, S[a : a + width + 1]) for i, S in shifted(recording, late) for a in range(0, len(S) - width, width // 2)]
    if len(pieces) < 12:
        return None
    S, dt = np.stack([p for _, p in pieces]), recording.dt
    e, z = np.exp(1j * S[..., PSI]), S[..., X] + 1j * S[..., Y]
    own = S[..., U] + 1j * S[..., V]
    return Windows(
        run=np.array([i for i, _ in pieces]), span=width * dt, moved=z[:, -1] - z[:, 0],
        surge=np.trapezoid(S[..., U] * e, dx=dt, axis=1), sway=1j * np.trapezoid(S[..., V] * e, dx=dt, axis=1), turned=e[:, -1] - e[:, 0],
        velocity_change=np.sum(np.diff(own, axis=1) * 0.5 * (e[:, 1:] + e[:, :-1]), axis=1), way_change=(own * e)[:, -1] - (own * e)[:, 0],
    )  # fmt: skip


def _real(*columns: np.ndarray) -> np.ndarray:
    """Columns (2 W, P): north parts, then east parts."""
    stacked = np.column_stack(columns)
    return np.concatenate([stacked.real, stacked.imag])


def _explain(w: Windows) -> Chosen:
    way, one = w.surge + w.sway, np.full(len(w.run), w.span, dtype=complex)
    groups = {
        "scale of u and v": _real(way), "scale of u": _real(w.surge), "scale of v": _real(w.sway), "heading reference": _real(1j * way),
        "through water": _real(one, 1j * one), "lag of u, v": _real(w.velocity_change), "lag of position": _real(-w.way_change),
        "lag of heading": _real(w.way_change - w.velocity_change), "off midship": _real(w.turned, 1j * w.turned),
    }  # fmt: skip
    return select(
        _real(w.moved - way)[:, 0], groups, np.zeros((2 * len(w.run), 0)), w.run, 2, float(np.sqrt(np.mean(np.abs(w.moved) ** 2) / 2.0)) + 1e-9,
        exclusive=(frozenset({"scale of u and v", "scale of u"}), _LATE),
    )  # fmt: skip


@dataclass(frozen=True)
class Explained:
    """The windows as recorded (`plain`) and with the lags put back (`mended`), what was chosen on each, and seconds of lag by channel."""

    plain: Windows
    mended: Windows
    first: Chosen
    chosen: Chosen
    late: dict[int, float]


def explain(recording: Recording) -> Explained | None:
    """What the track needs beside heading and speeds; None where the ship hardly moves or too little is recorded."""
    late: dict[int, float] = {}
    w = plain = windows(recording, late)
    if w is None or plain is None or np.sqrt(np.mean(np.abs(w.moved) ** 2)) < 0.02 * recording.dataset.ship.L:
        return None
    first = chosen = _explain(w)
    for _ in range(8):  # a lag is linear for small ones only; one at a time, so that the error of a great one is not put down to another
        moves = [name for name in chosen.names if name in _LAGS and abs(chosen.value[name][0]) > 0.02 * recording.dt]
        if not moves:
            break
        for channel in _LAGS[moves[0]]:
            late[channel] = late.get(channel, 0.0) + float(chosen.value[moves[0]][0])
        again = windows(recording, late)
        if again is None:
            break
        w, chosen = again, _explain(again)
    return Explained(plain, w, first, replace(chosen, left=first.left | {"all chosen": chosen.left["all chosen"]}), late)


def late_velocities(recording: Recording) -> tuple[float, float] | None:
    """Seconds by which the velocities, as a vector in the earth's axes, are late against the position, with their standard error; None if not."""
    found = explain(recording)
    if found is None or "lag of position" not in found.first.sd:
        return None
    lag = -found.late.get(X, 0.0)
    return (lag, float(found.first.sd["lag of position"][0])) if lag >= least_lag(recording) else None


def lags(recording: Recording) -> tuple[tuple[float, float], tuple[float, float]] | None:
    """Seconds by which the velocities in the ship's axes, and the position, are late against the other, each with its standard error over the runs,
    whatever the speed's scale, the heading's reference and the antenna's place; None where there are too few windows."""
    w = windows(recording, {})
    if w is None:
        return None
    way, cluster = w.surge + w.sway, np.tile(clusters(w.run), 2)
    off, others = _real(w.moved - way)[:, 0], (way, 1j * way, w.turned, 1j * w.turned)
    own, position = (clustered_fit(off, _real(column, *others), cluster) for column in (w.velocity_change, -w.way_change))
    return (float(own.value[0]), float(own.sd[0])), (float(position.value[0]), float(position.sd[0]))


def keeps_time(recording: Recording) -> bool:
    """Whether the track shows that neither the velocities nor the position are late against the other."""
    found = lags(recording)
    return found is not None and all(may_be_none(f) and abs(f[0]) + 2.0 * f[1] < _NO_LAG * recording.froude for f in found)


def may_be_none(lag: tuple[float, float]) -> bool:
    """Whether a lag and its standard error are no lag."""
    return abs(lag[0]) < _SMALL * lag[1]


def through_water(recording: Recording) -> tuple[float, float] | None:
    """Velocity [m/s] north and east of the water that the velocities are through, the same in all runs; None if they are over ground."""
    found = explain(recording)
    if found is None or "through water" not in found.chosen.names:
        return None
    (north, east), sd = found.chosen.value["through water"], found.chosen.sd["through water"]
    sure = max(LEAST_CURRENT * recording.speed, _SURE * float(np.hypot(*sd)))
    return (float(north), float(east)) if np.hypot(north, east) > sure else None


def least_lag(recording: Recording) -> float:
    """Seconds below which a lag of a channel is not told."""
    return max(0.25 * recording.dt, LEAST_LAG * recording.froude)


def check(recording: Recording) -> list[Finding]:
    """Findings of the track; none where the ship hardly moves."""
    x = explain(recording)
    if x is None:
        return []
    found = _lag_findings(recording, x.plain, x.chosen, x.first, x.late)
    return found + [f for name in x.chosen.names if name not in _LAGS for f in _finding(recording, x.mended, x.chosen, name)]


def _lag_findings(recording: Recording, w: Windows, chosen: Chosen, first: Chosen, late: dict[int, float]) -> list[Finding]:
    """Sensors are late, not early: a position ahead of heading and speeds together is a velocity vector that is late in earth axes."""
    vector = "the position, as a vector in earth axes (a filter there, before the turn into the ship's axes),"
    words = {
        ("lag of u, v", True): (("u", "v"), "the position", ("u", "v")), ("lag of u, v", False): (("x", "y"), "u, v", ("x", "y")),
        ("lag of position", True): (("x", "y"), "heading and speeds", ("x", "y")),
        ("lag of position", False): (("u", "v"), vector, ("velocity",)),
        ("lag of heading", True): (("psi",), "position and speeds", ("psi",)),
        ("lag of heading", False): (("x", "y"), "the heading", ("x", "y")),
    }  # fmt: skip
    found = []
    for name, channels in _LAGS.items():
        lag = late.get(channels[0], 0.0)
        if abs(lag) < least_lag(recording) or name not in first.sd:
            continue
        names, others, keys = words[name, lag > 0.0]
        lag, sd = abs(lag), float(first.sd[name][0])
        text = (
            f"{', '.join(names)} lag {others} by {lag:.2g} s (standard error {sd:.1g} s): the track departs from heading and speeds by "
            f"{first.left['plain']:.1%} of its length as recorded, by {chosen.left['all chosen']:.1%} with it."
        )
        if keys == ("velocity",):
            text += f" Moved along the ship's axes instead they leave {first.left['lag of u, v']:.1%}."
        column = w.velocity_change if name == "lag of u, v" else w.way_change
        found.append(Finding(
            "track", "warning", "lag", text, toml_line({"delay": dict.fromkeys(keys, round(lag, 3))}), channels=names,
            evidence={"lag_s": lag, "sd_s": sd, "left_plain": first.left["plain"], "left": chosen.left["all chosen"]},
            picture=_picture(w, f"{', '.join(names)} late by {lag:.2g} s", column, "change of velocity in the window [m/s]"),
        ))  # fmt: skip
    return found


def _finding(recording: Recording, w: Windows, chosen: Chosen, name: str) -> list[Finding]:
    value, sd, left = chosen.value[name], chosen.sd[name], chosen.left
    shares = (
        f"the track departs from heading and speeds by {left['plain']:.1%} of its length as recorded, "
        f"{left['through water']:.1%} with a current, {left['scale of u and v']:.1%} with a scale, {left['all chosen']:.1%} with all that is reported"
    )
    evidence: dict[str, Any] = {f"left_{k.replace(' ', '_')}": v for k, v in left.items()}
    if name == "through water":
        return _through_water(recording, w, chosen, shares, evidence)
    if name == "off midship":
        ahead, abeam = map(float, value)
        if np.hypot(ahead, abeam) < LEAST_ARM * recording.dataset.ship.L:
            return []
        text = (
            f"x, y are of a point {ahead:+.3g} m ahead (standard error {sd[0]:.2g}), {abeam:+.3g} m to starboard ({sd[1]:.2g}) of where u, v are: "
            f"{shares}."
        )
        return [Finding(
            "track", "warning", "off midship", text, toml_line({"antenna": [ahead, abeam]}), channels=("x", "y"),
            evidence={"ahead_m": ahead, "starboard_m": abeam, **evidence},
            picture=_picture(w, "Way not explained", w.turned, "change of the bow's direction"),
        )]  # fmt: skip
    if name == "heading reference":
        angle = float(value[0])
        if abs(angle) < LEAST_HEADING:
            return []
        text = (
            f"the heading reads {np.rad2deg(-angle):+.2f} deg (standard error {np.rad2deg(sd[0]):.2f}) off the track with drift taken off: {shares}."
        )
        return [Finding(
            "track", "warning", "heading bias", text, toml_line({"bias": {"psi": round(-angle, 5)}}), channels=("psi",),
            evidence={"angle_rad": -angle, "sd_rad": sd[0], **evidence},
            picture=_picture(w, "Way not explained, across the way made", 1j * (w.surge + w.sway), "way by heading and speeds, turned [m]"),
        )]  # fmt: skip
    factor = 1.0 / (1.0 + float(value[0]))
    channels = {"scale of u and v": ("u", "v"), "scale of u": ("u",), "scale of v": ("v",)}[name]
    if name == "scale of v" and factor < -0.5:
        positive = "starboard" if recording.given.get("signs", {}).get("v") == "port" else "port"
        text = f"v is recorded with the other sign: {factor:.3f} of what the position says (standard error {sd[0]:.3f}): {shares}."
        line = toml_line({"signs": {"v": positive}})
        figures = {"factor": factor, "sd": sd[0], **evidence}
        return [Finding("track", "error", "sign", text, line, channels=channels, evidence=figures, picture=_sway_picture(w))]
    if abs(factor - 1.0) < (LEAST_SWAY_SCALE if name == "scale of v" else LEAST_SCALE):
        return []
    gross = next((unit for unit, size in LENGTHS.items() if unit != "m" and abs(factor / size - 1.0) < 0.03), None)
    if gross and name != "scale of v":
        text = f"x, y change {1.0 / factor:.4g} times as much as the integrated speeds, as lengths in {gross} do: {shares}."
        line = toml_line({"units": {"x": gross, "y": gross}})
        return [
            Finding("track", "error", "unit", text, line, channels=("x", "y"), evidence={"factor": factor, **evidence}, picture=_scale_picture(w))
        ]
    text = f"{' and '.join(channels)} read {factor:.3f} of what the position says (standard error {sd[0]:.3f}): {shares}."
    severity: Severity = "error" if abs(factor - 1.0) > 0.1 and name != "scale of v" else "warning"
    return [Finding(
        "track", severity, "scale", text, toml_line({"scale": dict.fromkeys(channels, round(factor, 4))}), channels=channels,
        evidence={"factor": factor, "sd": sd[0], **evidence}, picture=_scale_picture(w),
        todo="If the speeds are right, the positions have the inverse scale: write [scale] x and y instead.",
    )]  # fmt: skip


def _through_water(recording: Recording, w: Windows, chosen: Chosen, shares: str, evidence: dict[str, Any]) -> list[Finding]:
    north, east = chosen.value["through water"]
    speed = float(np.hypot(north, east))
    if speed < LEAST_CURRENT * recording.speed:
        return []
    towards = float(np.rad2deg(np.arctan2(east, north)) % 360.0)
    left, own = w.moved - w.surge - w.sway, {}
    for i in np.unique(w.run):
        mine = left[w.run == i]
        if len(mine) >= 3:
            own[recording.name_of(recording.runs[i])] = np.median(mine.real) / w.span + 1j * np.median(mine.imag) / w.span
    scatter = float(np.sqrt(np.mean(np.abs(np.array(list(own.values())) - (north + 1j * east)) ** 2))) if own else 0.0
    text = (
        f"u, v are through water, not over ground: the ship drifts {speed:.3g} m/s (standard errors {chosen.sd['through water'][0]:.2g}, "
        f"{chosen.sd['through water'][1]:.2g}) towards {towards:.0f} deg more than they say (single runs differ from that by {scatter:.2g} m/s); "
        f"{shares}."
    )
    line = toml_line({"velocities": "water", "current": [float(north), float(east)]})
    curves = tuple(Curve(part, np.arange(len(left)), f(left) / w.span, ".") for part, f in (("north", np.real), ("east", np.imag)))
    return [Finding(
        "track", "warning", "through water", text, line, channels=("u", "v"),
        todo="Where the current differs between runs, give each its own: [runs.<id>] current = [north, east]." if scatter > 0.5 * speed else "",
        evidence={"north": float(north), "east": float(east), "speed": speed, "scatter_of_runs": scatter, **evidence},
        picture=Picture("Drift that heading and speeds do not explain", "window", "drift [m/s]", curves),
    )]  # fmt: skip


def _picture(w: Windows, title: str, column: np.ndarray, label: str) -> Picture:
    left = w.moved - w.surge - w.sway
    parts = (("north", np.real), ("east", np.imag))
    return Picture(title, label, "way not explained [m]", tuple(Curve(name, f(column), f(left), ".") for name, f in parts))


def _sway_picture(w: Windows) -> Picture:
    """Across the ship: what the position says beside surge, against sway."""
    turn = np.where(np.abs(w.sway) > 0.0, w.sway / np.maximum(np.abs(w.sway), 1e-300), 1.0)
    made = np.real((w.moved - w.surge) * np.conj(turn))
    top = float(np.max(np.abs(w.sway)))
    equal = Curve("equal", np.array([0.0, top]), np.array([0.0, top]))
    curves = (Curve("windows", np.abs(w.sway), made, "."), equal)
    return Picture("Way across the ship by position against way by sway", "by sway [m]", "by position, along the way by sway [m]", curves)


def _scale_picture(w: Windows) -> Picture:
    way = w.surge + w.sway
    top = float(np.max(np.abs(way)))
    equal = Curve("equal", np.array([0.0, top]), np.array([0.0, top]))
    return Picture(
        "Way by position against way by speeds", "by speeds [m]", "by position [m]", (Curve("windows", np.abs(way), np.abs(w.moved), "."), equal)
    )


CHECK = check
