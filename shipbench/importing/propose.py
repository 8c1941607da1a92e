"""A draft of mapping.toml from the names and values of a log's columns; every guess is called one in the file, for a person to check."""

from __future__ import annotations

import itertools
import json
import os
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .entries import CHANNELS, unit_of
from .mapping import Layout
from .tables import Table, open_table
from .writer import run_name

_UNITS = {
    "m": "m", "meter": "m", "metre": "m", "km": "km", "ft": "ft", "nmi": "nmi", "m/s": "m/s", "mps": "m/s", "kn": "kn", "kt": "kn", "kts": "kn",
    "knots": "kn", "knot": "kn", "km/h": "km/h", "rad": "rad", "deg": "deg", "°": "deg", "degree": "deg", "degrees": "deg", "rad/s": "rad/s",
    "deg/s": "deg/s", "°/s": "deg/s", "dps": "deg/s", "deg/min": "deg/min", "°/min": "deg/min", "rpm": "rpm", "1/min": "rpm", "rev/s": "rev/s",
    "rps": "rev/s", "1/s": "rev/s", "hz": "rev/s", "n": "N",
}  # fmt: skip
_TIMES = {"s": "s", "sec": "s", "ms": "ms", "us": "us", "min": "min", "h": "h"}
# Channel, words of a name (any of them, in order of trust). The first rule that fits a name wins; the first column that fits a channel is taken.
_RULES: tuple[tuple[str, str], ...] = (
    ("lat", r"\blat(itude)?\b"), ("lon", r"\b(lon|long|lng|longitude)\b"),
    ("apparent_wind_speed", r"\b(aws|(apparent|relative|rel) wind (speed|velo\w*)|wind (speed|velo\w*) (apparent|relative|rel)\b.*)"),
    ("apparent_wind_from", r"\b(awa|(apparent|relative|rel) wind (dir\w*|angle)|wind (dir\w*|angle) (apparent|relative|rel)\b.*)"),
    ("wind_speed", r"\b(tws|(true )?wind (speed|velo\w*)( true)?)\b"), ("wind_from", r"\b(twd|(true )?wind (dir\w*|from)( true)?)\b"),
    ("sog", r"\b(sog|speed over ground|gps speed|ground speed)\b"), ("cog", r"\b(cog|course( over ground)?|track angle)\b"),
    ("r", r"\b(rot|r|rate of turn|yaw rate|r angvelo|gyro z)\b"), ("psi", r"\b(psi|hdg|hdt|heading|yaw|psi hat|true heading)\b"),
    ("delta_c", r"\b(delta c|rudder (order|command|cmd|set\w*|demand)|(order\w*|command\w*|cmd) rudder( angle)?)\b"),
    ("n_c", r"\b(n c|rpm (order|command|cmd|set\w*|demand)|(order\w*|command\w*|cmd) (rpm|revs))\b"),
    ("delta", r"\b(delta|rudder|rudder angle|delta rudder|rsa)\b"),
    ("n", r"\b(n|rpm|n prop|shaft (speed|rpm)|propeller (speed|rpm|revs)|revs)\b|^shaft$"),
    ("F_b_c", r"\b(f b c|bow thruster (order|command|cmd|set\w*))\b"), ("F_s_c", r"\b(f s c|stern thruster (order|command|cmd|set\w*))\b"),
    ("F_b", r"\b(f b|bow thruster( force)?)\b"), ("F_s", r"\b(f s|stern thruster( force)?)\b"),
    ("depth", r"\b(depth|water depth)\b"), ("x", r"\b(x|north|northing|x position( mid)?|pos x)\b"),
    ("y", r"\b(y|east|easting|y position( mid)?|pos y)\b"), ("u", r"\b(u|u velo|surge( speed| velocity)?|u vel\w*)\b"),
    ("v", r"\b(v|vm|v velo|vm velo|sway( speed| velocity)?|v vel\w*)\b"),
)  # fmt: skip
_TIME_RULE = r"\b(t|time|timestamp|date ?time|utc|datetime|time ?stamp|clock|seconds|secs?|unix ?time|epoch)\b"
_SIDED = ("v", "r", "delta", "delta_c", "F_b", "F_b_c", "F_s", "F_s_c")
_TO_PORT = r"\b(port|ps) ?(is|=)? ?(\+|pos(itive)?\b)|(\+|\bpos(itive)?) ?(is|=|to)? ?(port|ps)\b"
_ACCEPTED = {"m": "m, km, ft, nmi", "m/s": "m/s, kn, km/h, ft/s", "rad": "rad, deg", "rad/s": "rad/s, deg/s, deg/min", "rpm": "rpm, rev/s, rad/s",
             "N": "N, kN, MN, tf"}  # fmt: skip
_ROWS = 4000
_SLOW = 5.0
"""Channels with longer steps [s] get a limit of their own, so that theirs does not become that of all."""


@dataclass(frozen=True)
class _Column:
    """A column's name, its words and bracketed unit, and the numbers at its beginning (NaN where there is none)."""

    name: str
    words: str
    unit: str
    values: np.ndarray
    text: str


def write_proposal(logs: Sequence[Path], path: Path, force: bool = False) -> list[str]:
    """Write a draft mapping for `logs` to `path`; return lines that say what is guessed and what is missing.

    The first log is read; logs with other columns each become a source.

    Raises:
        InputError: a log cannot be read, no column can be the time, or `path` is there already and `force` is not set.
    """
    if path.exists() and not force:
        raise InputError(f"{path} is there already. Give --propose another name, or --force to replace it.")
    kinds: dict[tuple[str, ...], Path] = {}
    for log in logs:
        kinds.setdefault(open_table(log, Layout()).columns, log)
    drafts = [_draft(log) for log in kinds.values()]
    lines: list[str] = []
    seen: set[str] = set()
    head = [
        "# Draft by `shipbench data import --propose`. Every entry is a GUESS from names and values: check each unit, sign and time.",
        "# Signs: psi clockwise from north, r bow to starboard, v to starboard; a positive rudder angle turns the ship to starboard.",
        '# Where the log counts the other way: sign = "port" (r, v, delta, thrusters), "counterclockwise" (psi), "west", "south", "astern".',
        f"# Channels: {', '.join(CHANNELS)}.",
        f"name = {_quoted(run_name(next(iter(kinds.values())).name.split('.')[0]))}",
        f"dt = {_guess_dt(drafts):g}  # GUESS: sample time of the data set [s]",
        "",
        "[split]",
        f"gap = {max(3.0, *(3 * d.step for d in drafts if d.step <= _SLOW)):g}  # GUESS: longer pauses between samples [s] split runs; never bridged",
        "# window = 300.0       # cut into windows of that length [s]",
        "# still_speed = 0.1    # leave out where the ship lies still: slower than that [m/s] ...",
        "# still_time = 60.0    # ... for that long [s]",
    ]
    body: list[str] = []
    for k, draft in enumerate(drafts):
        prefix = "" if len(drafts) == 1 else f"sources.source{k + 1}."
        known = len(seen)
        lines_of_source = draft.toml(prefix, seen)
        if prefix and len(seen) == known:  # nothing in it was recognised: for the reader to complete
            lines_of_source = [f"# {line}".rstrip() for line in lines_of_source]
        body += ["", *lines_of_source]
        lines += draft.remarks
    lines += _missing(seen)
    text = "\n".join([*head, *body, "", *(f"# {line}" for line in lines)]) + "\n"
    fresh = path.with_name(f".{path.name}.tmp")
    try:
        fresh.write_text(text, encoding="utf-8")
        os.replace(fresh, path)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}. Give --propose a path that can be written.") from None
    command = f"shipbench data import LOG --map {shlex.quote(str(path))} --ship ship.toml --out FOLDER"
    return [*lines, f"Draft: {path}. Check every line marked GUESS, then: {command}"]


def _guess_dt(drafts: list[_Draft]) -> float:
    return 0.5 if min(d.step for d in drafts) <= 0.5 else 1.0


def _missing(seen: set[str]) -> list[str]:
    lines = []
    if "psi" not in seen:
        lines.append("MISSING: no column was taken for psi, the heading; it is needed.")
    if not {"x", "y"} <= seen and not {"lat", "lon"} <= seen:
        lines.append("MISSING: no position was found; map x and y, or lat and lon.")
    if not {"n", "n_c"} & seen:
        lines.append("MISSING: no shaft speed (n or n_c) was found; without it, it is taken as zero.")
    if not {"delta", "delta_c"} & seen:
        lines.append("MISSING: no rudder angle (delta or delta_c) was found; without it, it is taken as zero.")
    if {"delta", "n"} & seen:
        lines.append("delta and n are measured positions; where the column is a command, write delta_c and n_c.")
    return lines


class _Draft:
    """The guesses for one kind of file."""

    def __init__(self, path: Path, columns: list[_Column], decimal: str, form: str) -> None:
        self.path, self.decimal, self.form = path, decimal, form
        self.remarks: list[str] = []
        self.time, self.step = self._guess_time(columns)
        names = [c.name for c in columns]
        self.columns = [c for c in columns if c.name and names.count(c.name) == 1 and c.name not in (self.time or ("",))[0]]

    def _guess_time(self, columns: list[_Column]) -> tuple[tuple[list[str], str] | None, float]:
        """((columns, format), usual step [s])."""
        for column in columns:
            if not re.search(_TIME_RULE, column.words) or re.search(r"\bzone\b", column.words):
                continue
            values = column.values[np.isfinite(column.values)]
            if len(values) > 1:
                kind, factor = _count_of(column.unit, values)
                steps = np.diff(values)
                return ([column.name], kind), float(np.median(steps[steps > 0])) * factor if (steps > 0).any() else 1.0
            if (stamp := _pattern(column.text)) is not None:
                return ([column.name], stamp), 1.0
            dates = [c for c in columns if re.search(r"\bdate\b", c.words) and c is not column]
            if dates and (stamp := _pattern(f"{dates[0].text} {column.text}")) is not None:
                return ([dates[0].name, column.name], stamp), 1.0
            if (clock := _clock_pattern(column.text)) is not None:
                return ([column.name], clock), 1.0
        self.remarks.append(f"MISSING: no column of {self.path.name} was taken for the time; write [time] column and format, or rate = 10.0 [Hz].")
        return None, 1.0

    def toml(self, prefix: str, seen: set[str]) -> list[str]:
        """Lines of the draft; `seen` gathers the channels that are taken."""
        lines = [f"# {self.path.name}: {self.form}"]
        if prefix:
            pattern = f"files = {_quoted(self.path.name)}  # GUESS: a pattern for all files of this kind, such as gps*.csv"
            lines += [f"[{prefix.rstrip('.')}]", pattern, ""]
        if self.decimal == ",":
            lines += [f"[{prefix}file]", 'decimal = ","  # GUESS: numbers have a decimal comma', ""]
        lines += [f"[{prefix}time]"]
        if self.time is None:
            lines += ['column = "?"  # MISSING']
        elif len(self.time[0]) == 2:
            lines += [f"columns = [{', '.join(map(_quoted, self.time[0]))}]"]
        else:
            lines += [f"column = {_quoted(self.time[0][0])}"]
        kind = self.time[1] if self.time else "s"
        accepted = "s, ms, us, min, h, unix, unix_ms, unix_us, excel, matlab, iso, or a pattern such as %d/%m/%Y %H:%M:%S.%f"
        lines += [f"format = {_quoted(kind)}  # GUESS; accepted: {accepted}"]
        if "%" in kind or kind == "iso":
            lines += ['# zone = "UTC"  # where the stamps have none']
        lines += ["", f"[{prefix}channels]"]
        left = []
        for column in self.columns:
            channel = next((c for c, rule in _RULES if re.search(f"^{rule}$", column.words)), None) or next(
                (c for c, rule in _RULES if len(column.words) > 3 and re.search(rule, column.words) and " " in column.words), None
            )
            if channel is None or channel in seen:
                left.append(column.name)
                continue
            seen.add(channel)
            unit, why = _guess_unit(channel, column)
            gap = f", gap = {3 * self.step:g}" if self.step > _SLOW else ""
            sign = ""
            if channel in _SIDED and re.search(_TO_PORT, column.name.lower().replace("_", " ")):
                sign, why = ', sign = "port"', f"{why}; positive to port, from the name"
            entry = f"{channel} = {{ column = {_quoted(column.name)}, unit = {_quoted(unit)}{sign}{gap} }}"
            lines.append(f"{entry}  # GUESS: {why}; {_range(column.values)}")
        if left:
            lines.append(f"# not taken: {', '.join(_quoted(name) for name in left[:40])}{' and more' if len(left) > 40 else ''}")
            self.remarks.append(f"{self.path.name}: {len(left)} columns were not taken: {', '.join(left[:8])}{' ...' if len(left) > 8 else ''}.")
        return lines


def _draft(path: Path) -> _Draft:
    table = open_table(path, Layout())
    unique = [name for name in dict.fromkeys(table.columns) if name and table.columns.count(name) == 1]
    if table.form == "MATLAB":  # vectors of several lengths may stand in one file
        arrays = {name: _head(table, [name]).column(0) for name in unique}
    else:
        arrays = dict(zip(unique, _head(table, unique).columns, strict=True))
    commas = sum(_matches(a, r"^\s*-?\d+,\d+\s*$") for a in arrays.values())
    points = sum(_matches(a, r"^\s*-?\d+\.\d+\s*$") for a in arrays.values())
    decimal = "," if commas > points else "."
    columns = []
    for name, array in arrays.items():
        unit = re.search(r"[\[(]([^\])]*)[\])]", name)
        words = re.sub(r"[\[(][^\])]*[\])]", " ", re.sub(r"(?<=[a-z])(?=[A-Z])", " ", name))
        words = " ".join(re.findall(r"[a-z]+", words.lower()))
        first = next((str(v) for v in array.slice(0, 50).to_pylist() if v not in (None, "")), "")
        columns.append(_Column(name, words, unit[1].strip() if unit else "", _numbers(array, decimal), first))
    return _Draft(path, columns, decimal, table.form)


def _head(table: Table, names: list[str]) -> pa.RecordBatch:
    first = next(itertools.islice(table.batches(names), 1), None) if names else None
    if first is None or first.num_rows == 0:
        raise InputError(f"{table.path} has no columns with names, or no rows. Give a log with a header and rows.")
    return first.slice(0, _ROWS)


def _matches(array: pa.Array, pattern: str) -> int:
    return int(pc.sum(pc.match_substring_regex(array, pattern)).as_py() or 0) if pa.types.is_string(array.type) else 0


def _numbers(array: pa.Array, decimal: str) -> np.ndarray:
    """Cells as numbers, NaN where they are none."""
    if pa.types.is_string(array.type):
        text = pc.replace_substring(array, ",", ".") if decimal == "," else array
        good = pc.match_substring_regex(text, r"^\s*[-+]?(\d+\.?\d*|\.\d+)([eE][-+]?\d+)?\s*$")
        array = pc.utf8_trim_whitespace(pc.if_else(good, text, None)).cast(pa.float64())
    if not (pa.types.is_integer(array.type) or pa.types.is_floating(array.type)):
        return np.full(len(array), np.nan)
    return array.cast(pa.float64()).to_numpy(zero_copy_only=False)


def _count_of(unit: str, values: np.ndarray) -> tuple[str, float]:
    """Format of a numeric time column and its seconds, from the unit in its name, else from the size of the numbers."""
    if unit.lower() in _TIMES:
        kind = _TIMES[unit.lower()]
        return kind, {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}[kind]
    middle = float(np.median(values))
    for kind, low, high, factor in (
        ("unix", 5e8, 4e9, 1.0), ("unix_ms", 5e11, 4e12, 1e-3), ("unix_us", 5e14, 4e15, 1e-6), ("matlab", 7e5, 8e5, 86400.0),
    ):  # fmt: skip
        if low < middle < high:
            return kind, factor
    if 3e4 < middle < 6e4 and np.median(np.diff(values)) < 0.01:  # days with fractions
        return "excel", 86400.0
    return "s", 1.0


def _pattern(text: str) -> str | None:
    """Format of a date and a time of day, or None; where the day cannot be told from the month, the day is first."""
    date, _, time = text.partition(" ")
    if (re.match(r"\d{4}-\d\d-\d\d$", date) and re.match(r"\d\d:\d\d", time)) or re.match(r"\d{4}-\d\d-\d\dT\d\d", text):
        return "iso"
    clock, parts = _clock_pattern(time), re.match(r"(\d{1,4})([/.-])(\d{1,2})\2(\d{2,4})$", date)
    if clock is None or parts is None:
        return None
    first, mark, second, last = parts.groups()
    if len(first) == 4:
        order = ("%Y", "%m", "%d")
    else:
        year = "%Y" if len(last) == 4 else "%y"
        order = ("%m", "%d", year) if int(second) > 12 else ("%d", "%m", year)
    return f"{mark.join(order)} {clock}"


def _clock_pattern(time: str) -> str | None:
    """Format of a time of day, or None."""
    found = re.match(r"\d{1,2}:\d\d(:\d\d)?(\.\d+)?(?: ?([AaPp][Mm]))?$", time.strip())
    if found is None or (found[2] and not found[1]):
        return None
    hours = "%I" if found[3] else "%H"
    after = (" %p" if " " in time.strip() else "%p") if found[3] else ""
    return f"{hours}:%M{':%S' if found[1] else ''}{'.%f' if found[2] else ''}{after}"


def _guess_unit(channel: str, column: _Column) -> tuple[str, str]:
    """Unit and why. Force in kN and speed in kn are told apart by what the channel is."""
    ours = unit_of(channel)
    known = _UNITS.get(column.unit.lower())
    if column.unit and ours == "N":
        known = {"n": "N", "kn": "kN", "mn": "MN", "tf": "tf", "t": "tf"}.get(column.unit.lower())
    if known is not None and known in _ACCEPTED[ours].split(", "):
        return known, f"unit from the name, [{column.unit}]"
    size = float(np.nanmax(np.abs(column.values))) if np.isfinite(column.values).any() else 0.0
    what = f"accepted {_ACCEPTED[ours]}"
    if channel in ("lat", "lon"):
        return "deg", f"unit as usual for {channel} ({what})"
    if ours == "rad":
        most = 1.6 if channel in ("delta", "delta_c") else 6.5  # no rudder turns by more than a right angle
        return ("deg" if size > most else "rad"), f"unit from the values ({what})"
    if ours == "rad/s":
        return ("deg/min" if size > 20 else "deg/s" if size > 0.3 else "rad/s"), f"unit from the values ({what})"
    if channel == "sog":
        return "kn", f"unit as usual for SOG ({what})"
    return ours, f"unit not known, ours taken ({what})"


def _range(values: np.ndarray) -> str:
    there = values[np.isfinite(values)]
    return f"values {there.min():.6g} to {there.max():.6g}" if len(there) else "no numbers at the beginning"


def _quoted(text: str) -> str:
    """A TOML basic string; JSON's escapes are TOML's."""
    return json.dumps(text, ensure_ascii=False)
