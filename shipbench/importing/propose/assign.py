"""Assignment of columns to channels: by their heads, and where a head is ambiguous by their cells."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..entries import unit_of
from ..thresholds import THRESHOLDS
from .columns import Column
from .heads import QUANTITIES

_PORT, _PLUS = "(port|ps|bb|backbord|babord|babor)", "pos(itive|itiv|itif)?"
_TO_PORT = rf"\b{_PORT} ?(is|=)? ?(\+|{_PLUS}\b)|(\+|\b{_PLUS}) ?(is|=|to|nach|a)? ?{_PORT}\b"
_SIDED = ("v", "r", "delta", "delta_c", "F_b", "F_b_c", "F_s", "F_s_c")
_SIDES = ({"+port", "+starboard"}, {"+first", "+second"})
_PAIRS = (
    ("lat", "lon"),
    ("x", "y"),
    ("sog", "cog"),
    ("wind_speed", "wind_from"),
    ("apparent_wind_speed", "apparent_wind_from"),
)
_LATLON = re.compile(
    r"(?:(?i:POINT) ?)?[(\[{ ]*[NSEW]?([-+]?\d+[.,]\d+)[ °]*[NSEW]?[\s,;/]+[NSEW]?([-+]?\d+[.,]\d+)[ °]*[NSEW]?[)\]} ]*"
)

_LETTERED = re.compile(r"[NSEWOnsewo]?\s*[-+]?\d[\d.,°'\"\u2032\u2033 ]*\s*[NSEWOnsewo]?")
"""Pattern of a coordinate with the letter of its hemisphere before or after it."""


@dataclass
class Entry:
    """Channel of the draft: its keys in the mapping, the reasons, its columns.

    `missing` says what a person must add before it can be imported ("" where nothing is); the draft then has it as a
    comment.
    """

    channel: str
    spec: dict[str, Any]
    columns: tuple[Column, ...]
    why: list[str] = field(default_factory=list)
    missing: str = ""


@dataclass
class Assigned:
    """Channels of a log, the column of its runs, and further notes."""

    entries: dict[str, Entry] = field(default_factory=dict)
    run: str | None = None
    notes: list[str] = field(default_factory=list)
    helpers: set[str] = field(default_factory=set)
    candidates: dict[str, Column] = field(default_factory=dict)

    def used(self) -> set[str]:
        """Names of the columns in use."""
        return (
            {c.name for e in self.entries.values() for c in e.columns}
            | self.helpers
            | ({self.run} if self.run else set())
        )


def assign(columns: Sequence[Column], kept: dict[str, Any], run: str | None = None) -> Assigned:
    """Assign channels to `columns`; `kept` are the [channels] of a partial mapping, whose channels and columns are not
    assigned again."""
    found = Assigned(run=run)
    by_name = {c.name: c for c in columns}
    for channel, spec in kept.items():
        names = [n for key in ("column", "mean", "sum", "diff", "atan2", "quaternion") for n in _names(spec.get(key))]
        found.entries[channel] = Entry(
            channel, dict(spec), tuple(by_name[n] for n in names if n in by_name), ["as given"]
        )
        found.helpers |= {spec["hemisphere"]} if "hemisphere" in spec else set()
    free = [c for c in columns if c.name not in found.used()]
    if run is None:
        found.run = _run_column(free)
    _positions(free, found)
    _quaternion(free, found)
    for column in free:
        if column.head.meaning in (
            "heading or course",
            "speed",
            "psi magnetic",
            "stw",
            "north velocity",
            "east velocity",
        ):
            found.candidates.setdefault(column.head.meaning, column)
    for named in dict.fromkeys(c.head.channel for c in free):
        if named is not None and named not in found.entries:
            _take(
                named,
                [
                    c
                    for c in free
                    if c.head.channel == named and c.head.fits and c.name not in found.used() and _holds(c, found)
                ],
                found,
            )
    _ambiguous(found)
    _complete_pairs(found, kept)
    return found


def _names(value: Any) -> list[str]:
    return [value] if isinstance(value, str) else list(value or ())


def _holds(column: Column, found: Assigned) -> bool:
    """Whether a column holds numbers at all; a named one without is reported."""
    cells = column.texts()
    if len(column.known) >= THRESHOLDS.value("numeric_share") * max(len(cells), 1):
        return True
    if column.head.channel in ("lat", "lon") and 2 * sum(bool(_LETTERED.fullmatch(cell)) for cell in cells) > len(
        cells
    ):
        return True
    if cells:
        found.notes.append(
            f"'{column.name}' is named like {column.head.channel} and holds no numbers ({column.evidence()}); not "
            "taken."
        )
    return False


def _run_column(columns: Sequence[Column]) -> str | None:
    """Find a column of runs or of vessels: few values, each many times."""
    for meaning in ("run", "vessel"):
        for column in columns:
            cells = column.texts(len(column.cells))
            few = 0 < len(set(cells)) <= THRESHOLDS.value("values_per_row") * len(cells)
            if (
                column.head.meaning == meaning
                and column.head.sure
                and few
                and (len(set(cells)) > 1 or meaning == "run")
            ):
                return column.name
    return None


def _positions(columns: Sequence[Column], found: Assigned) -> None:
    """Assign latitude and longitude with hemispheres of their own or both in one cell, and columns N and E that are no
    shaft speed."""
    sides = {}
    for column in columns:
        letters = {text.upper() for text in column.texts()}
        for channel, accepted in (("lat", {"N", "S"}), ("lon", {"E", "W", "O"})):
            if letters and letters <= accepted:
                sides[channel] = column
    for channel, column in sides.items():
        found.candidates[f"{channel} side"] = column
    if not any(c.head.channel == "lat" for c in columns):
        for column in columns:
            cells = column.texts(200)
            if (
                column.head.meaning in ("latlon", "lat", None)
                and not len(column.known)
                and cells
                and all(_LATLON.fullmatch(t) for t in cells)
            ):
                _both_in_one(column, cells, found)
                break
    north, east = ({c.name: c for c in columns}.get(name) for name in ("N", "E"))
    if north and east and "x" not in found.entries and not any(c.head.channel == "x" for c in columns):
        for channel, column in (("x", north), ("y", east)):
            found.entries[channel] = Entry(
                channel, {"column": column.name, "unit": "m"}, (column,), ["N and E: north and east in m"]
            )


def _both_in_one(column: Column, cells: list[str], found: Assigned) -> None:
    first, second = (
        max(abs(float(m[k].replace(",", "."))) for t in cells if (m := _LATLON.fullmatch(t))) for k in (1, 2)
    )
    lat_first = (
        first <= 90 and not re.search(r"(?i)lon\w*\W+lat", column.name) and not cells[0].upper().startswith("POINT")
    )
    for channel, part in (("lat", 1 if lat_first else 2), ("lon", 2 if lat_first else 1)):
        found.entries[channel] = Entry(
            channel,
            {"column": column.name, "part": part, "unit": "deg"},
            (column,),
            [f"number {part} of cells such as '{cells[0]}'"],
        )
    if first <= 90 and second <= 90 and not re.search(r"[NSEW]|POINT", cells[0].upper()):
        found.notes.append(
            f"NOT SURE: '{column.name}': the {'first' if lat_first else 'second'} number is taken as the latitude "
            f"('{cells[0]}')."
        )


def _quaternion(columns: Sequence[Column], found: Assigned) -> None:
    parts = {c.head.meaning: c for c in columns if c.head.meaning in ("qx", "qy", "qz", "qw")}
    if len(parts) == 4 and "psi" not in found.entries and not any(c.head.channel == "psi" for c in columns):
        four = tuple(parts[k] for k in ("qx", "qy", "qz", "qw"))
        found.entries["psi"] = Entry(
            "psi", {"quaternion": [c.name for c in four]}, four, ["heading of a quaternion x, y, z, w"]
        )
        found.notes.append("NOT SURE: the quaternion is taken as body to earth, with north and east as its axes.")


def _take(channel: str, columns: list[Column], found: Assigned) -> None:
    """Assign the column, or the pair of port and starboard, to a channel."""
    if not columns:
        return
    if channel.removesuffix("_c") in ("n", "delta"):
        for sides in _SIDES:
            pair = [
                next((c for c in columns if side in c.head.qualifiers and not sides - {side} & c.head.qualifiers), None)
                for side in sorted(sides)
            ]
            if pair[0] and pair[1] and pair[0].head.base == pair[1].head.base:
                both = (pair[0], pair[1])
                found.entries[channel] = Entry(channel, {"mean": [c.name for c in both]}, both, ["mean of the two"])
                return
    best = max(
        columns,
        key=lambda c: (c.head.sure, c.head.meaning != "psi magnetic", "+order" in c.head.qualifiers, -columns.index(c)),
    )
    entry = Entry(channel, {"column": best.name}, (best,))
    if best.head.meaning == "psi magnetic":
        entry.why.append("MAGNETIC heading: add the variation as offset, in the unit of the column")
        found.notes.append(
            f"'{best.name}' is a magnetic heading; true heading is needed. Write its variation as `offset`."
        )
    if not best.head.sure:
        found.notes.append(f"NOT SURE: '{best.name}' is taken as {channel} by a part of its name.")
    found.entries[channel] = entry
    if rest := [c.name for c in columns if c is not best]:
        found.notes.append(f"{channel} is taken from '{best.name}'; also possible: {', '.join(rest[:4])}.")


def _ambiguous(found: Assigned) -> None:
    """Assign a course that may be the heading, and a speed that may be over ground or through the water."""
    course, speed = found.candidates.get("heading or course"), found.candidates.get("speed")
    if course is not None and course.head.channel is None and course.name not in found.used():
        channel = (
            "psi"
            if "psi" not in found.entries and "cog" in found.entries
            else "cog"
            if "psi" in found.entries
            else "psi"
        )
        if channel not in found.entries:
            other = (
                "a course over ground is there, too"
                if "cog" in found.entries
                else "a heading is there, too"
                if channel == "cog"
                else ""
            )
            entry = Entry(
                channel,
                {"column": course.name},
                (course,),
                [f"'{course.name}' may be heading or course{'; ' + other if other else ''}"],
            )
            found.entries[channel] = entry
            if not other:
                found.notes.append(
                    f"NOT SURE: '{course.name}' may be the heading or the course over ground; taken as the heading."
                )
    if speed is not None and "sog" not in found.entries and "cog" in found.entries and "u" not in found.entries:
        found.entries["sog"] = Entry(
            "sog", {"column": speed.name}, (speed,), ["taken as speed over ground, since a course is there"]
        )
        found.notes.append(
            f"NOT SURE: '{speed.name}' is taken as speed over ground. Leave out sog and cog if it is through the water."
        )


def _complete_pairs(found: Assigned, kept: dict[str, Any]) -> None:
    """Remove channels that serve only in pairs, and a position that is given twice."""
    for a, b in _PAIRS:
        for here, gone in ((a, b), (b, a)):
            if here in found.entries and gone not in found.entries and here not in kept:
                name = found.entries.pop(here).columns[0].name
                found.notes.append(f"'{name}' is not taken: {here} serves only together with {gone}.")
    if {"lat", "lon", "x", "y"} <= set(found.entries):
        drop = ("lat", "lon") if {"x", "y"} & set(kept) else ("x", "y")
        names = [found.entries.pop(channel).columns[0].name for channel in drop]
        found.notes.append(
            f"The position is there twice; {' and '.join(names)} are not taken. To take them instead, replace lat "
            "and lon by x and y."
        )
    if speeds := [
        c.name
        for m, c in found.candidates.items()
        if m in ("north velocity", "east velocity") and c.name not in found.used()
    ]:
        found.notes.append(
            f"{', '.join(speeds)} are velocities in earth axes and not taken; u and v come from the track. To take "
            'them, map them as u and v, and write velocities = "earth" into dataset.toml.'
        )
    psi, x = found.entries.get("psi"), found.entries.get("x")
    if (
        psi
        and x
        and "yaw" in psi.columns[0].head.base
        and x.columns[0].head.base in (("x",), ("pose", "position", "x"), ("pos", "x"), ("position", "x"))
    ):
        found.notes.append(
            "NOT SURE: x is taken as north and yaw as clockwise from it. ROS has x east, y north and yaw "
            "counter-clockwise from east."
        )
    if (speed := found.candidates.get("stw")) is not None and speed.name not in found.used():
        found.notes.append(f"'{speed.name}' is a speed through the water; u and v are over ground, so it is not taken.")


def sign_of(entry: Entry) -> None:
    """Note in the entry that its head counts to port."""
    if entry.columns and "sign" not in entry.spec and counts_to_port(entry.channel, entry.columns[0].name):
        entry.spec["sign"] = "port"
        entry.why.append("positive to port, from the name")


def counts_to_port(channel: str, text: str) -> bool:
    """Whether a name or description says that a channel is positive to port."""
    return channel in _SIDED and re.search(_TO_PORT, text.lower().replace("_", " ")) is not None


def quantity(channel: str) -> str:
    """Kind of unit of a channel, as in units.csv."""
    return QUANTITIES[unit_of(channel)]
