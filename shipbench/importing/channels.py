"""Blocks of a log in our units and signs, with their times in order: the first step of every import."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .cells import EMPTY, Cells, Counts, is_text
from .clock import check_format, is_daily, shown, to_seconds
from .coordinates import unread_hemispheres
from .entries import Channel
from .mapping import Mapping, Source
from .tables import Table, open_table, reading
from .values import channel_values


@dataclass(frozen=True)
class Block:
    """Some rows of a log: times (n,) [s], values (n, channels) in our units with NaN where there is none."""

    t: np.ndarray
    values: np.ndarray

    def rows(self, select: slice | np.ndarray) -> Block:
        return Block(self.t[select], self.values[select])


def read_blocks(path: Path, source: Source, met: Counts) -> Iterator[tuple[str | None, Block]]:
    """(name in the run column or None, block) of a log, rows of one run after another.

    Raises:
        InputError: a column is missing, or a cell is not a number or not a time.
    """
    table = open_table(path, source.file)
    met.forms[path.name] = table.form
    clock, channels = source.time, list(source.channels.values())
    check_format(clock, str(path))
    columns = [*clock.names, *(n for c in channels for n in c.every_column), *([source.run] if source.run else [])]
    met.doubtful.update(unread_hemispheres(table, source))
    done = 0
    for batch in _without_footer(table, columns, source):
        where = f"{path}, rows from {table.first_row + done}"
        with reading(path):  # cells may be of any kind and size
            cells = Cells(table.path, batch, source, table.first_row + done, table.first_row, met)
            values = np.column_stack([channel_values(cells, name, c) for name, c in source.channels.items()])
            if clock.rate is not None:
                t = (done + np.arange(batch.num_rows)) / clock.rate + clock.shift
            else:
                t = to_seconds(clock, [batch.column(n) for n in clock.names], cells.numbers, where)
            names = cells.names(source.run) if source.run else None
        done += batch.num_rows
        met.rows += batch.num_rows
        stamped = np.isfinite(t)
        met.what["rows without a time, left out"] += int((~stamped).sum())
        yield from _by_name(Block(t, values), stamped, names, met)
    met.notes += [note for note in table.notes if note not in met.notes]
    if done == 0:
        raise InputError(f"{path} has a header and no rows. Give a log with one row per sample.")


def _without_footer(table: Table, columns: Sequence[str], source: Source) -> Iterator[pa.RecordBatch]:
    """The batches of a log, the last without a footer; what is left out is noted in the table."""
    batches = table.batches(columns)
    batch = next(batches, None)
    while batch is not None:
        after = next(batches, None)
        if after is None and source.time.names and (end := _footer(batch, source)) < len(batch):
            word = batch.column(source.time.names[0])[end].as_py()
            table.notes.append(f"{table.path.name}: {len(batch) - end} rows at the end, left out: '{word[:40]}' stands for their time")
            batch = batch.slice(0, end)
        yield batch
        batch = after


def _footer(batch: pa.RecordBatch, source: Source) -> int:
    """The row where a footer begins, such as "Total" or "End of log": a word for the time, empty cells beside it, and no time after it."""
    clock = batch.column(source.time.names[0])
    if not is_text(clock):
        return len(batch)
    text = pc.utf8_trim_whitespace(clock.cast(pa.large_string()))
    none = pc.fill_null(pc.is_in(text, pa.array([*EMPTY, *map(str, source.missing)], text.type)), True)
    timed = pc.fill_null(pc.match_substring_regex(text, r"\d"), False).to_numpy(zero_copy_only=False)
    begin = int(np.flatnonzero(timed)[-1]) + 1 if timed.any() else len(batch)
    words = np.flatnonzero(~none.to_numpy(zero_copy_only=False)[begin:]) + begin
    if len(words) and any(str(cells[int(words[0])].as_py() or "").strip() == "" for cells in batch.columns):
        return int(words[0])
    return len(batch)


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
