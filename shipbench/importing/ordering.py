"""Ordering of a recording's rows by time: late rows, clocks that were set back, and rows that share a stamp."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .blocks import ROWS, Block, joined, with_context
from .cells import Counts
from .clock import is_daily, shown
from .constants import DAY
from .mapping import Source
from .thresholds import THRESHOLDS
from .track import positions, usual, was_set_back

CONTEXT = THRESHOLDS.count("decision_rows")
"""Rows before and after a row that a decision on its time uses."""


def in_order(blocks: Iterable[Block], source: Source, where: str, met: Counts) -> Iterator[Block]:
    """Blocks with times that go back only where `new` marks a clock that was set back; rows that repeat a time stay
    where each has other channels.

    Raises:
        InputError: time goes back and [time] backwards does not say what to do; so many rows repeat a time that the
            stamps are coarser than the samples; or there are too many rows to sort.
    """
    if is_daily(source.time):
        blocks = _over_midnight(blocks)
    if source.time.backwards == "sort":
        blocks = _sorted(blocks, source, where, met)
    if source.time.repeated == "spread":
        blocks = _spread(blocks)
    last, last_row, rows, repeats = -np.inf, None, 0, 0
    for block in _forwards(blocks, source, where, met):
        before = np.vstack(
            [np.full_like(block.values[:1], np.nan) if last_row is None else last_row, block.values[:-1]]
        )
        same = (np.diff(block.t, prepend=last) == 0.0) & ~block.new
        repeats += int((same & (np.isfinite(before) & np.isfinite(block.values)).any(axis=1)).sum())
        rows += len(block.t)
        last, last_row = block.t[-1], block.values[-1:]
        yield block
    met.what["readings at a time that was there before, left out"] += repeats
    if repeats > THRESHOLDS.value("coarse_stamps") * rows:
        raise InputError(
            f"{where}: {repeats} of {rows} rows repeat the time of the row before: the stamps are coarser than the "
            "samples. "
            'Set [time] repeated = "spread" '
            "to spread such rows evenly until the next stamp, or use a finer time column."
        )


@dataclass
class _State:
    """Latest time of the recording so far, rows since its beginning, and whether late rows are being left out."""

    high: float = -np.inf
    rows: int = 0
    late: bool = False


def _forwards(blocks: Iterable[Block], source: Source, where: str, met: Counts) -> Iterator[Block]:
    """Rows whose time increases, or that begin a recording of their own."""
    state = _State()
    for block, begin, end in with_context(blocks, CONTEXT):
        keep, new = np.ones(end - begin, bool), block.new[begin:end].copy()
        repeated = _set_back_by_a_step(block, begin, end, source)
        at = begin
        while at < end:
            if state.late:  # rows of a burst that was late, until the stamps have caught up
                ahead = np.flatnonzero(block.t[at:end] >= state.high)
                stop = at + int(ahead[0]) if len(ahead) else end
                keep[at - begin : stop - begin] = False
                met.what["rows that go back in time, left out"] += stop - at
                state.late, at = not len(ahead), stop
                continue
            part = slice(at, min(at + 2_000, end))
            high = np.maximum.accumulate(np.r_[state.high, block.t[part]])
            event = (block.t[part] < high[:-1]) | repeated[at - begin : part.stop - begin] | block.new[part]
            event[0] &= state.rows > 0
            k = int(np.argmax(event)) if event.any() else part.stop - at
            state.high, state.rows = high[k], state.rows + k
            at += k
            if k == part.stop - part.start:
                continue
            if block.new[at] or repeated[at - begin] or _begins_anew(block, at, state, source, where):
                new[at - begin] = True
                met.clock.append(
                    f"the clock was set back: after {shown(source.time, state.high)} comes "
                    f"{shown(source.time, block.t[at])}; nothing is joined there"
                )
                state.high, state.rows, at = block.t[at], 1, at + 1
            else:
                state.late = True
        kept = Block(block.t[begin:end], block.values[begin:end], new).rows(keep)
        if len(kept.t):
            yield kept


def _begins_anew(block: Block, k: int, state: _State, source: Source, where: str) -> bool:
    """Whether row k, which goes back in time, begins a recording of its own (else it is late).

    Raises:
        InputError: the mapping does not say that time may go back.
    """
    if source.time.backwards == "split":
        return True
    if source.time.backwards == "error":
        raise InputError(
            f"{where}: time goes back from {shown(source.time, state.high)} to {shown(source.time, block.t[k])}. "
            "Sort the log; or, if it holds several runs, name their column (`run = ...`). "
            'Or set [time] backwards: "sort" where rows are out of order, "drop" to leave such rows out, "split" '
            "where the clock was set back."
        )
    seen = _seen(block, k, max(k - state.rows, 0), state.high, source)
    if seen is not None:
        return seen
    # Without a track: late rows are followed by a leap ahead to the present; a clock that was set back goes on at its
    # pace.
    ahead = np.flatnonzero(block.t[k:] >= state.high)
    if not len(ahead):
        return len(block.t) - k > THRESHOLDS.count("rows_of_a_recording")
    e = k + int(ahead[0])
    pace = _pace(block, k, max(k - state.rows, 0))
    return bool(block.t[e] - block.t[e - 1] <= THRESHOLDS.value("pace_after_late_rows") * pace)


def _pace(block: Block, k: int, low: int) -> float:
    """Typical time between the rows before row k, from `low` on, in the order of time; of the rows after it where there
    are none."""
    rows = THRESHOLDS.count("rows_of_a_pace")
    before = usual(np.diff(np.sort(block.t[max(k - rows, low) : k])))
    return before if before > 0.0 else usual(np.diff(block.t[k : k + rows]))


def _seen(block: Block, k: int, low: int, high: float, source: Source) -> bool | None:
    """Whether the track shows that the clock was set back at row k, the latest time before it being `high`; None where
    it cannot."""
    near = _pace(block, k, low)
    depth = high - float(block.t[k])
    least = THRESHOLDS.count("rows_of_a_pace")
    reach = int(min(max(THRESHOLDS.value("rows_of_a_lag") * depth / near, least), CONTEXT)) if near > 0.0 else least
    rows = block.rows(slice(max(k - reach, low), k + reach))
    track = positions(rows.t, rows.values, list(source.channels))
    if track is None:
        return None
    there = np.flatnonzero(np.isfinite(track).all(axis=1))
    return was_set_back(rows.t[there], track[there], int(np.searchsorted(there, k - max(k - reach, low))), depth + near)


def _set_back_by_a_step(block: Block, begin: int, end: int, source: Source) -> np.ndarray:
    """Mask (end - begin,) of rows that repeat the stamp before them because the clock was set back by one step, by the
    track.

    Rounded stamps also repeat now and again: where there are several such rows, they count as rounded.
    """
    found = np.zeros(end - begin, bool)
    if source.time.repeated == "spread":
        return found
    steps = np.diff(block.t)
    side = THRESHOLDS.count("rows_of_a_repeat")
    alone = [
        int(k) + 1
        for k in np.flatnonzero(steps == 0.0)
        if np.count_nonzero(steps[max(k - side, 0) : k + side + 1] <= 0.0) == 1
    ]
    seen = [k for k in alone if _seen(block, k, 0, float(block.t[k]), source)]
    if len(seen) == 1 and begin <= seen[0] < end:
        found[seen[0] - begin] = True
    return found


def _sorted(blocks: Iterable[Block], source: Source, where: str, met: Counts) -> Iterator[Block]:
    """Rows sorted by time; rows behind a clock that was set back, by the track, are sorted on their own.

    Raises:
        InputError: more rows than fit in memory.
    """
    everything, size, most = [], 0, THRESHOLDS.count("readings_in_memory")
    for block in blocks:
        everything.append(block)
        size += block.values.size + block.t.size
        if size > most:
            raise InputError(
                f'{where}: more than {most:.0g} readings with [time] backwards = "sort", which sorts in '
                "memory; accepted: fewer. "
                "Sort the file itself by its time column, or split it."
            )
    if not everything:
        return
    whole = joined(everything)
    parts, begin, high = [], 0, -np.inf
    for k in np.flatnonzero(np.diff(whole.t, prepend=-np.inf) < 0.0).tolist():
        high = float(whole.t[begin:k].max())
        if whole.t[k] < high and _seen(whole, k, begin, high, source):
            parts.append(slice(begin, k))
            begin = k
    moved = 0
    for part in [*parts, slice(begin, None)]:
        rows = whole.rows(part)
        order = np.argsort(rows.t, kind="stable")
        moved += int((order != np.arange(len(order))).sum())
        rows = rows.rows(order)
        rows.new[0] = part.start > 0
        for first in range(0, len(rows.t), ROWS):
            yield rows.rows(slice(first, first + ROWS))
    met.what["rows sorted by time"] += moved


def _over_midnight(blocks: Iterable[Block]) -> Iterator[Block]:
    """Times of day, unwrapped: a step back by more than half a day is a new day."""
    last, days = -np.inf, 0
    for block in blocks:
        if len(block.t):
            new = days + np.cumsum(np.diff(block.t, prepend=last) < -THRESHOLDS.value("new_day"))
            last, days = block.t[-1], int(new[-1])
            yield Block(block.t + DAY * new, block.values, block.new)


def _spread(blocks: Iterable[Block]) -> Iterator[Block]:
    """Rows with one stamp, spread evenly until the next stamp; the last group, or one before a step back, is spread
    like the one before it."""
    rest: Block | None = None
    step = 0.0
    for block in blocks:
        if rest is not None:
            block = joined([rest, block])
        starts = np.flatnonzero(np.diff(block.t, prepend=np.nan) != 0.0)
        if len(starts) > 1:
            lengths = np.diff(starts)
            steps = np.diff(block.t[starts]) / lengths
            for k in np.flatnonzero(steps < 0.0):
                steps[k] = steps[k - 1] if k else step
            within = np.arange(starts[-1]) - np.repeat(starts[:-1], lengths)
            step = steps[-1]
            done = block.rows(slice(0, starts[-1]))
            yield Block(done.t + within * np.repeat(steps, lengths), done.values, done.new)
        rest = block.rows(slice(starts[-1], None)) if len(starts) else None
    if rest is not None:
        yield Block(rest.t + step * np.arange(len(rest.t)), rest.values, rest.new)
