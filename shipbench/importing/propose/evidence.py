"""Consistency of the columns: the track's direction and speed against heading, yaw rate and speeds.

Heads often name no unit, or one word for heading and course. A ship moves about in the direction of her heading, at the
logged speed, and her heading changes by the yaw rate. A unit, axis or clock that contradicts this is reported; where
the head leaves it open, the one that agrees is chosen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import InputError
from ...units import unit_factor
from ..cells import Counts
from ..channels import read_blocks
from ..clock import RELATIVE
from ..entries import Channel
from ..mapping import Source
from ..position import to_plane
from ..thresholds import THRESHOLDS
from .assign import Assigned, Entry
from .clock import Time
from .columns import Sample

_TURNING = np.deg2rad(THRESHOLDS.value("turning_range"))
_CLOSE = THRESHOLDS.value("same_speed")
_UNITS = {"rad": ("deg", "rad", "cdeg"), "rad/s": ("rad/s", "deg/s", "deg/min"), "m/s": ("m/s", "kn", "km/h", "ft/s")}
_CLOCKS = ("ms", "us", "min", "h")


@dataclass(frozen=True)
class _Track:
    """Track in windows: times (m,) [s], direction from north [rad], speed [m/s]; only where the ship moves."""

    t: np.ndarray
    direction: np.ndarray
    speed: np.ndarray


def examine(sample: Sample, time: Time, found: Assigned, extra: dict[str, Any]) -> None:
    """Correct units, axes and the meaning of a course in `found`, and the unit of a clock without one in `time`, where
    the columns agree on them."""
    specs = {e.channel: e.spec for e in found.entries.values() if not e.missing}
    try:
        source = Source(time=time.spec, file=sample.file, channels=specs, **extra)
        series = _series(sample, source)
    except (InputError, ValueError):  # the trial of the draft tells it
        return
    track = _track(series)
    if track is not None and _in_radians(track, series, found):
        channels = {e.channel: e.spec for e in found.entries.values() if not e.missing}
        series = _series(sample, Source(time=time.spec, file=sample.file, channels=channels, **extra))
        track = _track(series)
    if track is not None and "psi" in series:
        before = dict(found.entries["psi"].spec)
        _heading(track, series, found)
        if "psi" in found.entries and found.entries["psi"].spec != before:
            series = _series(
                sample, source.model_copy(update={"channels": {"psi": Channel(**found.entries["psi"].spec)}})
            ) | {channel: values for channel, values in series.items() if channel != "psi"}
    if "psi" in found.entries and "r" in series and "psi" in series:
        _yaw_rate(series, found)
    if track is not None:
        _clock_unit(track, series, time, found)
        for channel in ("sog", "u"):
            if channel in series and channel in found.entries:
                _speed(channel, track, series, found)
        _sway(track, series, found)


def _series(sample: Sample, source: Source) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Times and values of each channel in standard units, by the import's own reader; of a log with several runs the
    first."""
    first: str | None = None
    t: list[np.ndarray] = []
    values: list[np.ndarray] = []
    rows = 0
    for name, block in read_blocks(sample.path, source, Counts()):
        first = name if not t else first
        if name == first:
            t.append(block.t)
            values.append(block.values)
        rows += len(block.t)
        if rows > THRESHOLDS.count("proposal_rows"):
            break
    if not t:
        return {}
    at, table = np.concatenate(t), np.vstack(values)
    order = np.argsort(at, kind="stable")
    at, table = at[order], table[order]
    there = {name: np.isfinite(table[:, j]) for j, name in enumerate(source.channels)}
    return {name: (at[keep], table[keep, j]) for j, (name, keep) in enumerate(there.items()) if keep.sum() > 5}


def _track(series: dict[str, tuple[np.ndarray, np.ndarray]]) -> _Track | None:
    pair = ("x", "y") if "x" in series and "y" in series else ("lat", "lon")
    if pair[0] not in series or pair[1] not in series:
        return None
    (ta, a), (tb, b) = series[pair[0]], series[pair[1]]
    t, first, second = np.intersect1d(ta, tb, return_indices=True)
    x, y = a[first], b[second]
    if pair == ("lat", "lon") and len(t):
        x, y = to_plane(x, y, (x[0], y[0]))
    moved = np.r_[True, (np.diff(x) != 0) | (np.diff(y) != 0)]  # a fix that is repeated until the next is one fix
    t, x, y = t[moved], x[moved], y[moved]
    if len(t) < THRESHOLDS.count("track_samples"):
        return None
    window = max(THRESHOLDS.value("track_window"), 2.0 * float(np.median(np.diff(t))))
    window = min(window, (t[-1] - t[0]) / THRESHOLDS.count("track_windows"))
    ends = np.searchsorted(t, t + window)
    starts = np.flatnonzero(ends < len(t))
    ends = ends[starts]
    lasted = t[ends] - t[starts]
    near = (lasted > 0) & (lasted < 3 * window)
    starts, ends, lasted = starts[near], ends[near], lasted[near]
    if len(starts) < THRESHOLDS.count("track_least"):
        return None
    north, east = x[ends] - x[starts], y[ends] - y[starts]
    speed = np.hypot(north, east) / lasted
    moving = speed > THRESHOLDS.value("moving_track") * np.quantile(speed, THRESHOLDS.value("moving_quantile"))
    return _Track(0.5 * (t[starts] + t[ends])[moving], np.arctan2(east, north)[moving], speed[moving])


def _heading(track: _Track, series: dict[str, tuple[np.ndarray, np.ndarray]], found: Assigned) -> None:
    entry = found.entries["psi"]
    if "as given" in entry.why or ("x" in found.entries and "as given" in found.entries["x"].why):
        return
    factor = unit_factor("psi", entry.spec.get("unit", "rad"))
    raw = (series["psi"][0], series["psi"][1] / factor)
    named = bool(entry.columns[0].head.units.get("angle")) or "quaternion" in entry.spec
    units = ("rad",) if "quaternion" in entry.spec else (entry.spec["unit"],) if named else _UNITS["rad"]
    scores = {}
    for unit in units:
        psi = _at(track.t, raw[0], np.unwrap(raw[1] * unit_factor("psi", unit)))
        for turned in (False, True):
            for axes, way in _ways(track.direction, found).items():
                scores[unit, turned, axes] = float(np.mean(np.cos(way - (np.pi / 2 - psi if turned else psi))))
    spread = float(np.ptp(np.unwrap(track.direction)))
    plain = {k: v for k, v in scores.items() if k[1:] == (False, "")}
    best, agrees = max(plain, key=lambda k: plain[k]), THRESHOLDS.value("heading_agrees")
    if plain[best] >= agrees:
        _settle_unit(entry, best[0], plain[best], found)
        _heading_or_course(
            entry, _at(track.t, raw[0], np.unwrap(raw[1] * unit_factor("psi", best[0]))), track, spread, found
        )
        return
    any_way = max(scores, key=lambda k: (round(scores[k], 2), -bool(k[1]), -len(k[2])))
    degrees = np.rad2deg(np.arccos(np.clip(plain[best], -1, 1)))
    if scores[any_way] >= agrees and spread > _TURNING:
        _turn(entry, any_way, found)
        entry.why.append(
            f"NOT SURE: only so the heading agrees with the track (as it stands they are {degrees:.0f} deg apart)"
        )
        return
    found.notes.append(
        f"NOT SURE: heading '{entry.columns[0].name}' and the direction of the track are {degrees:.0f} deg apart; "
        "check both."
    )


def _ways(direction: np.ndarray, found: Assigned) -> dict[str, np.ndarray]:
    """Directions of the track with its axes as they are (""), and in the other ways that the heads leave open."""
    ways = {"": direction}
    named = {word for c in ("x", "y") if c in found.entries for word in found.entries[c].columns[0].head.base} & _AXES
    if "x" in found.entries and not named:
        ways["exchanged"] = np.pi / 2 - direction
    if "lat" in found.entries and not {"sign", "hemisphere"} & {*found.entries["lat"].spec, *found.entries["lon"].spec}:
        ways |= {"south": np.pi - direction, "west": -direction, "south and west": np.pi + direction}
    return ways


_AXES = {
    "north",
    "northing",
    "east",
    "easting",
    "nord",
    "norte",
    "ost",
    "est",
    "este",
    "n",
    "e",
    "hochwert",
    "rechtswert",
}


def _turn(entry: Entry, way: tuple[str, bool, str], found: Assigned) -> None:
    """Write into the draft the axes and the sense of the heading with which heading and track agree."""
    unit, turned, axes = way
    if "quaternion" not in entry.spec:
        entry.spec["unit"] = unit
    if turned:
        entry.spec |= {"sign": "counterclockwise", "offset": round(-np.pi / 2 / unit_factor("psi", unit), 6)}
        found.notes.append(
            f"NOT SURE: '{entry.columns[0].name}' counts from east, counter-clockwise: only so it agrees with the "
            "track."
        )
    if axes == "exchanged":
        x, y = found.entries["x"], found.entries["y"]
        x.spec["column"], y.spec["column"] = y.spec["column"], x.spec["column"]
        x.columns, y.columns = y.columns, x.columns
        found.notes.append(
            f"NOT SURE: x and y are exchanged: '{x.spec['column']}' is taken as north. Only so heading and track agree."
        )
    for word, channel in (("south", "lat"), ("west", "lon")):
        if word in axes:
            found.entries[channel].spec["sign"] = word
            found.notes.append(
                f"NOT SURE: {channel} is taken as positive to the {word}: only so heading and track agree."
            )


def _settle_unit(entry: Entry, unit: str, score: float, found: Assigned) -> None:
    if "quaternion" in entry.spec:
        return
    if entry.spec["unit"] != unit:
        entry.spec["unit"] = unit
    entry.why.append(f"agrees with the track's direction (mean cosine {score:.2f})")
    _no_doubt_of_unit(entry, found)


def _heading_or_course(entry: Entry, psi: np.ndarray, track: _Track, spread: float, found: Assigned) -> None:
    """Decide on a column that may be heading or course: it is the course where it follows the track through turns."""
    if not any("may be heading or course" in why for why in entry.why) or spread < _TURNING:
        return
    apart = float(np.sqrt(np.mean(np.angle(np.exp(1j * (track.direction - psi))) ** 2)))
    name = entry.columns[0].name
    if apart < np.deg2rad(THRESHOLDS.value("course_agrees")):
        del found.entries["psi"]
        found.notes[:] = [n for n in found.notes if f"'{name}' may be the heading" not in n]
        found.notes.append(
            f"'{name}' follows the track within {np.rad2deg(apart):.2g} deg through turns: it is the course, no "
            "heading."
        )
        return
    entry.why.append(f"{np.rad2deg(apart):.2g} deg r.m.s. from the track's direction, as a drifting hull's heading is")


def _yaw_rate(series: dict[str, tuple[np.ndarray, np.ndarray]], found: Assigned) -> None:
    entry = found.entries["r"]
    t, psi = series["psi"]
    psi = np.unwrap(psi)
    at, r = series["r"]
    window = max(THRESHOLDS.value("yaw_window"), 2.0 * float(np.median(np.diff(at))))
    inside = at[(at >= t[0] + window) & (at <= t[-1] - window)]
    if len(inside) < THRESHOLDS.count("track_samples"):
        return
    change = (np.interp(inside + window / 2, t, psi) - np.interp(inside - window / 2, t, psi)) / window
    # Leave out where a heading was interpolated across 360/0.
    fast = THRESHOLDS.value("steady_rate") * np.quantile(np.abs(change), THRESHOLDS.value("moving_quantile"))
    steady = np.abs(change) <= fast
    change, rate = change[steady], _mean_over(inside[steady], at, r, window)
    if np.std(change) == 0 or np.std(rate) == 0:
        return
    correlation = float(np.corrcoef(change, rate)[0, 1])
    if abs(correlation) < THRESHOLDS.value("yaw_correlation"):
        return
    ratio = float(np.sum(change * rate) / np.sum(rate * rate))
    _settle(entry, "r", ratio, "the change of the heading", found)
    if correlation < 0 and "sign" not in entry.spec and "as given" not in entry.why:
        entry.spec["sign"] = "port"
        entry.why.append("NOT SURE: positive to port, against the change of the heading")
        found.notes.append(
            f"NOT SURE: '{entry.columns[0].name}' is taken as positive to port: it runs against the change of the "
            "heading."
        )


def _mean_over(times: np.ndarray, at: np.ndarray, values: np.ndarray, window: float) -> np.ndarray:
    return np.mean([np.interp(times + shift * window, at, values) for shift in (-0.5, -0.25, 0.0, 0.25, 0.5)], axis=0)


def _speed(channel: str, track: _Track, series: dict[str, tuple[np.ndarray, np.ndarray]], found: Assigned) -> None:
    recorded = np.abs(_at(track.t, *series[channel]))
    moving = recorded > THRESHOLDS.value("moving_log") * np.quantile(recorded, THRESHOLDS.value("moving_quantile"))
    if moving.sum() >= THRESHOLDS.count("track_least"):
        _settle(
            found.entries[channel],
            channel,
            float(np.median(track.speed[moving] / recorded[moving])),
            "the track",
            found,
        )


def _sway(track: _Track, series: dict[str, tuple[np.ndarray, np.ndarray]], found: Assigned) -> None:
    """Set the unit of v from the track beside the heading; where these are too coarse for it, the unit of u."""
    v, u = found.entries.get("v"), found.entries.get("u")
    if v is None or "v" not in series or "psi" not in found.entries or "psi" not in series:
        return
    beside = track.speed * np.sin(track.direction - _at(track.t, series["psi"][0], np.unwrap(series["psi"][1])))
    recorded = _at(track.t, *series["v"])
    moves = np.std(beside) > 0 and np.std(recorded) > 0
    if moves and np.corrcoef(beside, recorded)[0, 1] > THRESHOLDS.value("sway_correlation"):
        _settle(v, "v", float(np.sum(beside * recorded) / np.sum(recorded**2)), "the track beside the heading", found)
    elif u and not u.columns[0].head.units and not v.columns[0].head.units and "as given" not in v.why:
        v.spec["unit"] = u.spec["unit"]
        v.why.append("the unit of u")
        _no_doubt_of_unit(v, found)
        found.notes.append(
            f"NOT SURE: the head of '{v.columns[0].name}' names no unit; v is taken in the unit of u, {u.spec['unit']}."
        )


def _no_doubt_of_unit(entry: Entry, found: Assigned) -> None:
    found.notes[:] = [
        n for n in found.notes if not n.startswith(f"NOT SURE: the head of '{entry.columns[0].name}' names no unit")
    ]


def _settle(entry: Entry, channel: str, ratio: float, what: str, found: Assigned) -> None:
    """Set the unit with which the channel is `ratio` times its present value; a unit that the head names is kept and
    the difference reported."""
    if "as given" in entry.why or not entry.columns:
        return
    like = "u" if channel == "sog" else channel
    now = unit_factor(like, entry.spec["unit"])
    units = {u: unit_factor(like, u) / now for u in _UNITS["rad/s" if channel == "r" else "m/s"]}
    unit = min(units, key=lambda u: abs(np.log(units[u] / abs(ratio)))) if ratio else entry.spec["unit"]
    fits = ratio != 0 and abs(np.log(units[unit] / abs(ratio))) < _CLOSE
    name, named = entry.columns[0].name, entry.columns[0].head.units
    if fits and (not named or unit == entry.spec["unit"]):
        entry.spec["unit"] = unit
        entry.why = [w for w in entry.why if not w.startswith("unit NOT SURE")] + [f"unit {unit} agrees with {what}"]
        _no_doubt_of_unit(entry, found)
    elif fits:
        found.notes.append(f"NOT SURE: '{name}' says {entry.spec['unit']}; {what} says {unit}. The head is kept.")
    elif abs(np.log(abs(ratio) or 1e-9)) > 2 * _CLOSE:
        found.notes.append(
            f"NOT SURE: '{name}' and {what} differ by a factor of {abs(ratio):.3g}, which is no unit that is accepted."
        )


def _in_radians(track: _Track, series: dict[str, tuple[np.ndarray, np.ndarray]], found: Assigned) -> bool:
    """Take latitude and longitude in radians where only so the track is as fast as the recorded speed."""
    pair = [found.entries[c] for c in ("lat", "lon") if c in found.entries]
    channel = next(
        (c for c in ("sog", "u") if c in series and c in found.entries and found.entries[c].columns[0].head.units), None
    )
    if (
        channel is None
        or len(pair) < 2
        or any(e.spec["unit"] != "deg" or e.columns[0].head.units or "as given" in e.why for e in pair)
    ):
        return False
    ratio = float(np.median(np.abs(_at(track.t, *series[channel]))) / np.median(track.speed))
    if abs(np.log(ratio * unit_factor("psi", "deg"))) > _CLOSE:
        return False
    for entry in pair:
        entry.spec["unit"] = "rad"
    found.notes.append(
        "NOT SURE: latitude and longitude are taken in radians: only so the track is as fast as the recorded speed."
    )
    return True


def _clock_unit(track: _Track, series: dict[str, tuple[np.ndarray, np.ndarray]], time: Time, found: Assigned) -> None:
    """Set the unit of a clock without one from the time that the ship needs for the distance."""
    channel = next(
        (c for c in ("sog", "u") if c in series and c in found.entries and found.entries[c].columns[0].head.units), None
    )
    if channel is None or "no unit" not in time.why:
        return
    recorded = np.abs(_at(track.t, *series[channel]))
    ratio = float(np.median(recorded) / np.median(track.speed))
    for form in _CLOCKS:
        if abs(np.log(ratio * RELATIVE[form])) < _CLOSE:
            time.spec["format"] = form
            found.notes.append(
                f"NOT SURE: the time is taken in {form}: only so the ship runs along her track at the recorded speed."
            )


def _at(times: np.ndarray, t: np.ndarray, values: np.ndarray) -> np.ndarray:
    return np.interp(times, t, values)
