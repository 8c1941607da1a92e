"""Recordings of a log: its runs by name, also where their rows are interleaved, and its parts where the clock was set
back."""

from __future__ import annotations

import itertools
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .blocks import ROWS, Block
from .cells import Cells, Counts
from .channels import read_blocks, read_named
from .clock import is_daily
from .mapping import Source
from .table import reading
from .tables import open_table


def read_recordings(path: Path, source: Source, met: Counts) -> Iterator[tuple[str | None, Iterator[Block]]]:
    """Recordings as (name in the run column or None, its rows); read each to its end before the next.

    Where the rows of a run stand in several places, as those of ships in a log of AIS messages do, they are gathered on
    disk: memory does not grow. A place whose time begins anew, at or before the first time of that run, is a recording
    of its own.

    Raises:
        InputError: as `read_blocks`.
    """
    if source.run is None or not _in_several_places(path, source):
        for name, items in itertools.groupby(read_blocks(path, source, met), key=lambda item: item[0]):
            yield name, (block for _, block in items)
        return
    with tempfile.TemporaryDirectory(prefix="shipbench-import-") as folder:
        piles: list[_Pile] = []
        latest: dict[str, _Pile] = {}
        done = 0
        for names, block in read_named(path, source, met):
            for name, rows in _by_name(names):
                for part in _places(block.t[rows], rows):
                    t = block.t[rows[part]]
                    pile = latest.get(name)
                    if pile is None or (t[0] < pile.last and t[0] <= pile.first and not is_daily(source.time)):
                        pile = latest[name] = _Pile(
                            name, Path(folder) / str(len(piles)), done + int(rows[part][0]), float(t[0])
                        )
                        piles.append(pile)
                    pile.add(block.rows(rows[part]))
            done += len(names)
        for pile in sorted(piles, key=lambda pile: pile.row):
            yield pile.name, pile.blocks(len(source.channels))


@dataclass
class _Pile:
    """Rows of one recording, on disk; the number of its first row, its first and its latest time."""

    name: str
    path: Path
    row: int
    first: float
    last: float = -np.inf

    def add(self, block: Block) -> None:
        self.last = float(block.t[-1])
        with self.path.open("ab") as file:
            np.column_stack([block.t, block.values]).tofile(file)

    def blocks(self, channels: int) -> Iterator[Block]:
        with self.path.open("rb") as file:
            while len(rows := np.fromfile(file, count=ROWS * (channels + 1)).reshape(-1, channels + 1)):
                yield Block(rows[:, 0], rows[:, 1:])


def _by_name(names: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Names, each with its rows."""
    distinct, first, which = np.unique(names.astype(str), return_index=True, return_inverse=True)
    order = np.argsort(which, kind="stable")
    rows = np.split(order, np.cumsum(np.bincount(which))[:-1])
    for k in np.argsort(first):
        yield str(distinct[k]), rows[k]


def _places(t: np.ndarray, rows: np.ndarray) -> Iterator[slice]:
    """Rows in parts: a place whose time is before that of the place above begins one."""
    bounds = [0, *(np.flatnonzero((np.diff(rows) > 1) & (np.diff(t) < 0.0)) + 1).tolist(), len(rows)]
    for begin, end in itertools.pairwise(bounds):
        yield slice(begin, end)


def _in_several_places(path: Path, source: Source) -> bool:
    """Whether the rows of a run are not all in one place; reads the run column alone."""
    assert source.run is not None
    table = open_table(path, source.file)
    last, seen = None, set()
    for batch in table.batches([source.run]):
        with reading(path):
            names = Cells(table.path, batch, source, table.first_row, table.first_row, Counts()).names(source.run)
        names = names[np.array([n is not None for n in names], bool)]
        for name in names[np.r_[True, names[1:] != names[:-1]]] if len(names) else ():
            if name != last and name in seen:
                return True
            seen.add(name)
            last = name
    return False


def parts(blocks: Iterator[Block]) -> Iterator[Iterator[Block]]:
    """Rows in parts up to each place where the clock was set back; read each part to its end before the next."""
    number, last = 0, np.inf

    def numbered() -> Iterator[tuple[int, Block]]:
        nonlocal number, last
        for block in blocks:
            back = block.new & (block.t <= np.r_[last, block.t[:-1]])
            back[0] &= np.isfinite(last)
            bounds = [0, *np.flatnonzero(back).tolist(), len(block.t)]
            for begin, end in itertools.pairwise(bounds):
                number += bool(back[begin])
                if end > begin:
                    yield number, block.rows(slice(begin, end))
            last = block.t[-1]

    for _, items in itertools.groupby(numbered(), key=lambda item: item[0]):
        yield (block for _, block in items)


def onward(blocks: Iterator[Block], met: Counts) -> Iterator[Block]:
    """Rows of a source that is merged with others, without those that a clock that was set back counts again."""
    high, until = -np.inf, None
    for block in blocks:
        before = np.maximum.accumulate(np.r_[high, block.t])
        keep, new = np.ones(len(block.t), bool), block.new.copy()
        back = np.flatnonzero(block.new & (block.t <= before[:-1])).tolist()
        for k in ([0] if until is not None else []) + back:
            until = before[k]
            ahead = np.flatnonzero(block.t[k:] > until)
            stop = k + int(ahead[0]) if len(ahead) else len(block.t)
            keep[k:stop] = False
            if len(ahead):
                new[stop], until = True, None
        high = float(before[-1])
        met.what["rows that a clock that was set back counts again, left out"] += int((~keep).sum())
        kept = Block(block.t, block.values, new).rows(keep)
        if len(kept.t):
            yield kept
