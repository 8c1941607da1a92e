"""Positions that a faster log repeats between two fixes of the receiver: only the rows where the fix changes are
used."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from .blocks import Block
from .cells import Counts
from .thresholds import THRESHOLDS
from .track import usual

_WITH_THE_FIX = ("psi", "u", "v", "r", "sog", "cog")
"""Channels that may come from the same receiver."""


class _Held:
    """Time between the receiver's fixes [rows], for one pair of channels; carried from block to block."""

    def __init__(self) -> None:
        self.last = np.full(2, np.nan)
        self.age = np.zeros(2, int)  # rows since each coordinate changed
        self.longest = 1
        self.apart = False


def fixes_only(blocks: Iterable[Block], channels: tuple[str, ...], met: Counts) -> Iterator[Block]:
    """Blocks with NaN in place of a repeated position, and of other channels of the same receiver.

    A position is repeated where it stands still for rows and then jumps by more than the resolution of its numbers.
    Where it moves by single steps of its resolution it is slow or coarse, and is left as it is. Positions that stand
    still for longer than twice the usual stay in the log.
    """
    pair = next(
        (
            [channels.index(a), channels.index(b)]
            for a, b in (("x", "y"), ("lat", "lon"))
            if a in channels and b in channels
        ),
        None,
    )
    if pair is None:
        yield from blocks
        return
    state, told = _Held(), False
    for block in blocks:
        rows = np.flatnonzero(np.isfinite(block.values[:, pair]).all(axis=1))
        moved = np.diff(block.values[rows][:, pair], axis=0, prepend=state.last[None, :]) != 0.0
        if len(rows):
            _decide(block.values[rows][:, pair], moved, state)
            state.last = block.values[rows[-1], pair]
        if state.longest < 2 or not len(rows):
            state.age[:] = 0
            yield block
            continue
        values = block.values.copy()
        changed = moved if state.apart else np.repeat(moved.any(axis=1)[:, None], 2, axis=1)
        stale = _stale(changed, state)
        for k, column in enumerate(pair):
            values[rows[stale[:, k]], column] = np.nan
        if not told:
            told = True
            every = usual(np.diff(block.t[rows[changed[:, 0]]]))
            names = ", ".join(channels[c] for c in pair)
            met.clock.append(
                f"{names} are held between fixes, which come every {every:.3g} s; only rows where the fix changes "
                "are taken"
            )
        if not state.apart:
            for column in _companions(block.values[rows], changed[:, 0], channels):
                values[rows[stale[:, 0]], column] = np.nan
        yield Block(block.t, values, block.new)


def _decide(p: np.ndarray, moved: np.ndarray, state: _Held) -> None:
    """Set the most rows for which a fix is usually held, and whether the two coordinates are renewed in different
    rows."""
    starts = np.flatnonzero(moved.any(axis=1))
    if len(starts) < THRESHOLDS.count("fix_changes"):  # the block before decides
        return
    share = THRESHOLDS.value("fix_share")
    stands = np.diff(starts)
    leaps = np.abs(np.diff(p[starts], axis=0))
    long = stands >= 2
    steps = np.column_stack([leaps[:, k] / _resolution(leaps[:, k], p[:, k]) for k in range(2)]).max(axis=1)
    held = long.any() and np.mean(steps[long] > THRESHOLDS.value("fix_leap")) > share
    both, fewer, more = int(moved.all(axis=1).sum()), *sorted(moved.sum(axis=0))
    state.apart = bool(both < THRESHOLDS.value("renewed_together") * fewer and fewer >= share * more)
    if state.apart:
        stands = np.concatenate([np.diff(np.flatnonzero(moved[:, k])) for k in range(2)])
    state.longest = int(np.quantile(stands, THRESHOLDS.value("fix_quantile"), method="higher")) if held else 1


def _resolution(leaps: np.ndarray, p: np.ndarray) -> float:
    """Step of the grid of the readings, as far as their jumps show it; their rounding where they lie on none."""
    rounding = 16.0 * np.finfo(float).eps * max(float(np.max(np.abs(p))), 1e-300)
    sizes = np.unique(np.r_[0.0, leaps])
    spaces = np.diff(sizes)
    spaces = spaces[spaces > rounding]
    return float(spaces.min()) if len(spaces) else rounding


def _stale(changed: np.ndarray, state: _Held) -> np.ndarray:
    """Mask (n, 2) of rows that repeat a fix: all since the last change, up to twice the usual time; then one in that
    time is kept."""
    ages = np.empty(changed.shape, int)
    for k in range(2):
        rows = np.arange(len(changed))
        last = np.maximum.accumulate(np.where(changed[:, k], rows, -1))
        ages[:, k] = np.where(last >= 0, rows - last, rows + 1 + state.age[k])
    state.age = ages[-1]
    return (ages > 0) & ((ages < 2 * state.longest) | (ages % state.longest > 0))


def _companions(values: np.ndarray, fix: np.ndarray, channels: tuple[str, ...]) -> list[int]:
    """Columns of the same receiver: they change only where the fix does, at most fixes."""
    found = []
    for column, name in enumerate(channels):
        if name in _WITH_THE_FIX:
            change = np.diff(values[:, column], prepend=np.nan) != 0.0
            if change[1:][~fix[1:]].sum() == 0 and change[fix].mean() > THRESHOLDS.value("fix_share"):
                found.append(column)
    return found
