"""Findings from position against integrated speed: scale, lag, heading reference, antenna, velocities through water, as
`track` explains them."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..units import LENGTHS
from .finding import Curve, Finding, Picture, Severity, toml_line
from .recording import Recording
from .selection import Chosen
from .thresholds import THRESHOLDS
from .track import LAGS, Explained, Windows, explain, explain_windows, least_lag, possible_scale, windows


def check(recording: Recording) -> list[Finding]:
    """Findings of the track; none where the ship hardly moves."""
    x = None if {"u", "v"} & set(recording.dataset.derived) else explain(recording)
    if x is None:
        return []
    most = THRESHOLDS.value("most")
    others = [name for name in x.chosen.names if name not in LAGS and x.chosen.held[name] < most]
    found = [f for name in others for f in _finding(recording, x.corrected, x.chosen, name)]
    return _lag_findings(recording, x) + found


def _possible_lag(recording: Recording, x: Explained, name: str) -> bool:
    """Whether a lag is practically significant, short enough for the windows, and explains a part that nothing else
    does."""
    lag = x.late.get(LAGS[name][0], 0.0)
    if not least_lag(recording) <= abs(lag) <= 0.5 * x.plain.span or name not in x.first.sd:
        return False
    without = windows(recording, {c: seconds for c, seconds in x.late.items() if c not in LAGS[name]})
    kept = [n for n in x.chosen.names if n not in LAGS]
    if without is None:
        return False
    return x.chosen.out < THRESHOLDS.value("most") * explain_windows(without, recording.turned, kept).out


def _lag_findings(recording: Recording, x: Explained) -> list[Finding]:
    """Findings on lags. Sensors are late, not early: a position ahead of heading and speeds together is a velocity
    vector that is late in earth axes."""
    w, chosen, first = x.plain, x.chosen, x.first
    vector = "the position, as a vector in earth axes (a filter there, before the turn into the ship's axes),"
    words = {
        ("lag of u, v", True): (("u", "v"), "the position", ("u", "v")),
        ("lag of u, v", False): (("x", "y"), "u, v", ("x", "y")),
        ("lag of position", True): (("x", "y"), "heading and speeds", ("x", "y")),
        ("lag of position", False): (("u", "v"), vector, ("velocity",)),
        ("lag of heading", True): (("psi",), "position and speeds", ("psi",)),
        ("lag of heading", False): (("x", "y"), "the heading", ("x", "y")),
    }  # fmt: skip
    found = []
    for name in LAGS:
        if not _possible_lag(recording, x, name):
            continue
        lag = x.late[LAGS[name][0]]
        names, others, keys = words[name, lag > 0.0]
        lag, sd = abs(lag), float(first.sd[name][0])
        text = (
            f"{', '.join(names)} lag {others} by {lag:.2g} s (standard error {sd:.1g} s): the track departs from "
            "heading and speeds by "
            f"{first.left['plain']:.1%} of its length as recorded, by {chosen.left['all chosen']:.1%} with it."
        )
        if keys == ("velocity",) and not recording.turned:
            text += f" Moved along the ship's axes instead they leave {first.left['lag of u, v']:.1%}."
        column = w.velocity_change if name == "lag of u, v" else w.way_change
        found.append(Finding(
            "track", "warning", "lag", text, toml_line({"delay": dict.fromkeys(keys, round(lag, 3))}), channels=names,
            evidence={"lag_s": lag, "sd_s": sd, "left_plain": first.left["plain"], "left": chosen.left["all chosen"]},
            picture=_picture(w, f"{', '.join(names)} late by {lag:.2g} s", column,
                "change of velocity in the "
                "window [m/s]"),
        ))  # fmt: skip
    return found


def _finding(recording: Recording, w: Windows, chosen: Chosen, name: str) -> list[Finding]:
    value, sd, left = chosen.value[name], chosen.sd[name], chosen.left
    shares = (
        f"the track departs from heading and speeds by {left['plain']:.1%} of its length as recorded, by "
        f"{left['all chosen']:.1%} with all that is "
        "reported"
    )
    evidence: dict[str, Any] = {f"left_{k.replace(' ', '_')}": v for k, v in left.items()}
    if name == "through water":
        return _through_water(recording, w, chosen, shares, evidence)
    if name == "off midship":
        ahead, abeam = map(float, value)
        if np.hypot(ahead, abeam) < THRESHOLDS.value("least_distance") * recording.dataset.ship.L:
            return []
        text = (
            f"x, y are of a point {ahead:+.3g} m ahead (standard error {sd[0]:.2g}), {abeam:+.3g} m to starboard "
            f"({sd[1]:.2g}) of where u, v are: "
            f"{shares}."
        )
        return [Finding(
            "track", "warning", "off midship", text, toml_line({"antenna": [ahead, abeam]}), channels=("x", "y"),
            evidence={"ahead_m": ahead, "starboard_m": abeam, **evidence},
            picture=_picture(w, "Way not explained", w.turned, "change of the bow's direction"),
        )]  # fmt: skip
    if name == "heading reference":
        angle = float(value[0])
        if abs(angle) < np.deg2rad(THRESHOLDS.value("least_angle")):
            return []
        text = (
            f"the heading reads {np.rad2deg(-angle):+.2f} deg (standard error {np.rad2deg(sd[0]):.2f}) off the "
            f"track with drift taken off: {shares}."
        )
        return [Finding(
            "track", "warning", "heading bias", text, toml_line({"bias": {"psi": round(-angle, 5)}}), channels=("psi",),
            evidence={"angle_rad": -angle, "sd_rad": sd[0], **evidence},
            picture=_picture(w, "Way not explained, across the way made", 1j * (w.surge + w.sway),
                "way by heading and speeds, turned [m]"),
        )]  # fmt: skip
    factor = 1.0 / (1.0 + float(value[0]))
    channels = {"scale of u and v": ("u", "v"), "scale of u": ("u",), "scale of v": ("v",)}[name]
    if name == "scale of v" and factor < -0.5:
        positive = "starboard" if recording.given.get("signs", {}).get("v") == "port" else "port"
        text = (
            f"v is recorded with the other sign: {factor:.3f} of the value from the position (standard error "
            f"{sd[0]:.3f}): {shares}."
        )
        line = toml_line({"signs": {"v": positive}})
        figures = {"factor": factor, "sd": sd[0], **evidence}
        return [
            Finding("track", "error", "sign", text, line, channels=channels, evidence=figures, picture=_sway_picture(w))
        ]
    least = THRESHOLDS.value("fault_scale") if name == "scale of v" else THRESHOLDS.value("least_share")
    if abs(factor - 1.0) < least:
        return []
    gross = next((unit for unit, size in LENGTHS.items() if unit != "m" and abs(factor / size - 1.0) < 0.03), None)
    if not (gross or possible_scale(factor)):
        return []
    if gross and name != "scale of v":
        text = (
            f"x, y change {1.0 / factor:.4g} times as much as the integrated speeds, as lengths in {gross} do: "
            f"{shares}."
        )
        line = toml_line({"units": {"x": gross, "y": gross}})
        return [
            Finding(
                "track",
                "error",
                "unit",
                text,
                line,
                channels=("x", "y"),
                evidence={"factor": factor, **evidence},
                picture=_scale_picture(w),
            )
        ]
    text = (
        f"{' and '.join(channels)} read {factor:.3f} of what the position says (standard error {sd[0]:.3f}): {shares}."
    )
    severity: Severity = "error" if abs(factor - 1.0) > 0.1 and name != "scale of v" else "warning"
    return [Finding(
        "track", severity, "scale", text, toml_line({"scale": dict.fromkeys(channels, round(factor, 4))}),
        channels=channels,
        evidence={"factor": factor, "sd": sd[0], **evidence}, picture=_scale_picture(w),
        todo="If the speeds are right, the positions have the inverse scale: write [scale] x and y instead.",
    )]  # fmt: skip


def _through_water(
    recording: Recording, w: Windows, chosen: Chosen, shares: str, evidence: dict[str, Any]
) -> list[Finding]:
    north, east = chosen.value["through water"]
    speed = float(np.hypot(north, east))
    if speed < THRESHOLDS.value("least_share") * recording.speed:
        return []
    towards = float(np.rad2deg(np.arctan2(east, north)) % 360.0)
    left, own = w.moved - w.surge - w.sway, {}
    for i in np.unique(w.run):
        mine = left[w.run == i]
        if len(mine) >= 3:
            own[recording.name_of(recording.runs[i])] = (
                np.median(mine.real) / w.span + 1j * np.median(mine.imag) / w.span
            )
    scatter = float(np.sqrt(np.mean(np.abs(np.array(list(own.values())) - (north + 1j * east)) ** 2))) if own else 0.0
    text = (
        f"u, v are through water, not over ground: the ship drifts {speed:.3g} m/s (standard errors "
        f"{chosen.sd['through water'][0]:.2g}, "
        f"{chosen.sd['through water'][1]:.2g}) towards {towards:.0f} deg more than they say (single runs differ "
        f"from that by {scatter:.2g} m/s); "
        f"{shares}."
    )
    line = toml_line({"velocities": "water", "current": [float(north), float(east)]})
    curves = tuple(
        Curve(part, np.arange(len(left)), f(left) / w.span, ".") for part, f in (("north", np.real), ("east", np.imag))
    )
    return [Finding(
        "track", "warning", "through water", text, line, channels=("u", "v"),
        todo=(
            "Where the current differs between runs, give each its own: [runs.<id>] current = [north, east]."
            if scatter > 0.5 * speed else ""
        ),
        evidence={"north": float(north), "east": float(east), "speed": speed, "scatter_of_runs": scatter, **evidence},
        picture=Picture("Drift that heading and speeds do not explain", "window", "drift [m/s]", curves),
    )]  # fmt: skip


def _picture(w: Windows, title: str, column: np.ndarray, label: str) -> Picture:
    left = w.moved - w.surge - w.sway
    parts = (("north", np.real), ("east", np.imag))
    return Picture(
        title, label, "way not explained [m]", tuple(Curve(name, f(column), f(left), ".") for name, f in parts)
    )


def _sway_picture(w: Windows) -> Picture:
    """Picture of the displacement across the ship: by position less surge, against sway."""
    turn = np.where(np.abs(w.sway) > 0.0, w.sway / np.maximum(np.abs(w.sway), 1e-300), 1.0)
    made = np.real((w.moved - w.surge) * np.conj(turn))
    top = float(np.max(np.abs(w.sway)))
    equal = Curve("equal", np.array([0.0, top]), np.array([0.0, top]))
    curves = (Curve("windows", np.abs(w.sway), made, "."), equal)
    return Picture(
        "Way across the ship by position against way by sway",
        "by sway [m]",
        "by position, along the way by sway [m]",
        curves,
    )


def _scale_picture(w: Windows) -> Picture:
    way = w.surge + w.sway
    top = float(np.max(np.abs(way)))
    equal = Curve("equal", np.array([0.0, top]), np.array([0.0, top]))
    return Picture(
        "Way by position against way by speeds",
        "by speeds [m]",
        "by position [m]",
        (Curve("windows", np.abs(way), np.abs(w.moved), "."), equal),
    )


CHECK = check
