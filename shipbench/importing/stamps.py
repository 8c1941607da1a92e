"""Texts that hold a time: stamps by a pattern with the usual omissions and additions of loggers, and durations."""

from __future__ import annotations

import re
import warnings

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .constants import DAY
from .mapping import Clock

_ZONED = r"[T ].*([zZ]|[+-]\d\d:?\d\d|[+-]\d\d)$"
_WIDTHS = {"Y": 4, "y": 2, "m": 2, "d": 2, "H": 2, "I": 2, "M": 2, "S": 2, "j": 3}
_RUN = re.compile("(?:%[YymdHIMSj]){2,}")
_LEAP = r"(^|[ T])\d\d:?59:?60(\D|$)"
_DURATION = r"^(?:(?P<days>[+-]?\d+) days?,? *)?(?P<sign>[+-])?(?P<h>\d+):(?P<m>[0-5]?\d):(?P<s>[0-5]?\d(?:[.,]\d+)?)$"


def text_durations(texts: pa.Array, where: str) -> np.ndarray:
    """Seconds (n,) of texts such as '0 days 00:00:01.5', '-1 days +23:59:59' and '25:00:00.5'; NaN where there is none.

    Raises:
        InputError: another text.
    """
    values = pd.Series(texts.to_pandas()).astype("string")
    parts = values.str.extract(_DURATION)
    unread = values.notna() & parts["s"].isna() & (values != "NaT")
    if unread.any():
        raise InputError(
            f"{where}: '{values[unread].iloc[0][:60]}' is no duration; accepted: hours:minutes:seconds, such as '0 "
            "days 00:00:01.5' or '1:00:01.5'. "
            "Correct [time] format or the log."
        )
    days, hours, minutes, seconds = (
        pd.to_numeric(parts[name].str.replace(",", "."), errors="coerce").to_numpy(dtype=float, na_value=np.nan)
        for name in ("days", "h", "m", "s")
    )
    sign = np.where(parts["sign"].eq("-").fillna(False), -1.0, 1.0)
    return np.nan_to_num(days) * DAY + sign * (3600.0 * hours + 60.0 * minutes + seconds)


def parsed(texts: pa.Array, clock: Clock, accepted: tuple[str, ...], where: str, told: list[str]) -> pd.Series:
    """Stamps (n,) as datetimes, with a zone where they carry one.

    Only ISO stamps, and those of a pattern with %z or %Z, carry an offset: what ends like one elsewhere is a year. A
    stamp without the fraction that the pattern has is a whole second. Digits without separators (%H%M%S) may lack
    leading zeros. 23:59:60, a leap second, is the next 00:00:00.

    Raises:
        InputError: a stamp is not of the format, or only some have a zone.
    """
    iso = clock.format == "iso"
    zoned = "%z" in clock.format or "%Z" in clock.format or re.search(r"(Z|UTC|GMT)\s*$", clock.format) is not None
    if iso:
        ends = pc.match_substring_regex(texts, _ZONED).drop_null()
        share = pc.sum(ends).as_py() or 0
        zoned = share > 0
        if 0 < share < len(ends):
            raise InputError(
                f"{where}: {share} of {len(ends)} time stamps have a zone; accepted: all or none. Correct the log."
            )
        if zoned and clock.zone is not None:
            raise InputError(
                f"{where}: the time stamps have a zone of their own, and [time] zone = '{clock.zone}' is set; "
                "accepted: one. Remove `zone`."
            )
    values = pd.Series(texts.to_pandas()).astype("string")
    leap = pc.fill_null(pc.match_substring_regex(texts, _LEAP), False).to_numpy(zero_copy_only=False)
    if leap.any():
        told.append(f"leap second: the stamp '{values[leap].iloc[0]}' is taken as the next midnight")
        values = values.where(~leap, values.str.replace(r"59(:?)60", r"59\g<1>59", n=1, regex=True))
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            stamps = (
                pd.to_datetime(values, format="ISO8601", utc=zoned) if iso else _by_pattern(values, clock.format, zoned)
            )
    except (ValueError, OverflowError) as error:
        first = next((v for v in values if isinstance(v, str)), "")
        reason = re.split(r"\. You might|, at position|\n", str(error))[0][
            :140
        ]  # pandas goes on with advice on its own options
        raise InputError(
            f"{where}: a time stamp is not of the format '{clock.format}' (the first is '{first[:60]}'): {reason}. "
            f"Accepted: {', '.join(accepted)}."
        ) from None
    return stamps + pd.to_timedelta(leap.astype(int), unit="s") if leap.any() else stamps


def _by_pattern(values: pd.Series, pattern: str, zoned: bool) -> pd.Series:
    if (run := _RUN.search(pattern)) and not run[0].startswith("%Y"):
        values = _with_zeros(values, pattern)
    whole = re.sub(r"(?<=%S)[.,:]%f", "", pattern)
    if whole == pattern:
        return pd.to_datetime(values, format=pattern, utc=zoned)
    stamps = pd.to_datetime(values, format=pattern, utc=zoned, errors="coerce")
    short = stamps.isna() & values.notna()
    if short.any():
        bare = pd.to_datetime(values[short], format=whole, utc=zoned, errors="coerce")
        if bare.isna().any():  # of neither form: the error of the pattern as it was given
            pd.to_datetime(values[short][bare.isna()], format=pattern, utc=zoned)
        stamps = stamps.where(~short, bare.reindex(stamps.index))
    return stamps


def _with_zeros(values: pd.Series, pattern: str) -> pd.Series:
    """Stamps with the leading zeros that a spreadsheet takes from digits without separators."""
    parts, widths, at = [], [], 0
    for run in _RUN.finditer(pattern):
        parts += [_matcher(pattern[at : run.start()]), r"(\d+)"]
        widths.append(sum(_WIDTHS[letter] for letter in run[0][1::2]))
        at = run.end()
    matcher = re.compile("".join([*parts, _matcher(pattern[at:])]))

    def filled(stamp: str) -> str:
        found = matcher.fullmatch(stamp)
        if found is None:
            return stamp
        for k in range(len(widths), 0, -1):
            begin, end = found.span(k)
            stamp = stamp[:begin] + found[k].zfill(widths[k - 1]) + stamp[end:]
        return stamp

    return values.map(filled, na_action="ignore")


def _matcher(pattern: str) -> str:
    """Regular expression for the stamps of a part of a pattern; its fraction may be left out."""
    tokens = re.findall(r"[.,:]?%f|%.|[^%]", pattern)
    return "".join(
        r"(?:[.,:]?\d+)?" if token.endswith("%f") else ".+?" if token.startswith("%") else re.escape(token)
        for token in tokens
    )
