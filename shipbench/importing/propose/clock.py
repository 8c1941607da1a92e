"""Clock of a log: of all columns and formats that can be the time, the one with which the import's own clock runs
forward most evenly."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pyarrow as pa

from ...errors import InputError
from ..clock import check_format, to_seconds
from ..mapping import Clock
from ..thresholds import THRESHOLDS
from .columns import Column
from .stamps import day_first_is_sure, formats_of, is_clock, is_date, zone_of

_SIZES = (
    *(
        (form, per_second * THRESHOLDS.value("earliest_stamp"), per_second * THRESHOLDS.value("latest_stamp"))
        for form, per_second in (("unix", 1.0), ("unix_ms", 1e3), ("unix_us", 1e6), ("unix_ns", 1e9))
    ),
    ("matlab", THRESHOLDS.value("earliest_datenum"), THRESHOLDS.value("latest_datenum")),
    ("excel", THRESHOLDS.value("earliest_workbook_day"), THRESHOLDS.value("latest_workbook_day")),
)
"""Formats of moments, with the range of their numbers."""


@dataclass(frozen=True)
class Time:
    """Clock of a log: `spec` is the [time] of the mapping, `t` the seconds of the sample (n,), `step` their typical
    step [s]."""

    spec: dict[str, Any]
    t: np.ndarray
    step: float
    names: tuple[str, ...]
    why: str
    notes: tuple[str, ...] = ()
    key: tuple[float, ...] = field(default=(), compare=False)


def find_time(columns: Sequence[Column]) -> Time | None:
    """Find the clock of a log, or None where no column can be it."""
    found = list(_candidates(columns))
    if not found:
        return None
    best = max(found, key=lambda time: time.key)
    return _with_notes(best, columns)


def refusal(columns: Sequence[Column]) -> str | None:
    """Reason why a column that is named like a time is none: the clock's own message about its likeliest format."""
    for column in columns:
        if column.head.meaning == "time" and column.head.sure and column.texts():
            for form in formats_of(column.texts())[-1:]:
                try:
                    read_time({"column": column.name, "format": form}, columns)
                except InputError as error:
                    return f"'{column.name}' looks like the time and is not read: {str(error).split(' Accepted: ')[0]}"
    return None


def read_time(spec: dict[str, Any], columns: Sequence[Column]) -> np.ndarray:
    """Read the seconds of the sample under a [time] of a mapping.

    Raises:
        InputError: the cells do not fit the format.
    """
    clock, by_name = Clock(**spec), {column.name: column for column in columns}
    if clock.rate is not None:
        return np.arange(len(columns[0].values)) / clock.rate
    missing = [name for name in clock.names if name not in by_name]
    if missing:
        raise InputError(f"no column '{missing[0]}' for [time]. Columns: {', '.join(by_name)}.")
    check_format(clock, "the log")
    return to_seconds(
        clock, [by_name[name].cells for name in clock.names], lambda name: by_name[name].values, "the log"
    )


def usual_step(t: np.ndarray) -> float:
    """Median of the steps forward [s]; 1 where there is none."""
    steps = np.diff(t[np.isfinite(t)])
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 1.0


def _candidates(columns: Sequence[Column]) -> Iterator[Time]:
    named = [c for c in columns if c.head.meaning in ("time", "secs", "date") and "+other" not in c.head.qualifiers]
    yield from _pairs(columns)
    for column in named:
        if column.head.meaning != "date" or not is_date(column.texts()):
            yield from _of_one(column, 2.0 if column.head.sure else 1.0)
    stamps = [
        c
        for c in columns
        if c not in named and (_is_stamp(c) or (c.is_text and not c.known.size and formats_of(c.texts(50))))
    ]
    for column in stamps:
        yield from _of_one(column, 0.5)
    if not named and not stamps:
        forward = (
            c
            for c in columns
            if not c.head.name and len(c.known) > 2 and (np.diff(c.known) >= 0).all() and np.ptp(c.known) > 0
        )
        for column in itertools.islice(forward, 1):
            yield from _of_one(column, 0.0)


def _pairs(columns: Sequence[Column]) -> Iterator[Time]:
    """Pairs of a date and a time of day, or of seconds and nanoseconds."""
    fine = [c for c in columns if c.head.meaning == "nsecs"]
    for column in fine:
        whole = [c for c in columns if c is not column and _seconds_name(column.name) == c.name.lower()]
        for seconds in whole[:1]:
            yield from _tried(
                {"columns": [seconds.name, column.name], "format": "unix+ns"},
                (seconds, column),
                3.0,
                "seconds and nanoseconds",
            )
    dates = [
        c
        for c in columns
        if c.head.meaning in ("date", "time") and (is_date(c.texts()) or pa.types.is_date(c.cells.type))
    ]
    for date in dates:
        for time in columns:
            typed = pa.types.is_time(time.cells.type)
            if time is date or time.head.meaning not in ("time", "date") or not (typed or is_clock(time.texts())):
                continue
            joined = [f"{a} {b}" for a, b in zip(date.texts(), time.texts(), strict=False)]
            for form in ["iso"] if typed else formats_of(joined):
                yield from _tried(
                    {"columns": [date.name, time.name], "format": form}, (date, time), 2.5, "date and time of day"
                )


def _seconds_name(name: str) -> str:
    low = name.lower()
    for fine, whole in (
        ("nanoseconds", "seconds"),
        ("nanosecs", "secs"),
        ("nanosec", "sec"),
        ("nsecs", "secs"),
        ("nsec", "sec"),
    ):
        if fine in low:
            return low.replace(fine, whole)
    return low


def _is_stamp(column: Column) -> bool:
    return bool(pa.types.is_timestamp(column.cells.type) or pa.types.is_duration(column.cells.type))


def _of_one(column: Column, trust: float) -> Iterator[Time]:
    if _is_stamp(column):
        form = "timedelta" if pa.types.is_duration(column.cells.type) else "iso"
        yield from _tried({"column": column.name, "format": form}, (column,), trust + 0.5, "typed as times in the file")
        return
    texts = column.texts()
    if len(column.known) < THRESHOLDS.value("numeric_share") * len(texts) or not len(column.known):
        for form in formats_of(texts):
            zone = {"zone": zone} if (zone := zone_of(form)) else {}
            yield from _tried(
                {"column": column.name, "format": form} | zone, (column,), trust, f"stamps such as '{texts[0]}'"
            )
        return
    for form, why in _counted(column, texts):
        yield from _tried({"column": column.name, "format": form}, (column,), trust, why)


def _counted(column: Column, texts: list[str]) -> Iterator[tuple[str, str]]:
    """Formats of a column of numbers, with the reason."""
    if all(re.fullmatch(r"(19|20)\d{12}", text) for text in texts):
        yield "%Y%m%d%H%M%S", f"date and time of day in one number: {texts[0]}"
        return
    middle, unit = float(np.median(column.known)), column.head.units.get("time")
    steps = np.abs(np.diff(column.known))
    for form, low, high in _SIZES:
        if low < middle < high and (
            form not in ("excel", "matlab")
            or (unit is None and np.median(steps) < THRESHOLDS.value("step_of_days") and (steps > 0).any())
        ):
            yield form, "from the size of the numbers"
            return
    if unit == "hhmmss" or "hhmmss" in column.name.lower().replace(":", "") or _looks_packed(column.known, texts):
        yield "hhmmss", "hours, minutes and seconds in one number: minutes and seconds stay below 60"
        return
    yield (unit, f"unit from the head, {column.head.unit}") if unit else ("s", "no unit in the head; seconds taken")


def _looks_packed(values: np.ndarray, texts: list[str]) -> bool:
    """Whether numbers are times of day without colons: no minutes or seconds of 60 or more, and leaps of 40 where a
    minute ends."""
    whole = np.floor(values)
    if (values < 0).any() or (values >= 240_000).any() or (whole % 100 >= 60).any() or (whole // 100 % 100 >= 60).any():
        return False
    seconds = values - whole + whole % 100 + 60 * (whole // 100 % 100) + 3600 * (whole // 10_000)
    padded = all(len(text.split(".")[0]) == 6 for text in texts[:200])
    leaps = np.diff(values) - np.diff(seconds)
    return padded or bool((leaps >= THRESHOLDS.value("minute_leap")).any() and _evenness(seconds) > _evenness(values))


def _tried(spec: dict[str, Any], columns: Sequence[Column], trust: float, why: str) -> Iterator[Time]:
    try:
        t = read_time(spec, columns)
    except InputError:
        return
    known = t[np.isfinite(t)]
    steps = np.diff(known)
    runs = float((steps > 0).any())
    few = len(known) < max(THRESHOLDS.value("numeric_share") * len(t), 2)
    if few or (steps >= 0).mean() < THRESHOLDS.value("forward_share") or (not runs and steps.any()):
        return
    yield Time(
        spec,
        t,
        usual_step(t),
        tuple(c.name for c in columns),
        why,
        (),
        (runs, trust, round(float((steps >= 0).mean()), 2), round(_evenness(t), 2)),
    )


def _evenness(t: np.ndarray) -> float:
    """Share of the steps forward that are within a fifth of the usual one."""
    steps = np.diff(t[np.isfinite(t)])
    steps = steps[steps > 0]
    even = THRESHOLDS.value("even_step")
    return float((np.abs(steps - np.median(steps)) <= even * np.median(steps)).mean()) if len(steps) else 0.0


def _with_notes(time: Time, columns: Sequence[Column]) -> Time:
    """Clock with notes on its uncertain points."""
    form, notes, own = time.spec["format"], [], [c for c in columns if c.name in time.names]
    texts = [text for c in own for text in c.texts()]
    if form.startswith(("%d/%m", "%d.%m", "%d-%m")) and not day_first_is_sure(texts) and "." not in form[:3]:
        notes.append(f"NOT SURE: day or month first? '{texts[0]}' can be both; the day is taken first.")
    if own[0].head.meaning not in ("time", "secs", "date"):
        notes.append(
            f"NOT SURE: '{own[0].name}' is taken as the time: it goes forward in even steps of {time.step:.4g}."
        )
    elif (
        "no unit" in time.why
        and time.step >= THRESHOLDS.value("step_of_milliseconds")
        and (np.mod(own[0].known, 1.0) == 0).all()
    ):
        notes.append(
            f"NOT SURE: '{own[0].name}' goes on by {time.step:g}; seconds are taken. If it counts milliseconds, "
            'write format = "ms".'
        )
    return replace(time, notes=tuple(notes))
