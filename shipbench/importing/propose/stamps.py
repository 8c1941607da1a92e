"""Possible formats of a text of a date, a time of day or a duration."""

from __future__ import annotations

import re

_ISO = r"\d{4}-?\d\d-?\d\d[T ]\d\d:?\d\d"
_CLOCK = re.compile(r"(?<![\d.])(\d{1,2}):(\d\d)(:\d\d)?([.,]\d+)?(?: ?([AaPp]\.?[Mm]\.?))?(?![\d:])")
_PACKED_CLOCK = re.compile(r"(?<![\d.])\d{6}(\.\d+)?(?![\d.])")
_DATE = re.compile(r"(?<!\d)(\d{1,4})([-./])(\d{1,2}|[A-Za-z]{3,9})\2(\d{2,4})(?!\d)")
_PACKED_DATE = re.compile(r"(?<!\d)\d{8}(?!\d)")
_ZONE = re.compile(r"( ?)(Z|UTC|GMT|[+-]\d\d:?\d\d)$")


def formats_of(texts: list[str]) -> list[str]:
    """Formats of [time] that such texts may have, the likeliest first; empty where they are no times."""
    if not texts:
        return []
    longest = max(texts, key=len)
    if re.match(r"-?\d+ days?\b", longest) or re.fullmatch(r"\d{3,}:\d\d:\d\d([.,]\d+)?", longest):
        return ["timedelta"]
    found = ["iso"] if all(re.match(_ISO, text) for text in texts[:50]) and "," not in longest else []
    patterns = _patterns(longest)
    if re.fullmatch(r"\d+:\d\d:\d\d([.,]\d+)?", longest):
        hours = [int(text.split(":")[0]) for text in texts if re.match(r"\d+:", text)]
        one_digit = any(re.match(r"\d:", text) for text in texts)
        found += ["timedelta"] if max(hours, default=0) > 23 or (one_digit and hours[0] == 0) else []
    return [*found, *patterns]


_ZONES = {
    "CET": -1,
    "CEST": -2,
    "MEZ": -1,
    "MESZ": -2,
    "WEST": -1,
    "EET": -2,
    "EEST": -3,
    "JST": -9,
    "EST": 5,
    "EDT": 4,
    "PST": 8,
    "PDT": 7,
}
"""Hours to add to a stamp with such a name to have UTC, as the names of the zones Etc/GMT count."""


def zone_of(form: str) -> str | None:
    """Zone for a pattern that has the name of one as a word, such as CEST."""
    word = re.search(r"\b[A-Z]{3,4}$", form)
    hours = _ZONES.get(word[0]) if word else None
    return f"Etc/GMT{hours:+d}" if hours is not None else None


def is_date(texts: list[str]) -> bool:
    """Whether the texts are dates without a time of day."""
    shape = r"\d{1,4}[-./](\d{1,2}|[A-Za-z]{3,9})[-./]\d{2,4}( 00:00:00)?|\d{8}|\d{6}"
    return bool(texts) and all(re.fullmatch(shape, text) for text in texts[:200])


def is_clock(texts: list[str]) -> bool:
    """Whether the texts are times of day without a date."""
    return bool(texts) and all(_CLOCK.fullmatch(text) or re.fullmatch(r"\d{5,6}(\.\d+)?", text) for text in texts[:200])


def day_first_is_sure(texts: list[str]) -> bool:
    """Whether one of the dates can be read in one way only."""
    parts = [found for text in texts if (found := _DATE.search(text))]
    return any(
        len(p[1]) == 4
        or p[3].isalpha()
        or int(p[1]) > 12
        or int(p[3]) > 12
        or (p[1].isdigit() and int(p[1]) == int(p[3]) and len(set(texts)) == 1)
        for p in parts
    )


def _patterns(text: str) -> list[str]:
    """strptime patterns of a text; none where a part of it is neither date, time of day nor zone."""
    rest = text.replace("%", "%%")
    rest, dates = (
        _replaced(rest, _DATE, _date_orders)
        if _DATE.search(rest)
        else _replaced(rest, _PACKED_DATE, lambda found: ["%Y%m%d"])
    )
    rest, clocks = (
        _replaced(rest, _CLOCK, _clock) if _CLOCK.search(rest) else _replaced(rest, _PACKED_CLOCK, _packed_clock)
    )
    if (
        not dates and len(clocks) == 1 and re.fullmatch(r"\d{6} \0", rest)
    ):  # the date of NMEA's RMC before the time of day
        rest, dates = f"\1{rest[6:]}", ["%d%m%y", "%y%m%d"]
    if not dates and not clocks:
        return []
    rest = _ZONE.sub(lambda zone: zone[1] + ("%Z" if zone[2] in ("UTC", "GMT") else "%z"), rest)
    if re.search(r"\d", re.sub("%.", "", rest)):
        return []
    return [rest.replace("\1", date).replace("\0", clock) for date in dates or [""] for clock in clocks or [""]]


def _replaced(text: str, pattern: re.Pattern[str], options: object) -> tuple[str, list[str]]:
    found = pattern.search(text)
    if found is None:
        return text, []
    mark = "\1" if pattern in (_DATE, _PACKED_DATE) else "\0"
    return text[: found.start()] + mark + text[found.end() :], options(found)  # type: ignore[operator]


def _clock(found: re.Match[str]) -> list[str]:
    hours = "%I" if found[5] else "%H"
    after = (" %p" if " " in found[0] else "%p") if found[5] else ""
    fraction = f"{found[4][0]}%f" if found[4] else ""
    if found[4] and not found[3]:
        return [f"%M:%S{fraction}"]
    return [f"{hours}:%M{':%S' if found[3] else ''}{fraction}{after}"]


def _packed_clock(found: re.Match[str]) -> list[str]:
    return [f"%H%M%S{'.%f' if found[1] else ''}"]


def _date_orders(found: re.Match[str]) -> list[str]:
    """Orders of day, month and year; day first where both can be."""
    first, mark, second, last = found.groups()
    month = "%m" if second.isdigit() else ("%b" if len(second) == 3 else "%B")
    if len(first) == 4:
        return [mark.join(("%Y", month, "%d"))]
    year = "%Y" if len(last) == 4 else "%y"
    if not second.isdigit():
        return [mark.join(("%d", month, year))]
    return [mark.join(("%d", "%m", year)), mark.join(("%m", "%d", year))] + (
        [mark.join(("%y", "%m", "%d"))] if len(last) == 2 else []
    )
