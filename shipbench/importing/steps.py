"""Clocks that stepped inside a pause of a log, found by the track, which shows the true duration of the pause."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from .blocks import Block, with_context
from .cells import Counts
from .clock import shown
from .mapping import Source
from .ordering import CONTEXT
from .thresholds import THRESHOLDS
from .track import Jumps, jumps, positions, usual, velocities


def steps_marked(blocks: Iterable[Block], source: Source, gap: float, met: Counts) -> Iterator[Block]:
    """Blocks with `new` where the clock stepped in a pause of up to `gap` [s] that would be bridged: a plain pause
    stays one.

    In a plain pause the ship moves by her speed times the pause; where the clock stepped, by less (set ahead) or more
    (set back).
    """
    channels = list(source.channels)
    for block, begin, end in with_context(blocks, CONTEXT):
        new = block.new.copy()
        track = positions(block.t, block.values, channels)
        if track is not None:
            for row, seconds in _steps(block, track, velocities(block.t, block.values, channels), gap):
                if begin <= row < end:
                    new[row] = True
                    way = "ahead" if seconds > 0 else "back"
                    met.clock.append(
                        f"the clock stepped {way} by about {abs(seconds):.2g} s in the pause from "
                        f"{shown(source.time, block.t[row - 1])} "
                        f"to {shown(source.time, block.t[row])}: the track shows less time than the stamps"
                    )
        yield Block(block.t, block.values, new).rows(slice(begin, end))


def _steps(block: Block, track: np.ndarray, stated: np.ndarray | None, gap: float) -> list[tuple[int, float]]:
    """Steps of the clock, as (first row after, seconds that it went ahead)."""
    rows = np.flatnonzero(np.isfinite(track).all(axis=1))
    t = block.t[rows]
    pauses = np.diff(t)
    anew = np.flatnonzero(np.diff(np.cumsum(block.new)[rows]) > 0) + 1
    least = THRESHOLDS.value("clock_step")
    joints = np.flatnonzero((pauses >= usual(pauses) + least) & (pauses <= gap * (1 + 1e-6))) + 1
    joints = np.setdiff1d(joints, anew)
    if not len(joints):
        return []
    bounds = np.r_[0, anew, len(rows)]

    def at(joints: np.ndarray) -> Jumps:
        place = np.searchsorted(bounds, joints, side="right")
        return jumps(t, track[rows], None if stated is None else stated[rows], joints, bounds[place - 1], bounds[place])

    plain = np.setdiff1d(np.flatnonzero(pauses < usual(pauses) + least) + 1, anew)
    found, every = at(joints), len(plain) // THRESHOLDS.count("plain_joints") + 1
    steps = []
    for k in np.flatnonzero(found.certain(least, at(plain[::every]))):
        a, b = rows[joints[k] - 1], rows[joints[k]]
        steps.append((int(a + 1 + np.argmax(np.diff(block.t[a : b + 1]))), float(found.seconds[k])))
    return steps
