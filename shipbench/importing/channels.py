"""Blocks of a log in standard units and signs, with their times in order: the first step of every import."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .blocks import Block
from .cells import EMPTY, Cells, Counts, is_text
from .clock import check_format, to_seconds
from .coordinates import check_hemispheres
from .entries import Channel
from .mapping import Mapping, Source
from .table import Table, reading
from .tables import open_table
from .values import channel_values


def read_blocks(path: Path, source: Source, met: Counts) -> Iterator[tuple[str | None, Block]]:
    """Blocks of a log, as (name in the run column or None, block), rows of one run after another.

    Raises:
        InputError: a column is missing, or a cell is not a number or not a time.
    """
    for names, block in read_named(path, source, met):
        if source.run is None:
            yield None, block
            continue
        starts = np.flatnonzero(np.r_[True, names[1:] != names[:-1]]) if len(names) else np.array([], int)
        for begin, end in zip(starts, [*starts[1:], len(names)], strict=True):
            yield str(names[begin]), block.rows(slice(begin, end))


def read_named(path: Path, source: Source, met: Counts) -> Iterator[tuple[np.ndarray, Block]]:
    """Blocks of a log, as (names (n,) in the run column, if any, and block), in the order of the file; rows without a
    time or a name are left out.

    Raises:
        InputError: a column is missing, or a cell is not a number or not a time.
    """
    table = open_table(path, source.file)
    met.forms[path.name] = table.form
    clock, channels = source.time, list(source.channels.values())
    check_format(clock, str(path))
    columns = [*clock.names, *(n for c in channels for n in c.every_column), *([source.run] if source.run else [])]
    done = 0
    for batch in _without_footer(table, columns, source):
        where = f"{path}, rows from {table.first_row + done}"
        with reading(path):  # cells may be of any kind and size
            cells = Cells(table.path, batch, source, table.first_row + done, table.first_row, met)
            values = np.column_stack([channel_values(cells, name, c) for name, c in source.channels.items()])
            if clock.rate is not None:
                t = (done + np.arange(batch.num_rows)) / clock.rate + clock.shift
            else:
                t = to_seconds(clock, [batch.column(n) for n in clock.names], cells.numbers, where, met.clock)
            names = cells.names(source.run) if source.run else np.full(len(t), None)
        if done == 0:
            check_hemispheres(table, source)  # after faults of single cells, which say more
        done += batch.num_rows
        met.rows += batch.num_rows
        keep = np.isfinite(t)
        met.what["rows without a time, left out"] += int((~keep).sum())
        nameless = np.array([n is None for n in names], bool) if source.run else np.zeros(len(t), bool)
        met.what["rows without a run name, left out"] += int((nameless & keep).sum())
        keep &= ~nameless
        yield names[keep], Block(t, values).rows(keep)
    met.notes += [note for note in table.notes if note not in met.notes]
    if done == 0:
        raise InputError(f"{path} has a header and no rows. Give a log with one row per sample.")


def _without_footer(table: Table, columns: Sequence[str], source: Source) -> Iterator[pa.RecordBatch]:
    """Batches of a log, the last without a footer; rows left out are noted in the table."""
    batches = table.batches(columns)
    batch = next(batches, None)
    while batch is not None:
        after = next(batches, None)
        if after is None and source.time.names and (end := _footer(batch, source)) < len(batch):
            word = batch.column(source.time.names[0])[end].as_py()
            table.notes.append(
                f"{table.path.name}: {len(batch) - end} rows at the end, left out: '{word[:40]}' stands for their time"
            )
            batch = batch.slice(0, end)
        yield batch
        batch = after


def _footer(batch: pa.RecordBatch, source: Source) -> int:
    """Row where a footer begins, such as "Total" or "End of log": a word for the time, empty cells beside it, and no
    time after it."""
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


def all_channels(mapping: Mapping) -> dict[str, Channel]:
    """Mapped channels of all sources."""
    return {name: channel for source in mapping.sources.values() for name, channel in source.channels.items()}
