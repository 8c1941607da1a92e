"""Time stamps of any kind to seconds: as they are counted in the log, or since 1970 (UTC) where they name a moment."""

from __future__ import annotations

import re
import warnings
from datetime import UTC, datetime

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .mapping import Clock

RELATIVE = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0, "h": 3600.0}
_ABSOLUTE = {"unix": (1.0, 0.0), "unix_ms": (1e-3, 0.0), "unix_us": (1e-6, 0.0), "excel": (86400.0, 25569.0), "matlab": (86400.0, 719529.0)}
"""Factor to s, and the reading that stands for 1970-01-01: Excel counts days from 1899-12-30, MATLAB's datenum from the year 0."""
FORMATS = (*RELATIVE, *_ABSOLUTE, "iso", "%d/%m/%Y %H:%M:%S.%f (strptime)", "%H:%M:%S (time of day, counted on over midnight)")
_ZONED = r"[T ].*([zZ]|[+-]\d\d:?\d\d|[+-]\d\d)$"
_DATE = re.compile("%[-#]?[aAbBcdDFgGjmsuUVwWxyY]")
_1900, _2200 = -2208988800.0, 7258118400.0
"""Where strptime puts a time of day that has no date, and the end of what a log may name; s since 1970."""


def is_absolute(clock: Clock) -> bool:
    """Whether the times name moments (so that logs of different instruments can be merged by them)."""
    return clock.rate is None and clock.format not in RELATIVE and not is_daily(clock)


def is_daily(clock: Clock) -> bool:
    """Whether the stamps are times of day without a date: then the time is in seconds since the log's first midnight."""
    return clock.rate is None and "%" in clock.format and _DATE.search(clock.format) is None


def shown(clock: Clock, seconds: float) -> str:
    """A time as the log's reader knows it, for messages."""
    return moment(seconds) if is_absolute(clock) else f"{seconds:.10g} s"


def moment(seconds: float) -> str:
    """Seconds since 1970 as an ISO time stamp in UTC, to the millisecond."""
    return datetime.fromtimestamp(round(seconds, 3), UTC).isoformat(timespec="milliseconds").replace("+00:00", "Z")


def to_seconds(clock: Clock, columns: list[pa.Array], numbers: np.ndarray | None, where: str) -> np.ndarray:
    """Times of a block (n,) [s]; NaN where the log has none.

    Args:
        columns: the one or two columns of the clock.
        numbers: the column as numbers, where the format counts (else None).
        where: file and rows, for messages.

    Raises:
        InputError: unknown format, unreadable stamps, stamps of which only some have a zone, or moments outside 1900 to 2199.
    """
    seconds = _read(clock, columns, numbers, where)
    if is_absolute(clock):
        far = ~((seconds >= _1900) & (seconds < _2200)) & np.isfinite(seconds)
        if far.any():
            year = 1970 + float(seconds[np.argmax(far)]) / 31_556_952
            raise InputError(
                f"{where}: [time] format = '{clock.format}' makes a time in the year {year:.0f}; accepted: 1900 to 2199. "
                f"Check the format, such as 'unix_ms' for 'unix'. Accepted formats: {', '.join(FORMATS)}."
            )
    return seconds + clock.shift


def _read(clock: Clock, columns: list[pa.Array], numbers: np.ndarray | None, where: str) -> np.ndarray:
    if pa.types.is_timestamp(columns[0].type):
        if counts(clock):
            raise InputError(f"{where}: '{clock.names[0]}' holds time stamps, [time] format = '{clock.format}' counts; accepted for it: 'iso'.")
        return _from_timestamps(columns[0], clock, where)
    if numbers is not None:
        factor, zero = (RELATIVE[clock.format], 0.0) if clock.format in RELATIVE else _ABSOLUTE[clock.format]
        return (numbers - zero) * factor
    texts = [pc.utf8_trim_whitespace(c.cast(pa.string()) if not pa.types.is_null(c.type) else pa.nulls(len(c), pa.string())) for c in columns]
    joined = texts[0] if len(texts) == 1 else pc.binary_join_element_wise(*texts, " ")
    joined = pc.if_else(pc.equal(pc.utf8_length(pc.utf8_trim_whitespace(joined)), 0), None, joined)
    return _from_text(joined, clock, where) - (_1900 if is_daily(clock) else 0.0)


def counts(clock: Clock) -> bool:
    """Whether the format is a number (else a text)."""
    return clock.format in RELATIVE or clock.format in _ABSOLUTE


def check_format(clock: Clock, where: str) -> None:
    """The format is one of ours, 'iso', or a strptime pattern.

    Raises:
        InputError: it is none of them.
    """
    if not counts(clock) and clock.format != "iso" and "%" not in clock.format:
        raise InputError(f"{where}: [time] format = '{clock.format}'; accepted: {', '.join(FORMATS)}.")
    if is_daily(clock) and clock.zone is not None:
        raise InputError(f"{where}: [time] zone = '{clock.zone}' with a format without a date, '{clock.format}'; accepted: no zone. Remove it.")
    if len(clock.names) == 2 and counts(clock):
        raise InputError(
            f"{where}: [time] columns = two columns with format = '{clock.format}'; accepted for two columns: 'iso' or a strptime pattern."
        )


def _from_text(texts: pa.Array, clock: Clock, where: str) -> np.ndarray:
    zoned = pc.match_substring_regex(texts, _ZONED).drop_null()
    share = pc.sum(zoned).as_py() or 0
    if 0 < share < len(zoned):
        raise InputError(f"{where}: {share} of {len(zoned)} time stamps have a zone; accepted: all or none. Mend the log.")
    if share and clock.zone is not None and clock.format == "iso":
        raise InputError(f"{where}: the time stamps have a zone of their own, and [time] zone = '{clock.zone}' is set; accepted: one. Remove `zone`.")
    values = pd.Series(texts.to_pandas())
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            stamps = pd.to_datetime(values, format="ISO8601" if clock.format == "iso" else clock.format, utc=bool(share))
    except (ValueError, OverflowError) as error:
        first = next((v for v in values if v is not None), "")
        reason = " ".join(str(error).split())[:140]
        raise InputError(
            f"{where}: a time stamp is not of the format '{clock.format}' (the first is '{str(first)[:60]}'): {reason}. "
            f"Accepted: {', '.join(FORMATS)}."
        ) from None
    return _seconds(stamps, clock, where)


def _from_timestamps(column: pa.Array, clock: Clock, where: str) -> np.ndarray:
    return _seconds(pd.Series(column.to_pandas()), clock, where)


def _seconds(stamps: pd.Series, clock: Clock, where: str) -> np.ndarray:
    """Stamps without a zone are taken in `clock.zone`, or UTC."""
    try:
        aware = stamps.dt.tz_convert("UTC") if stamps.dt.tz is not None else stamps.dt.tz_localize(clock.zone or "UTC").dt.tz_convert("UTC")
    except ValueError as error:  # the hour that a change of clocks repeats or leaves out
        raise InputError(f"{where}: a time stamp has no one meaning in the zone '{clock.zone}': {error}. Log in UTC, or give the offset.") from None
    values = aware.dt.tz_localize(None).to_numpy(dtype="datetime64[us]")  # in ns, years far off would wrap around
    seconds = values.astype(np.int64) / 1e6
    return np.where(np.isnat(values), np.nan, seconds)
