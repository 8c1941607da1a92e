"""Conversion of time stamps of any kind to seconds: relative to the log's zero, or since 1970 (UTC) for absolute
times."""

from __future__ import annotations

import re
from collections.abc import Callable
from datetime import UTC, datetime

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .constants import DAY
from .mapping import Clock
from .stamps import parsed, text_durations
from .thresholds import THRESHOLDS

RELATIVE = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0, "h": 3600.0}
_ABSOLUTE = {"unix": (1.0, 0.0), "unix_ms": (1e-3, 0.0), "unix_us": (1e-6, 0.0), "unix_ns": (1e-9, 0.0),
             "excel": (DAY, 25569.0), "matlab": (DAY, 719529.0)}  # fmt: skip
"""Factor to s, and the reading of 1970-01-01: Excel counts days from 1899-12-30, MATLAB's datenum from the year 0."""
FORMATS = (*RELATIVE, *_ABSOLUTE, "unix+ns (columns = [seconds, nanoseconds])",
    "timedelta (such as '0 days "
    "00:00:01.5' or '0:00:01.5')",
           "hhmmss (number, counted on over midnight)", "iso", "%d/%m/%Y %H:%M:%S.%f (strptime)",
           "%H:%M:%S (time of day, counted on over midnight)")  # fmt: skip
_DATE = re.compile("%[-#]?[aAbBcdDFgGjmsuUVwWxyY]")
_1900 = -2208988800.0
"""Time that strptime gives to a time of day without a date [s since 1970]."""


def is_absolute(clock: Clock) -> bool:
    """Whether the times are absolute (so that logs of different instruments can be merged by them)."""
    return clock.rate is None and clock.format not in (*RELATIVE, "timedelta") and not is_daily(clock)


def is_daily(clock: Clock) -> bool:
    """Whether the stamps are times of day without a date: then the time is in seconds since the log's first
    midnight."""
    return clock.rate is None and (
        clock.format == "hhmmss" or ("%" in clock.format and _DATE.search(clock.format) is None)
    )


def shown(clock: Clock, seconds: float) -> str:
    """Time in the log's own form, for messages."""
    return moment(seconds) if is_absolute(clock) else f"{seconds:.10g} s"


def moment(seconds: float) -> str:
    """ISO time stamp in UTC of seconds since 1970, to the millisecond."""
    return datetime.fromtimestamp(round(seconds, 3), UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def to_seconds(
    clock: Clock,
    columns: list[pa.Array],
    numbers: Callable[[str], np.ndarray],
    where: str,
    told: list[str] | None = None,
) -> np.ndarray:
    """Times of a block (n,) [s]; NaN where the log has none.

    Args:
        columns: the one or two columns of the clock.
        numbers: reads a column as numbers (n,), where the format counts.
        where: file and rows, for messages.
        told: receives notes for the summary.

    Raises:
        InputError: unknown format, unreadable stamps, stamps of which only some have a zone, or moments outside 1900 to
            2199.
    """
    seconds = _read(clock, columns, numbers, where, [] if told is None else told)
    latest = THRESHOLDS.value("latest_time")
    if is_absolute(clock):
        far = ~((seconds >= _1900) & (seconds < latest)) & np.isfinite(seconds)
        if far.any():
            year = 1970 + float(seconds[np.argmax(far)]) / 31_556_952
            raise InputError(
                f"{where}: [time] format = '{clock.format}' makes a time in the year {year:.0f}; accepted: 1900 to "
                "2199. "
                f"Check the format, such as 'unix_ms' for 'unix'. Accepted formats: {', '.join(FORMATS)}."
            )
    elif (np.abs(seconds) > latest).any():
        raise InputError(
            f"{where}: [time] format = '{clock.format}' makes a time of {np.nanmax(np.abs(seconds)):.3g} s; "
            f"accepted: up to {latest:.2g} s, 230 years. "
            "Check the format, such as 'ms' for 's'."
        )
    return seconds + clock.shift


def counts(clock: Clock) -> bool:
    """Whether the format is a number (else a text)."""
    return clock.format in RELATIVE or clock.format in _ABSOLUTE or clock.format in ("hhmmss", "unix+ns")


def check_format(clock: Clock, where: str) -> None:
    """Check that the format is a known one, 'iso', or a strptime pattern, and fits the number of columns and the zone.

    Raises:
        InputError: it is none of them.
    """
    form, two = clock.format, len(clock.names) == 2
    if not counts(clock) and form not in ("iso", "timedelta") and "%" not in form:
        raise InputError(f"{where}: [time] format = '{form}'; accepted: {', '.join(FORMATS)}.")
    if two and (counts(clock) or form == "timedelta") and not _in_nanoseconds(clock):
        raise InputError(
            f"{where}: [time] columns = {list(clock.names)} with format = '{form}'; accepted for two columns: "
            "'iso', a strptime pattern, "
            "or 'unix+ns' for seconds and nanoseconds."
        )
    if form == "unix+ns" and not two:
        raise InputError(
            f"{where}: [time] format = 'unix+ns' with one column; accepted: two, columns = [\"seconds\", "
            '"nanoseconds"].'
        )
    if clock.zone is None:
        return
    if not is_absolute(clock) or counts(clock):
        raise InputError(
            f"{where}: [time] zone = '{clock.zone}' with a format without a date, '{form}'; accepted: no zone. "
            "Remove it."
        )
    if "%z" in form or "%Z" in form or re.search(r"(Z|UTC|GMT)\s*$", form):
        raise InputError(
            f"{where}: [time] format = '{form}' reads a zone, and zone = '{clock.zone}' is set; accepted: one. "
            "Remove `zone`."
        )


def _read(
    clock: Clock, columns: list[pa.Array], numbers: Callable[[str], np.ndarray], where: str, told: list[str]
) -> np.ndarray:
    columns = [c.dictionary_decode() if pa.types.is_dictionary(c.type) else c for c in columns]
    kinds = [c.type for c in columns]
    if len(columns) == 2 and any(_is_date(kind) for kind in kinds):
        return _date_and_time(columns, clock, where)
    if len(columns) == 1 and pa.types.is_duration(kinds[0]):
        if clock.format not in ("timedelta", "s"):
            raise InputError(
                f"{where}: '{clock.names[0]}' holds durations, [time] format = '{clock.format}'; accepted for it: "
                "'timedelta'."
            )
        return _durations(columns[0])
    if len(columns) == 1 and _is_date(kinds[0]):
        if not is_absolute(clock) or counts(clock):
            raise InputError(
                f"{where}: '{clock.names[0]}' holds time stamps, [time] format = '{clock.format}'; accepted for it: "
                "'iso'."
            )
        return _seconds(_stamps(columns[0]), clock, where)
    if len(columns) == 1 and pa.types.is_time(kinds[0]) and clock.format != "hhmmss" and is_daily(clock):
        return _durations(columns[0])
    if counts(clock) and not (clock.format == "s" and _has_colon(columns[0])):
        return _counted(clock, numbers, where)
    joined = _joined(columns)
    if clock.format in ("timedelta", "s"):
        return text_durations(joined, where)
    stamps = _seconds(parsed(joined, clock, FORMATS, where, told), clock, where)
    return stamps - (_1900 if is_daily(clock) else 0.0)


def _in_nanoseconds(clock: Clock) -> bool:
    """Whether the second column counts the nanoseconds of the first one's second: by the format, or by its name."""
    name = clock.names[-1].lower()
    return clock.format == "unix+ns" or (
        clock.format == "unix" and re.search(r"nsec|nano|(^|[^a-z])ns([^a-z]|$)", name) is not None
    )


def _counted(clock: Clock, numbers: Callable[[str], np.ndarray], where: str) -> np.ndarray:
    first = numbers(clock.names[0])
    if clock.format in RELATIVE:
        return first * RELATIVE[clock.format]
    if clock.format == "hhmmss":
        return _from_digits(first, clock, where)
    if len(clock.names) == 2:
        rest = numbers(clock.names[1])
        _refuse(
            (rest < 0.0) | (rest >= 1e9),
            rest,
            f"{where}: [time] format = '{clock.format}': '{clock.names[1]}'",
            "0 to 999999999 ns",
        )
        return first + 1e-9 * rest
    factor, zero = _ABSOLUTE[clock.format]
    return (first - zero) * factor


def _from_digits(digits: np.ndarray, clock: Clock, where: str) -> np.ndarray:
    """Time of day [s] from numbers hhmmss.f, of which leading zeros may be lost."""
    hours, minutes = np.floor(digits / 1e4), np.floor(digits / 1e2) % 100.0
    seconds = digits - 1e2 * np.floor(digits / 1e2)
    wrong = (hours < 0) | (hours > 24) | (minutes >= 60) | (seconds >= 61)
    _refuse(
        wrong,
        digits,
        f"{where}: [time] format = 'hhmmss': '{clock.names[0]}'",
        "000000 to 240000, such as 93015.5 for 09:30:15.5",
    )
    return 3600.0 * hours + 60.0 * minutes + seconds


def _refuse(wrong: np.ndarray, values: np.ndarray, what: str, accepted: str) -> None:
    if wrong.any():
        raise InputError(
            f"{what} has {values[np.argmax(wrong)]:.12g}; accepted: {accepted}. Check the column and the format."
        )


def _has_colon(column: pa.Array) -> bool:
    """Whether the first cell that is not empty holds a colon, as '0:00:01' does."""
    if not (pa.types.is_string(column.type) or pa.types.is_large_string(column.type)):
        return False
    there = pc.match_substring(column, ":").filter(pc.not_equal(pc.utf8_length(pc.utf8_trim_whitespace(column)), 0))
    return len(there) > 0 and bool(there[0].as_py())


def _is_date(kind: pa.DataType) -> bool:
    return bool(pa.types.is_timestamp(kind) or pa.types.is_date(kind))


def _joined(columns: list[pa.Array]) -> pa.Array:
    """Texts of the columns with a blank between them; null where all are empty."""
    texts = [
        pc.utf8_trim_whitespace(c.cast(pa.string()) if not pa.types.is_null(c.type) else pa.nulls(len(c), pa.string()))
        for c in columns
    ]
    texts = [
        pc.replace_substring_regex(t, r"\.0+$", "") if pa.types.is_time(c.type) else t
        for t, c in zip(texts, columns, strict=True)
    ]
    joined = texts[0] if len(texts) == 1 else pc.binary_join_element_wise(*texts, " ")
    return pc.if_else(pc.equal(pc.utf8_length(pc.utf8_trim_whitespace(joined)), 0), None, joined)


def _durations(column: pa.Array) -> np.ndarray:
    """Seconds of durations or times of day."""
    if pa.types.is_time(column.type):
        column = (
            column.cast(pa.int32() if pa.types.is_time32(column.type) else pa.int64())
            .cast(pa.int64())
            .cast(pa.duration(column.type.unit))
        )
    values = column.cast(pa.duration("ns"), safe=False).cast(pa.int64())
    return pc.fill_null(values.cast(pa.float64(), safe=False), np.nan).to_numpy(zero_copy_only=False) * 1e-9


def _stamps(column: pa.Array) -> pd.Series:
    return pd.Series(pd.to_datetime(pd.Series(column.to_pandas())))


def _date_and_time(columns: list[pa.Array], clock: Clock, where: str) -> np.ndarray:
    """Stamps of a column of dates (typed as dates or time stamps) and one of times of day, in either order."""
    whole = [
        _is_date(c.type) and bool((_stamps(c).dt.normalize() == _stamps(c))[_stamps(c).notna()].all()) for c in columns
    ]
    if not any(whole):
        raise InputError(
            f"{where}: {list(clock.names)} hold no date without a time of day; accepted: one column of stamps, or a "
            "date and a time."
        )
    first = whole.index(True)
    time, days = columns[1 - first], _stamps(columns[first])
    if pa.types.is_time(time.type) or pa.types.is_duration(time.type):
        seconds = _durations(time)
    elif _is_date(time.type):  # a time of day that was saved with some date
        moments = _stamps(time)
        seconds = (moments - moments.dt.normalize()).dt.total_seconds().to_numpy()
    else:
        seconds = text_durations(_joined([time]), where)
    nanoseconds = pd.Series(pd.to_timedelta(np.round(seconds * 1e6), unit="us"))
    return _seconds(days + nanoseconds, clock, where)


def _twice_or_never(error: str) -> str:
    """Stamp in the message of pandas, and its fault, without that message's advice on pandas options."""
    found = re.search(r"\d{4}-\d\d-\d\d \d\d:\d\d:[\d.]*\d", error)
    return (
        f"{found[0] if found else 'one'} {'does not occur' if 'nonexistent' in error else 'occurs twice'}, as "
        "the clocks change"
    )


def _seconds(stamps: pd.Series, clock: Clock, where: str) -> np.ndarray:
    """Seconds of stamps; those without a zone are taken in `clock.zone`, or UTC."""
    try:
        aware = (
            stamps.dt.tz_convert("UTC")
            if stamps.dt.tz is not None
            else stamps.dt.tz_localize(clock.zone or "UTC").dt.tz_convert("UTC")
        )
    except ValueError as error:  # the hour that a change of clocks repeats or leaves out
        raise InputError(
            f"{where}: a time stamp has no one meaning in the zone '{clock.zone}': {_twice_or_never(str(error))}. "
            "Accepted: stamps that occur once. Log in UTC, or give the offset."
        ) from None
    values = aware.dt.tz_localize(None).to_numpy(dtype="datetime64[us]")  # in ns, years far off would wrap around
    seconds = values.astype(np.int64) / 1e6
    return np.where(np.isnat(values), np.nan, seconds)
