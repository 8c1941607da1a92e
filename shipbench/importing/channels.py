"""Blocks of a log in our units and signs, with their times in order: the first step of every import."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .clock import check_format, counts, is_daily, shown, to_seconds
from .mapping import Channel, Mapping, Source, channel_factor
from .tables import Table, open_table, reading

_EMPTY = ("", "NA", "N/A", "NaN", "nan", "NAN", "null", "NULL", "None", "#N/A", "NaT")
_GREATEST = 1e30
_TEXTS = (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)
_NUMBERS = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal, pa.types.is_boolean, pa.types.is_null)


@dataclass(frozen=True)
class Block:
    """Some rows of a log: times (n,) [s], values (n, channels) in our units with NaN where there is none."""

    t: np.ndarray
    values: np.ndarray

    def rows(self, select: slice | np.ndarray) -> Block:
        return Block(self.t[select], self.values[select])


@dataclass
class Counts:
    """What was met while reading, for the summary."""

    rows: int = 0
    what: Counter[str] = field(default_factory=Counter)
    forms: dict[str, str] = field(default_factory=dict)


def read_blocks(path: Path, source: Source, met: Counts) -> Iterator[tuple[str | None, Block]]:
    """(name in the run column or None, block) of a log, rows of one run after another.

    Raises:
        InputError: a column is missing, or a cell is not a number or not a time.
    """
    table = open_table(path, source.file)
    met.forms[path.name] = table.form
    clock, channels = source.time, list(source.channels.values())
    check_format(clock, str(path))
    columns = [*clock.names, *(c.column for c in channels), *([source.run] if source.run else [])]
    factors = [channel_factor(name, c) for name, c in source.channels.items()]
    done = 0
    for batch in table.batches(columns):
        where = f"{path}, rows from {table.first_row + done}"
        with reading(path):  # cells may be of any kind and size
            cells = _Cells(table, batch, source, table.first_row + done, met)
            values = np.column_stack([f * (cells.numbers(c.column) + c.offset) for f, c in zip(factors, channels, strict=True)])
            if clock.rate is not None:
                t = (done + np.arange(batch.num_rows)) / clock.rate + clock.shift
            else:
                typed = pa.types.is_timestamp(batch.column(clock.names[0]).type)
                numbers = cells.numbers(clock.names[0]) if counts(clock) and not typed else None
                t = to_seconds(clock, [batch.column(n) for n in clock.names], numbers, where)
            names = cells.names(source.run) if source.run else None
        _check_range(source, values, where)
        done += batch.num_rows
        met.rows += batch.num_rows
        stamped = np.isfinite(t)
        met.what["rows without a time, left out"] += int((~stamped).sum())
        yield from _by_name(Block(t, values), stamped, names, met)
    if done == 0:
        raise InputError(f"{path} has a header and no rows. Give a log with one row per sample.")


def _reads(text: str) -> bool:
    try:
        pa.scalar(text).cast(pa.float64())
    except pa.ArrowInvalid:
        return False
    return True


class _Cells:
    """The cells of one batch as numbers or names."""

    def __init__(self, table: Table, batch: pa.RecordBatch, source: Source, first_row: int, met: Counts) -> None:
        self.table, self.batch, self.source, self.first_row, self.met = table, batch, source, first_row, met
        self.texts = [m for m in source.missing if isinstance(m, str)]
        self.marks = [m for m in source.missing if not isinstance(m, str)]

    def numbers(self, column: str) -> np.ndarray:
        """(n,) floats; NaN where the cell is empty or one of the mapping's `missing`."""
        array = self.batch.column(column)
        if pa.types.is_dictionary(array.type):
            array = array.dictionary_decode()
        if any(is_kind(array.type) for is_kind in _TEXTS):
            array = self._parsed(column, array.cast(pa.large_string()))
        elif not any(is_kind(array.type) for is_kind in _NUMBERS):
            raise InputError(f"{self.table.path}: column '{column}' holds {array.type}; accepted: numbers.")
        values = pc.fill_null(array.cast(pa.float64(), safe=False), np.nan).to_numpy(zero_copy_only=False).astype(float)
        absurd = np.abs(values) > _GREATEST
        self.met.what[f"infinite values (above {_GREATEST:g}), taken as missing"] += int(absurd.sum())
        return np.where(absurd | np.isin(values, self.marks), np.nan, values)

    def _parsed(self, column: str, array: pa.Array) -> pa.Array:
        text = pc.utf8_trim_whitespace(array)
        text = pc.if_else(pc.is_in(text, pa.array([*_EMPTY, *self.texts], text.type)), None, text)
        number = pc.replace_substring(text, ",", ".") if self.source.file.decimal == "," else text
        try:
            return number.cast(pa.float64())
        except pa.ArrowInvalid:
            raise self._unread(column, text, number) from None

    def _unread(self, column: str, text: pa.Array, number: pa.Array) -> InputError:
        """The error for the first cell that is no number."""
        cells = enumerate(zip(text.to_pylist(), number.to_pylist(), strict=True))
        row, cell = next((k, c) for k, (c, n) in cells if n is not None and not _reads(n))
        hint = ' Set [file] decimal = "," in the mapping if it is a decimal comma.' if "," in cell and self.source.file.decimal == "." else ""
        if self.first_row == self.table.first_row and row == 0:
            hint += " If the rows under the header are units or remarks, set [file] skip."
        return InputError(
            f"{self.table.path}, row {self.first_row + row}: '{column}' is '{cell[:60]}', not a number.{hint} "
            f'Accepted: decimal numbers, empty cells, and what [missing] lists: missing = ["{cell[:20]}"] takes it as missing.'
        )

    def names(self, column: str) -> np.ndarray:
        """(n,) text, None where empty."""
        array = self.batch.column(column)
        text = pc.utf8_trim_whitespace(array.cast(pa.string()))
        return pc.if_else(pc.equal(pc.utf8_length(text), 0), None, text).to_numpy(zero_copy_only=False)


def _check_range(source: Source, values: np.ndarray, where: str) -> None:
    for j, name in enumerate(source.channels):
        limit = {"lat": np.pi / 2, "lon": 2 * np.pi}.get(name)
        if limit is not None and (np.abs(values[:, j]) > limit + 1e-9).any():
            worst = np.rad2deg(np.nanmax(np.abs(values[:, j])))
            raise InputError(f"{where}: '{name}' reaches {worst:g} deg; accepted: up to {np.rad2deg(limit):g}. Check unit and format of its column.")


def _by_name(block: Block, keep: np.ndarray, names: np.ndarray | None, met: Counts) -> Iterator[tuple[str | None, Block]]:
    if names is None:
        yield None, block.rows(keep)
        return
    nameless = np.array([n is None for n in names])
    met.what["rows without a run name, left out"] += int((nameless & keep).sum())
    block, names = block.rows(keep & ~nameless), names[keep & ~nameless]
    starts = np.flatnonzero(np.r_[True, names[1:] != names[:-1]]) if len(names) else np.array([], int)
    for begin, end in zip(starts, [*starts[1:], len(names)], strict=True):
        yield str(names[begin]), block.rows(slice(begin, end))


def in_order(blocks: Iterable[Block], source: Source, where: str, met: Counts) -> Iterator[Block]:
    """The blocks with times that never go back; rows that repeat a time stay where each brings other channels.

    Raises:
        InputError: time goes back, or so many rows repeat a time that the stamps are coarser than the samples.
    """
    last, last_row, rows, repeats = -np.inf, None, 0, 0
    if is_daily(source.time):
        blocks = _over_midnight(blocks)
    for block in _spread(blocks) if source.time.repeated == "spread" else blocks:
        if len(block.t) == 0:
            continue
        high = np.maximum.accumulate(np.r_[last, block.t])[:-1]
        back = block.t < high
        if back.any():
            k = int(np.argmax(back))
            if source.time.backwards == "error":
                raise InputError(
                    f"{where}: time goes back from {shown(source.time, high[k])} to {shown(source.time, block.t[k])} "
                    f"({int(back.sum())} such rows in one block). Sort the log; or, if it holds several runs, name their column (`run = ...`); "
                    'or leave such rows out with [time] backwards = "drop".'
                )
            met.what["rows that go back in time, left out"] += int(back.sum())
            block = block.rows(~back)
        before = np.vstack([np.full_like(block.values[:1], np.nan) if last_row is None else last_row, block.values[:-1]])
        same = np.diff(block.t, prepend=last) == 0.0
        repeats += int((same & (np.isfinite(before) & np.isfinite(block.values)).any(axis=1)).sum())
        rows += len(block.t)
        last, last_row = block.t[-1], block.values[-1:]
        yield block
    met.what["readings at a time that was there before, left out"] += repeats
    if repeats > 0.2 * rows:
        raise InputError(
            f"{where}: {repeats} of {rows} rows repeat the time of the row before: the stamps are coarser than the samples. "
            'Set [time] repeated = "spread" '
            "to spread such rows evenly until the next stamp, or use a finer time column."
        )


def _over_midnight(blocks: Iterable[Block]) -> Iterator[Block]:
    """Times of day, counted on: a step back by more than half a day is a new day."""
    last, days = -np.inf, 0
    for block in blocks:
        if len(block.t):
            new = days + np.cumsum(np.diff(block.t, prepend=last) < -43_200.0)
            last, days = block.t[-1], int(new[-1])
            yield Block(block.t + 86_400.0 * new, block.values)


def _spread(blocks: Iterable[Block]) -> Iterator[Block]:
    """Rows with one stamp, spread evenly until the next stamp; the last group is spread like the one before it."""
    rest: Block | None = None
    step = 0.0
    for block in blocks:
        if rest is not None:
            block = Block(np.r_[rest.t, block.t], np.vstack([rest.values, block.values]))
        starts = np.flatnonzero(np.diff(block.t, prepend=np.nan) != 0.0)
        if len(starts) > 1:
            lengths = np.diff(starts)
            steps = np.diff(block.t[starts]) / lengths
            within = np.arange(starts[-1]) - np.repeat(starts[:-1], lengths)
            step = steps[-1]
            yield Block(block.t[: starts[-1]] + within * np.repeat(steps, lengths), block.values[: starts[-1]])
        rest = block.rows(slice(starts[-1], None)) if len(starts) else None
    if rest is not None:
        yield Block(rest.t + step * np.arange(len(rest.t)), rest.values)


def all_channels(mapping: Mapping) -> dict[str, Channel]:
    """Every mapped channel, over all sources."""
    return {name: channel for source in mapping.sources.values() for name, channel in source.channels.items()}
