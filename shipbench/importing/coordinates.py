"""Latitude and longitude as written in logs: letters of the hemisphere, degrees with minutes, both in one cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .cells import Cells, is_text
from .entries import MINUTES, Channel
from .mapping import Source
from .table import Table

SIDES = {"lat": {"N": 1.0, "S": -1.0}, "lon": {"E": 1.0, "W": -1.0}}
_WORDS = {"NORTH": "N", "SOUTH": "S", "EAST": "E", "WEST": "W"}
_LETTERED = r"^(?P<before>[NSEWnsew]?)\s*(?P<number>[^NSEWnsew]*?)\s*(?P<after>[NSEWnsew]?)$"
_SEXAGESIMAL = (
    r"^(?P<minus>[-\x{2212}]?)(?P<d>\d{1,3})\s*[\x{00b0}\x{00ba}]\s*(?P<m>\d{1,2}(?:[.,]\d*)?)"
    r"(?:\s*['\x{2032}\x{2019}]?|(?:\s*['\x{2032}\x{2019}]\s*|\s+)"
    r"(?P<s>\d{1,2}(?:[.,]\d*)?)\s*(?:[\"\x{2033}\x{201d}]|'')?)$"
)


def coordinates(cells: Cells, name: str, channel: Channel, missing: Sequence[str | float]) -> np.ndarray:
    """Readings (n,) of a lat or lon, north and east positive, in the channel's unit; of `ddmm.mmmm` in degrees.

    Raises:
        InputError: a cell is no number, its letters belong to the other axis or contradict its sign, or its minutes are
            above 60.
    """
    (column,) = channel.columns
    if not cells.is_text(column):
        if channel.part is not None:
            raise InputError(
                f"{cells.path}: column '{column}' holds one number a cell; part = {channel.part} serves cells with "
                "two. Remove part."
            )
        values, sides = cells.numbers(column, missing), None
    else:
        text = cells.texts(column, missing)
        if channel.part is not None:
            text = _part(cells, column, text, channel.part)
        text, sides = _letters(text)
        values = _numbers(cells, column, text, channel, missing)
    lettered = np.zeros(len(values), bool) if sides is None else np.array([side is not None for side in sides])
    bare = np.isfinite(values) & ~lettered
    if channel.unit == MINUTES[1] and bare.any():
        hint = f' Unit "{MINUTES[1]}" needs a letter, such as 3347.63S. Without letters: unit = "{MINUTES[0]}".'
        raise cells.unread(column, int(np.argmax(bare)), hint, "without a letter")
    if channel.hemisphere is not None:
        if lettered.any():
            raise InputError(
                f"{cells.path}: '{column}' has letters of the hemisphere in its cells; accepted: one of them. "
                "Remove hemisphere."
            )
        sides = _sides_of(cells, channel.hemisphere)
        nameless = np.isfinite(values) & np.array([s is None for s in sides])
        cells.met.what[f"readings of {name} without a letter in '{channel.hemisphere}', left out"] += int(
            nameless.sum()
        )
        values = np.where(nameless, np.nan, values)
    if channel.unit in MINUTES:
        values = _degrees(cells, column, channel, values)
    return values if sides is None else _signed(cells, name, channel, values, sides)


def check_hemispheres(table: Table, source: Source) -> None:
    """Refuse positive readings of lat and lon beside a column with S or W that the mapping does not name.

    Raises:
        InputError: there is such a column, with the line that reads it.
    """
    found = {
        n: c for n in SIDES if (c := source.channels.get(n)) and c.kinds == ("column",) and not (c.hemisphere or c.sign)
    }
    used = {n for c in source.channels.values() for n in c.every_column} | {*source.time.names, source.run}
    free = [n for n in table.columns if n and n not in used and table.columns.count(n) == 1]
    if table.form == "MATLAB" or not free or not found:  # vectors of several lengths may stand in one MATLAB file
        return
    batch = next(table.batches([*free, *dict.fromkeys(c.columns[0] for c in found.values())]), None)
    if batch is None:
        return
    for column, array in zip(free, batch.columns, strict=False):
        words = (
            {str(v).strip().upper() for v in pc.unique(array).to_pylist() if v not in (None, "")}
            if is_text(array)
            else set()
        )
        letters = {_WORDS.get(word, word) for word in words}
        for name, channel in found.items():
            if (
                letters <= set(SIDES[name])
                and letters & {"S", "W"}
                and (count := _without_sign(batch.column(channel.columns[0])))
            ):
                entry = (
                    f'{name} = {{ column = "{channel.columns[0]}", unit = "{channel.unit}", hemisphere = "{column}" }}'
                )
                side = {"lat": "north", "lon": "east"}[name]
                raise InputError(
                    f"{table.path}: column '{column}' says {' or '.join(sorted(letters & {'S', 'W'}))}, and the "
                    f"mapping of '{name}' does not read "
                    f"it ({count} positive readings). Write {entry}. If the column means something else, write sign "
                    f'= "{side}" instead.'
                )


def _without_sign(array: pa.Array) -> int:
    """Cells with a number without sign or letter."""
    plain = pc.match_substring_regex(array, r"^\s*[\d.,]+\s*$") if is_text(array) else pc.greater(array, 0)
    return pc.sum(plain).as_py() or 0


def _part(cells: Cells, column: str, text: pa.Array, part: int) -> pa.Array:
    """First or second of the two numbers in each cell."""
    text = pc.utf8_trim(
        pc.replace_substring_regex(text, r"(?i)^\s*POINT\b", ""), "()[]{} "
    )  # as in WKT, where the longitude is first
    gap = r"\s*[;/]\s*|\s+" if cells.source.file.decimal == "," else r"\s*[,;/]\s*|\s+"
    before = pc.replace_substring_regex(text, r"([NSEWnsew])\s+", r"\1")
    after = pc.replace_substring_regex(text, r"\s+([NSEWnsew])\b", r"\1")
    text = pc.if_else(pc.match_substring_regex(text, "^[NSEWnsew]"), before, after)
    halves = pc.split_pattern_regex(text, gap)
    odd = pc.fill_null(pc.not_equal(pc.list_value_length(halves), 2), False).to_numpy(zero_copy_only=False)
    if odd.any():
        raise cells.unread(
            column,
            int(np.argmax(odd)),
            f" With part = {part}, cells with two numbers are accepted, such as 52.0, 4.0.",
            "not a pair",
        )
    return pc.list_element(halves, part - 1)


def _letters(text: pa.Array) -> tuple[pa.Array, np.ndarray | None]:
    """Cells without their letters, and the letter of each (n,) or None where no cell has one."""
    found = pc.extract_regex(text, _LETTERED)
    before, number, after = (pc.struct_field(found, k) for k in range(3))
    letter = pc.if_else(pc.equal(before, ""), after, before)
    there = pc.fill_null(pc.not_equal(letter, ""), False)
    if not pc.any(there).as_py():
        return text, None
    number = pc.replace_substring_regex(number, r"^(\d{1,3})[\s-]+(\d)", "\\1\u00b0 \\2")  # 33 47.63 S
    return pc.if_else(there, number, text), pc.if_else(there, pc.utf8_upper(letter), None).to_numpy(
        zero_copy_only=False
    )


def _numbers(cells: Cells, column: str, text: pa.Array, channel: Channel, missing: Sequence[str | float]) -> np.ndarray:
    """Numbers, or degrees, minutes and seconds with their marks."""
    found = pc.extract_regex(text, _SEXAGESIMAL)
    marked = pc.is_valid(found)
    if channel.unit != "deg" or not pc.any(marked).as_py():
        row = pc.index(pc.fill_null(pc.match_substring_regex(text, r"\d[\s,;]+[-+]?\d"), False), True).as_py()
        try:
            return cells.finite(cells.parsed(column, text), missing)
        except InputError:
            if row >= 0 and channel.part is None:
                hint = " If the cells hold latitude and longitude, write part = 1 in lat and part = 2 in lon."
                raise cells.unread(column, row, hint) from None
            raise
    plain = cells.finite(cells.parsed(column, pc.if_else(marked, None, text)), missing)
    minus = pc.fill_null(pc.not_equal(pc.struct_field(found, 0), ""), False).to_numpy(zero_copy_only=False)
    degrees, minutes, seconds = (
        pc.fill_null(
            pc.replace_substring(pc.if_else(pc.equal(part, ""), "0", part), ",", ".").cast(pa.float64()), 0.0
        ).to_numpy()
        for part in (pc.struct_field(found, k) for k in (1, 2, 3))
    )
    high = (minutes > 60.0) | (seconds > 60.0)  # 59.9999 is rounded to 60
    if high.any():
        raise cells.unread(column, int(np.argmax(high)), " Minutes and seconds are accepted up to 60.", "no position")
    size = degrees + minutes / 60.0 + seconds / 3600.0
    return np.where(marked.to_numpy(zero_copy_only=False), np.where(minus, -size, size), plain)


def _degrees(cells: Cells, column: str, channel: Channel, values: np.ndarray) -> np.ndarray:
    """Degrees of ddmm.mmmm."""
    whole, minutes = np.divmod(np.abs(values), 100.0)
    high = minutes > 60.0
    if high.any():
        hint = ' Its last two whole digits are minutes, accepted up to 60. Is it in degrees? Then unit = "deg".'
        raise cells.unread(column, int(np.argmax(high)), hint, f"not in {channel.unit}")
    return np.copysign(whole + minutes / 60.0, values)


def _sides_of(cells: Cells, column: str) -> np.ndarray:
    if not cells.is_text(column):
        raise InputError(f"{cells.path}: hemisphere column '{column}' holds numbers; accepted: N, S, E or W.")
    text = pc.utf8_upper(cells.texts(column))
    for word, letter in _WORDS.items():
        text = pc.if_else(pc.equal(text, word), letter, text)
    return text.to_numpy(zero_copy_only=False)


def _signed(cells: Cells, name: str, channel: Channel, values: np.ndarray, sides: np.ndarray) -> np.ndarray:
    """Values with north and east positive; a minus is accepted where it agrees with the letter."""
    there = np.isfinite(values) & np.array([s is not None for s in sides])
    accepted = SIDES[name]
    strange = there & ~np.isin(sides.astype(str), list(accepted))
    column = channel.hemisphere or channel.columns[0]
    if strange.any():
        row = int(np.argmax(strange))
        raise InputError(
            f"{cells.path}, row {cells.first_row + row}: '{column}' names the hemisphere {str(sides[row])[:20]}; "
            f"accepted for {name}: {' and '.join(accepted)}. Correct the column, or name another."
        )
    if channel.sign is not None and there.any():
        raise InputError(
            f"{cells.path}: '{column}' has letters of the hemisphere, and sign = '{channel.sign}' is set. Remove sign."
        )
    signs = np.array([accepted.get(s, 1.0) for s in sides])
    against = there & (values < 0.0) & (signs > 0.0)
    if against.any():
        row = int(np.argmax(against))
        raise cells.unread(channel.columns[0], row, f" Its minus contradicts the letter {sides[row]}.", "no position")
    return signs * np.abs(values)
