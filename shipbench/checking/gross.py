"""Gross errors that change every figure: frames (ENU, heading from east), earth-fixed velocities, units, signs. They
are corrected before finer checks.

Readings of frame and velocities are compared by the share of the track, and of the heading's change, that they leave
unexplained. Another reading than the standard one is accepted only if it leaves a quarter or less of the sum of
squares. Units and signs are in `units`, those of the wind in `wind_reading`.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..records import Dataset
from ..signals import PSI, U, V, X, Y
from .finding import Curve, Finding, Picture, toml_line
from .recording import Recording
from .thresholds import THRESHOLDS
from .units import UnitFinding, check_units, corrected
from .wind_reading import correct_wind

_HEMISPHERES = (
    "Did the import leave N/S or E/W of latitude and longitude unread? Then import again with "
    "`hemisphere` in the mapping."
)
_FLIPPED = {
    "x": ("south", "north"), "y": ("west", "east"), "psi": ("counterclockwise", "clockwise"), "u": ("astern", "ahead"),
    "v": ("port", "starboard"),
    "r": ("port", "starboard"), "delta": ("port", "starboard"), "n": ("astern", "ahead"), "F_b": ("port", "starboard"),
    "F_s": ("port", "starboard"),
}  # fmt: skip
_UNITS = {
    "degrees": "deg", "knots": "kn", "km/h": "km/h", "kN": "kN", "degrees per second": "deg/s",
    "degrees per minute": "deg/min", "rev/s": "rev/s",
    "rad/s": "rad/s",
}  # fmt: skip


@dataclass(frozen=True)
class _Reading:
    """Interpretation of frame and velocities: its name, the change of the states (a copy) that gives standard states,
    and its lines."""

    kind: str
    text: str
    change: Callable[[np.ndarray], None]
    line: dict[str, Any]


def _swap(S: np.ndarray) -> None:
    S[:, [X, Y]] = S[:, [Y, X]]


def _from_east(S: np.ndarray) -> None:
    S[:, PSI] = 0.5 * np.pi - S[:, PSI]


def _enu(S: np.ndarray) -> None:
    _swap(S)
    _from_east(S)


def _earth(S: np.ndarray) -> None:
    turned = (S[:, U] + 1j * S[:, V]) * np.exp(-1j * S[:, PSI])
    S[:, U], S[:, V] = turned.real, turned.imag


def _earth_swapped(S: np.ndarray) -> None:
    S[:, [U, V]] = S[:, [V, U]]
    _earth(S)


READINGS = (
    _Reading("ENU", "x, y, psi are of an ENU frame (x east, y north, psi counterclockwise from east)", _enu,
        {"frame": "ENU"}),
    _Reading("ENU", "x is east and y north, with a compass heading", _swap, {"frame": "east-north"}),
    _Reading(
        "heading from east", "the heading is counted counterclockwise from east", _from_east,
        {"signs": {"psi": "counterclockwise"}, "bias": {"psi": -math.pi / 2.0}},
    ),
    _Reading("earth-fixed velocities", "u, v are velocities to the north and east, not along the ship", _earth,
        {"velocities": "earth"}),
    _Reading(
        "earth-fixed velocities", "u, v are velocities to the east and north, not along the ship", _earth_swapped,
        {"velocities": "earth-east-north"},
    ),
)  # fmt: skip


def _changed(dataset: Dataset, change: Callable[[np.ndarray], None]) -> Dataset:
    runs = []
    for run in dataset.runs:
        states = run.states.copy()
        change(states)
        runs.append(replace(run, states=states))
    return dataset.with_runs(runs)


@dataclass(frozen=True)
class _Misfit:
    """Misfit of a reading. track: root share of the track's squares that heading and speeds leave; scale: of the speeds
    to the track; pairs: displacement by the speeds and by the position (W,)."""

    track: float
    scale: float
    said: np.ndarray
    made: np.ndarray


def _misfit(recording: Recording, dataset: Dataset) -> _Misfit | None:
    """Misfit of the track to heading and speeds, with a free scale; None where the ship hardly moves."""
    dt = recording.dt
    width = max(3, round(THRESHOLDS.value("window") * recording.froude / dt))
    pieces = [run.states[a : a + width + 1] for run in dataset.runs for a in range(0, len(run) - width, width)]
    if len(pieces) < THRESHOLDS.count("windows"):
        return None
    S = np.stack(pieces)
    made = S[:, -1, X] - S[:, 0, X] + 1j * (S[:, -1, Y] - S[:, 0, Y])
    said = np.asarray(np.trapezoid((S[..., U] + 1j * S[..., V]) * np.exp(1j * S[..., PSI]), dx=dt, axis=1))
    if np.mean(np.abs(made) ** 2) < (THRESHOLDS.value("least_distance") * recording.dataset.ship.L) ** 2:
        return None
    scale = float(np.real(np.vdot(said, made)) / max(np.real(np.vdot(said, said)), 1e-300))
    keep = np.abs(made - scale * said)
    keep = keep <= THRESHOLDS.value("beyond_noise") * np.median(keep) + 1e-12
    share = float(np.sqrt(np.sum(np.abs(made - scale * said)[keep] ** 2) / np.sum(np.abs(made[keep]) ** 2)))
    return _Misfit(share if scale > 0.0 else 1.0, scale, said, made)


def correct(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Recording with gross errors corrected, and the findings on them."""
    findings: list[Finding] = []
    plain = _misfit(recording, recording.dataset)
    units = _units(recording)
    best = _best_reading(recording, plain, units) if plain is not None else None
    if plain is not None and best is not None:
        reading, dataset, left = best
        findings.append(_frame_finding(reading, plain, left))
        recording = replace(recording, dataset=dataset, turned=recording.turned or "velocities" in reading.line)
        units = _units(recording)
    findings += [_unit_finding(recording, f, units) for f in units if not _follows(f, units)]
    recording, wind = correct_wind(recording.with_dataset(corrected(recording.dataset, units)))
    return recording, findings + wind


def _units(recording: Recording) -> list[UnitFinding]:
    """Errors of unit and sign; of two speeds derived from one velocity over ground none has a unit of its own."""
    found = check_units(recording.dataset)
    factors = {f.channel: f.factor for f in found}
    return [
        f for f in found if not (recording.turned and f.channel in ("u", "v") and factors.get("u") != factors.get("v"))
    ]


def _best_reading(
    recording: Recording, plain: _Misfit, units: list[UnitFinding]
) -> tuple[_Reading, Dataset, _Misfit] | None:
    """Interpretation of the frame that explains the track, unless units and signs explain it with as few errors."""
    options = []
    for reading in READINGS:
        dataset = _changed(recording.dataset, reading.change)
        left = _misfit(recording, dataset)
        little = THRESHOLDS.value("little")
        if left is None or left.track > little or left.track**2 > little * plain.track**2:
            continue
        further = check_units(dataset)
        options.append((1 + len(_errors(further)), left.track, reading, dataset, left))
    if not options:
        return None
    errors, _, reading, dataset, left = min(options, key=lambda o: o[:2])
    as_units = _misfit(recording, corrected(recording.dataset, units)) if units else None
    simpler = len(_errors(units)) < errors + (reading.kind != "ENU")  # a frame is the likelier slip of the two
    return None if as_units is not None and simpler and as_units.track < 1.5 * left.track else (reading, dataset, left)


def _errors(units: list[UnitFinding]) -> list[UnitFinding]:
    """Separate errors: commands share that of their actuator, u and v one unit."""
    return [f for f in units if not _follows(f, units)]


def _follows(f: UnitFinding, units: list[UnitFinding]) -> bool:
    """Whether an error follows from another: a command with its actuator's error, or y where both axes of the position
    are reversed."""
    if f.channel == "y":
        return _reversed(units)
    return f.channel.endswith("_c") and any(
        o.channel == f.channel.removesuffix("_c") and abs(o.factor / f.factor - 1.0) < 0.02 for o in units
    )


def _reversed(units: list[UnitFinding]) -> bool:
    """Whether both axes of the position have the opposite sign."""
    return {("x", "sign"), ("y", "sign")} <= {(f.channel, f.kind) for f in units}


def _picture(plain: _Misfit, left: _Misfit) -> Picture:
    top = float(np.quantile(np.abs(plain.made), 0.99)) * 1.2
    curves = tuple(
        Curve(label, (m.scale * m.said).real, m.made.real, ".")
        for label, m in (("as recorded", plain), ("as proposed", left))
        if np.isfinite(m.scale)
    )
    return Picture("Way made to the north, window by window", "by heading and speeds [m]", "by position [m]", (
        *curves, Curve("equal", np.array([-top, top]), np.array([-top, top])),
    ))  # fmt: skip


def _frame_finding(reading: _Reading, plain: _Misfit, left: _Misfit) -> Finding:
    text = (
        f"{reading.text}: the track departs from heading and speeds by {plain.track:.1%} of its length as recorded, "
        f"by {left.track:.1%} read so "
        f"({len(left.made)} windows)."
    )
    channels = ("u", "v") if "velocities" in reading.line else ("x", "y", "psi")
    return Finding(
        "gross", "error", reading.kind, text, toml_line(reading.line), channels=channels,
        evidence={"left_plain": plain.track, "left": left.track}, picture=_picture(plain, left),
    )  # fmt: skip


def _side(recording: Recording, channel: str) -> str:
    """Word of `[signs]` that reverses a channel; a sign that the file declares already is removed."""
    flipped, kept = _FLIPPED[channel.removesuffix("_c")]
    return kept if recording.given.get("signs", {}).get(channel) == flipped else flipped


def _unit_finding(recording: Recording, f: UnitFinding, units: list[UnitFinding]) -> Finding:
    """Finding in words and as lines of dataset.toml."""
    if f.kind == "exchanged with y":
        text = f"x is east and y north. {f.evidence}"
        line = toml_line({"frame": "east-north"})
        return Finding(
            "gross",
            "error",
            "ENU",
            text,
            line,
            channels=("x", "y"),
            evidence={"factor": f.factor},
            picture=_channel(recording, f.channel),
        )
    if f.channel == "x" and _reversed(units):
        line = toml_line({"signs": {axis: _side(recording, axis) for axis in ("x", "y")}})
        text = f"x and y are both reversed: x grows to the south and y to the west. {f.evidence}"
        todo = (
            f"{_HEMISPHERES} A heading that is off by 180 degrees looks the same: then write [bias] psi = "
            f"{math.pi:.5f} instead."
        )
        return Finding(
            "gross", "error", "position reversed", text, line, todo, ("x", "y"), picture=_channel(recording, "x")
        )
    lines, kinds, todo = {}, [], _HEMISPHERES if f.channel in ("x", "y") else ""
    for part in f.kind.split(", "):
        if part == "sign":
            lines["signs"] = {f.channel: _side(recording, f.channel)}
            kinds.append("sign")
        elif part:
            lines["units"] = {f.channel: _UNITS[part]}
            kinds.append("unit")
    if f.channel == "delta" and "sign" in kinds and len(_errors(units)) == 1:
        todo = (
            "If the rudder is right, all else is a mirror image, as of an ENU frame with v and r to port: then "
            "write frame = \"ENU\" and "
            "[signs] v = \"port\", r = \"port\" instead. Nothing else in the data tells the two apart."
        )  # fmt: skip
    wrong = " and ".join(dict.fromkeys(kinds)) or "size"
    text = f"{f.channel} is recorded with another {wrong} ({f.kind or f'{f.factor:.4g} times ours'}). {f.evidence}"
    return Finding(
        "gross", "error", " and ".join(dict.fromkeys(kinds)) or "unit", text, toml_line(lines), todo, (f.channel,),
        evidence={"factor": f.factor},
        picture=_channel(recording, f.channel),
    )  # fmt: skip


def _channel(recording: Recording, channel: str) -> Picture:
    """Picture of the channel in the longest run, beside the channels with which it should agree."""
    run = max(recording.runs, key=len)
    t, S = run.t - run.t[0], run.states
    names = dict(zip(("x", "y", "psi", "u", "v", "r", "n", "delta", "F_b", "F_s"), S.T, strict=True)) | dict(
        zip(run.inputs_names, run.inputs.T, strict=True)
    )
    curves = [Curve(f"{channel} as recorded", t, names[channel])]
    if channel == "r":
        curves.append(Curve("change of psi / time", t, np.gradient(S[:, PSI], recording.dt)))
    elif channel in ("u", "v", "psi", "x", "y"):
        z = np.gradient(S[:, X] + 1j * S[:, Y], recording.dt)
        own = z * np.exp(-1j * S[:, PSI])
        by = {"u": own.real, "v": own.imag, "psi": np.unwrap(np.angle(z)), "x": S[:, X], "y": S[:, Y]}
        curves.append(Curve(f"{channel} by the track", t, by[channel]))
    elif channel == "delta":
        curves.append(
            Curve(
                "r, to the same height",
                t,
                S[:, 5] / max(float(np.max(np.abs(S[:, 5]))), 1e-12) * float(np.max(np.abs(S[:, 7]))),
            )
        )
    return Picture(
        f"{channel} in run {recording.name_of(run)}", "time [s]", f"{channel}, in the unit of the file", tuple(curves)
    )
