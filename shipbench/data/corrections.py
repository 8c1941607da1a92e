"""Corrections of a record in dataset.toml, beyond units and signs: frames, clocks, biases, bad samples, gaps.

`shipbench data check` finds these and prints the lines; the loader applies them in this order: frame, bad samples,
biases and scales, kind of velocities, cuts and gaps, delays, kind of wind, antenna. Values are in standard units and
signs, after `[units]` and `[signs]`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
import pandas as pd
from pydantic import AfterValidator, BaseModel, ConfigDict, ValidationError

from ..errors import InputError, unknown_name
from ..physics.wind import true_wind
from ..signals import COMMANDS, ENVIRONMENT, STATES, wrap_angle
from ..toml_files import Number, fault

SIGNALS = (*STATES, *COMMANDS, *ENVIRONMENT)
VECTOR = "velocity"
_SPLIT_FEWEST = 2


def _in_order(interval: tuple[float, float]) -> tuple[float, float]:
    if interval[0] > interval[1]:
        raise ValueError(
            "the interval ends before it begins; accepted: [from, to] in s with from <= to, such as "
            f"[{interval[1]:g}, {interval[0]:g}]"
        )
    return interval


Interval = Annotated[tuple[Number, Number], AfterValidator(_in_order)]
"""Interval [from, to] in s, both included."""

_MOST = 1e9
"""Largest correction in SI units, and ratio of two units (nano to one)."""


class RunCorrections(BaseModel):
    """Keys of `[runs.<id>]` that change the samples; all others are metadata.

    cut: [from, to] in s, both included: these samples are left out and the run is split there. fill: signal -> such
    intervals, bridged by linear interpolation. bias: signal -> recorded less true. current: [north, east] m/s for
    velocities through water.
    """

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    cut: list[Interval] = []
    fill: dict[str, list[Interval]] = {}
    bias: dict[str, Number] = {}
    current: tuple[Number, Number] | None = None


class Corrections(BaseModel):
    """Keys of dataset.toml that hold for all runs.

    frame: "east-north" where x is east and y north; "ENU" where psi besides is counterclockwise from east. velocities:
    kind of u and v: "body" over ground (standard), "earth" (north and east), "earth-east-north" (east and north), or
    "water" (body, through water; `current` = [north, east] m/s is added). wind: kind of wind_speed and wind_from:
    "true" (standard), "apparent" (apparent wind, its direction from the bow), "apparent-north" (apparent wind, from
    north), "true-bow" (the true wind, its direction from the bow). antenna: [forward, starboard] m from midship of the
    point whose position is recorded. gaps: "refuse", or "split" runs at gaps in time and at rows that lack values.
    scale: recorded over true. bias: recorded less true. delay: s by which the record of a signal is late; "velocity" is
    the vector of u and v in earth axes (late or filtered there, then rotated by the current heading). held: x, y or psi
    whose values a faster record repeats until the next one; linear interpolation replaces them.
    """

    frame: Literal["NED", "ENU", "east-north"] = "NED"
    velocities: Literal["body", "earth", "earth-east-north", "water"] = "body"
    current: tuple[Number, Number] | None = None
    wind: Literal["true", "apparent", "apparent-north", "true-bow"] = "true"
    antenna: tuple[Number, Number] | None = None
    gaps: Literal["refuse", "split"] = "refuse"
    scale: dict[str, Number] = {}
    bias: dict[str, Number] = {}
    delay: dict[str, Number] = {}
    held: list[Literal["x", "y", "psi"]] = []

    @property
    def changes_samples(self) -> bool:
        """Whether `correct_run` changes more than jumps of the heading (`frame` is the table's, see `to_ned`)."""
        return any(
            getattr(self, key) != field.default for key, field in Corrections.model_fields.items() if key != "frame"
        )


def check_names(corrections: Corrections, runs: dict[str, dict[str, Any]], where: str) -> None:
    """Check that every name is a signal and every number is possible.

    Raises:
        InputError: a name is no signal, a value is not a finite number, or a current is missing.
    """
    tables = {"scale": corrections.scale, "bias": corrections.bias, "delay": corrections.delay}
    currents = [corrections.current]
    for run, meta in runs.items():
        own = split_meta(run, meta, where)[0]
        tables |= {f"runs.{run}.bias": own.bias, f"runs.{run}.fill": dict.fromkeys(own.fill, 0.0)}
        currents.append(own.current)
    for table, entries in tables.items():
        known = (*SIGNALS, VECTOR) if table == "delay" else SIGNALS
        for signal, value in entries.items():
            if signal not in known:
                raise unknown_name(f"signal in [{table}] of {where}", signal, known)
            if not abs(value) <= _MOST or (table == "scale" and abs(value) < 1.0 / _MOST):
                accepted = (
                    f"a finite number{' other than 0' * (table == 'scale')}, its size within "
                    f"{1 / _MOST * (table == 'scale'):g} to {_MOST:g}"
                )
                raise InputError(f"{where}: [{table}] {signal} = {value}; accepted: {accepted}. Correct that line.")
    if corrections.velocities != "water" and any(c is not None for c in currents):
        raise InputError(
            f'{where}: a current is given, but velocities = "{corrections.velocities}". It belongs to velocities = '
            '"water".'
        )


def split_meta(name: str, meta: dict[str, Any], where: str) -> tuple[RunCorrections, dict[str, Any]]:
    """Corrections of a run, and its metadata without them (so that a data set written again is not corrected twice).

    Raises:
        InputError: a correction has another form.
    """
    own = {k: v for k, v in meta.items() if k in RunCorrections.model_fields}
    try:
        return RunCorrections.model_validate(own), {k: v for k, v in meta.items() if k not in own}
    except ValidationError as error:
        place, _, wrong = fault(error)
        accepted = (
            "cut = [[from, to], ...] s, fill = {r = [[from, to], ...]}, bias = {r = 0.001}, current = [north, east]"
        )
        raise InputError(f"{where}: [runs.{name}] {'.'.join(place)}: {wrong}. Accepted: {accepted}.") from None


def to_ned(table: pd.DataFrame, corrections: Corrections) -> None:
    """Convert positions and heading of a table in another frame, in place."""
    if corrections.frame != "NED":
        table[["x", "y"]] = table[["y", "x"]].to_numpy()
    if corrections.frame == "ENU":
        table["psi"] = 0.5 * np.pi - table["psi"]


def correct_run(
    frame: pd.DataFrame, corrections: Corrections, own: RunCorrections, dt: float, where: str, turn: float = 2.0 * np.pi
) -> list[pd.DataFrame]:
    """Corrected rows of one run, in as many pieces as cuts and gaps make of it (samples may still be faulty: the caller
    refuses them).

    turn: a full turn of the heading, which is made continuous: 360 where it may not be in rad yet.

    Raises:
        InputError: a fill has no samples at its ends, velocities through water lack their current, or a kind of wind
            its columns.
    """
    frame = frame.reset_index(drop=True).copy()
    t = frame["t"].to_numpy()
    frame["psi"] = continuous(frame["psi"].to_numpy(), ~_inside(t, own.fill.get("psi", [])), turn)
    for signal, intervals in own.fill.items():
        if signal in frame:
            _fill(frame, signal, t, intervals, where)
    for signal in corrections.held:
        known = np.isfinite(frame[signal].to_numpy())
        frame.loc[known, signal] = between_fixes(frame[signal].to_numpy()[known])
    for signal, bias in {**corrections.bias, **own.bias}.items():
        if signal in frame:
            frame[signal] -= bias
    for signal, scale in corrections.scale.items():
        if signal in frame:
            frame[signal] /= scale
    _to_body_over_ground(frame, corrections, own, where)
    parts = [
        undelayed(part, corrections.delay, dt) for part in _pieces(frame, corrections, own, dt)
    ]  # nothing is interpolated over a gap or a cut
    return [
        _at_midship(_with_true_wind(part, corrections.wind, where), corrections.antenna)
        for part in parts
        if len(part) >= _SPLIT_FEWEST
    ]


def continuous(psi: np.ndarray, good: np.ndarray | bool = True, turn: float = 2.0 * np.pi) -> np.ndarray:
    """Heading (samples,) without jumps of a full turn between its `good` finite samples; where it has none, it is
    unchanged bit for bit."""
    known = np.isfinite(psi) & good
    if not (np.abs(np.diff(psi[known])) > 0.5 * turn).any():
        return psi
    psi = psi.copy()
    psi[known] = np.unwrap(psi[known], period=turn)
    return psi


def _with_true_wind(frame: pd.DataFrame, kind: str, where: str) -> pd.DataFrame:
    if kind == "true":
        return frame
    if not {"wind_speed", "wind_from"} <= set(frame):
        raise InputError(
            f'{where}: wind = "{kind}" needs the columns wind_speed and wind_from. Add them, or remove that line of '
            "dataset.toml."
        )
    psi, u, v, speed, come_from = (frame[c].to_numpy() for c in ("psi", "u", "v", "wind_speed", "wind_from"))
    north, east = true_wind(psi, u, v, speed, come_from, kind)
    return frame.assign(wind_speed=np.hypot(north, east), wind_from=np.arctan2(east, north))


def _at_midship(frame: pd.DataFrame, antenna: tuple[float, float] | None) -> pd.DataFrame:
    if antenna is None:
        return frame
    arm = (antenna[0] + 1j * antenna[1]) * np.exp(1j * frame["psi"].to_numpy())
    return frame.assign(x=frame["x"] - arm.real, y=frame["y"] - arm.imag)


def _inside(t: np.ndarray, intervals: list[tuple[float, float]], dt: float = 0.0) -> np.ndarray:
    """Mask of samples in any of the closed intervals, widened a little against rounding."""
    bad = np.zeros(len(t), dtype=bool)
    for start, stop in intervals:
        bad |= (t >= start - 1e-3 * dt - 1e-9) & (t <= stop + 1e-3 * dt + 1e-9)
    return bad


def _fill(frame: pd.DataFrame, signal: str, t: np.ndarray, intervals: list[tuple[float, float]], where: str) -> None:
    values = frame[signal].to_numpy(copy=True)
    bad = _inside(t, intervals)
    good = ~bad & np.isfinite(values)
    if not good.any():
        raise InputError(f"{where}: fill of {signal} covers the whole run; leave the run out instead.")
    values[bad] = np.interp(t[bad], t[good], values[good])
    frame[signal] = values


def between_fixes(values: np.ndarray) -> np.ndarray:
    """Linear interpolation from fix to fix of a record (samples,) that holds each value until the next; one held for
    long did not change."""
    if len(values) < 2:
        return values
    new = np.concatenate([[0], np.flatnonzero(np.diff(values) != 0.0) + 1])
    every = max(1, round(float(np.median(np.diff(new))))) if len(new) > 1 else 1
    still = new[1:][np.diff(new) > 1.5 * every] - every  # the last fix before the value changes again
    at = np.unique(np.concatenate([new, still]))
    rest = np.arange(len(values))
    bridged = np.interp(rest, at, values[at])
    if len(at) > 1 and len(values) - 1 - at[-1] < every:  # after the last fix it goes on as before
        slope = (values[at[-1]] - values[at[-2]]) / (at[-1] - at[-2])
        bridged[at[-1] :] = values[at[-1]] + slope * (rest[at[-1] :] - at[-1])
    return np.asarray(bridged)


def _to_body_over_ground(frame: pd.DataFrame, corrections: Corrections, own: RunCorrections, where: str) -> None:
    if corrections.velocities == "body":
        return
    cos, sin = np.cos(frame["psi"]), np.sin(frame["psi"])
    own_way = frame[["u", "v"]].to_numpy(copy=True).T
    if corrections.velocities == "water":
        current = own.current or corrections.current
        if current is None:
            raise InputError(
                f'{where}: velocities = "water" needs current = [north, east] in m/s, for all runs or under '
                "[runs.<id>]."
            )
        north, east = current
    else:
        north, east = own_way if corrections.velocities == "earth" else own_way[::-1]
        own_way = np.zeros_like(own_way)
    frame["u"], frame["v"] = own_way[0] + cos * north + sin * east, own_way[1] - sin * north + cos * east


def undelayed(frame: pd.DataFrame, delay: dict[str, float], dt: float) -> pd.DataFrame:
    """Signals with late ones shifted back in time; samples whose values lie outside the record are dropped. Commands
    move by whole samples."""
    late = {s: d for s, d in delay.items() if (s in frame or s == VECTOR) and d != 0.0}
    t = frame["t"].to_numpy()
    if not late or len(t) < 2 or not np.isfinite(t).all():
        return frame
    frame = frame.copy()
    turn = np.exp(1j * frame["psi"].to_numpy())  # as recorded: by this heading the velocities were turned
    for signal, lag in late.items():
        if signal == VECTOR:
            vector = np.interp(t + lag, t, (frame["u"].to_numpy() + 1j * frame["v"].to_numpy()) * turn) * np.conj(turn)
            frame["u"], frame["v"] = vector.real, vector.imag
            continue
        shift = float(np.rint(lag / dt)) * dt if signal in COMMANDS else lag
        if signal == "wind_from":
            frame[signal] = wrap_angle(np.interp(t + shift, t, np.unwrap(frame[signal].to_numpy())))
        else:
            frame[signal] = np.interp(t + shift, t, frame[signal].to_numpy())
    first, last = t[0] - min(0.0, *late.values()), t[-1] - max(0.0, *late.values())
    return frame[(t >= first - 1e-6 * dt) & (t <= last + 1e-6 * dt)].reset_index(drop=True)


def _pieces(frame: pd.DataFrame, corrections: Corrections, own: RunCorrections, dt: float) -> list[pd.DataFrame]:
    t = frame["t"].to_numpy()
    keep = ~_inside(t, own.cut, dt)
    breaks = np.zeros(len(t), dtype=bool)
    breaks[1:] = ~keep[:-1]
    if corrections.gaps == "split":
        signals = [c for c in SIGNALS if c in frame]
        keep &= np.isfinite(frame[["t", *signals]].to_numpy()).all(axis=1)
        breaks[1:] |= ~keep[:-1] | ~(np.abs(np.diff(t) - dt) <= 1e-3 * dt)
    elif not own.cut:
        return [frame]
    if keep.all() and not breaks.any():
        return [frame]
    parts = [part[keep[part.index]] for _, part in frame.groupby(np.cumsum(breaks))]
    return [part for part in parts if len(part) >= _SPLIT_FEWEST]
