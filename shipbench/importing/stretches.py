"""Stretches of time in which every channel has samples, from streams of several rates, with little in memory."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from .blocks import Block
from .resample import usual_step
from .thresholds import THRESHOLDS

_SLACK = 1e-6
"""Relative slack of comparisons of times: a gap of just the limit is none."""


@dataclass(frozen=True)
class Stretch:
    """Time span [start, end] [s] without gaps: `series` maps each channel to its times (m,) and values (m,), with some
    context before and after.

    `part` counts the parts of a span that is longer than the longest run, or in which a clock was set, from 0; `last`
    says that the span ends here.
    """

    start: float
    end: float
    series: dict[str, tuple[np.ndarray, np.ndarray]]
    part: int
    last: bool


@dataclass(frozen=True)
class Cut:
    """Time [s] that no run covers, and the channels without samples there."""

    start: float
    end: float
    channels: tuple[str, ...]


class Feed:
    """Stream of one source: it reads on demand and forgets used samples."""

    def __init__(self, blocks: Iterator[Block], channels: tuple[str, ...]) -> None:
        self.blocks, self.channels, self.done = blocks, channels, False
        self.t, self.values = np.empty(0), np.empty((0, len(channels)))
        self.first, self.last = np.nan, -np.inf
        self.breaks: list[tuple[float, float]] = []  # last time before, and first time after the clock was set
        self._old: dict[
            str, tuple[float, float]
        ] = {}  # last sample of each channel that was dropped: what is held from then on

    def fill(self, until: float) -> None:
        """Read until a sample at or after `until` is there, or the stream ends."""
        t, values = [self.t], [self.values]
        while not self.done and self.last < until:
            block = next(self.blocks, None)
            if block is None:
                self.done = True
            elif len(block.t):
                self.first = block.t[0] if np.isnan(self.first) else self.first
                before = np.r_[self.last, block.t[:-1]]
                self.breaks += [
                    (float(before[k]), float(block.t[k])) for k in np.flatnonzero(block.new) if np.isfinite(before[k])
                ]
                self.last = float(block.t[-1])
                t.append(block.t)
                values.append(block.values)
        if len(t) > 1:
            self.t, self.values = np.concatenate(t), np.concatenate(values)

    def drop(self, before: float) -> None:
        """Forget samples before `before`."""
        k = int(np.searchsorted(self.t, before))
        if k == 0:
            return
        for j, name in enumerate(self.channels):
            there = np.flatnonzero(np.isfinite(self.values[:k, j]))
            if len(there):
                self._old[name] = (float(self.t[there[-1]]), float(self.values[there[-1], j]))
        self.t, self.values = self.t[k:].copy(), self.values[k:].copy()

    def series(self, channel: str) -> tuple[np.ndarray, np.ndarray]:
        """Times and values of the samples in memory; of several at one time the first."""
        column = self.values[:, self.channels.index(channel)]
        there = np.isfinite(column)
        t, v = self.t[there], column[there]
        if channel in self._old:
            t, v = np.r_[self._old[channel][0], t], np.r_[self._old[channel][1], v]
        new = np.diff(t, prepend=-np.inf) > 0.0
        return t[new], v[new]


class Stretches:
    """Iterator over the stretches of one log.

    Afterwards `cuts` holds the times left out, `start` and `end` the span of the log, `steps` the typical time between
    the samples of each channel at the beginning.

    Args:
        feeds: the sources, on one clock.
        gaps: longest pause of each channel [s].
        held: channels whose last value holds until the next (commands).
        longest: longest stretch [s]; longer ones come in parts.
        step: time between the end of a part and the beginning of the next [s].
        context: length of a stretch's series beyond it [s].
    """

    def __init__(
        self, feeds: list[Feed], gaps: Mapping[str, float], held: frozenset[str], longest: float, step: float,
        context: float
    ) -> None:  # fmt: skip
        self.feeds, self.gaps, self.held, self.longest, self.step = feeds, gaps, held, longest, step
        self.finite_gap = max((g for g in gaps.values() if np.isfinite(g)), default=0.0)
        self.context = max(context, 2.0 * self.finite_gap)
        self.cuts: list[Cut] = []
        self.start, self.end = np.nan, np.nan
        self.steps: dict[str, float] = {}

    def __iter__(self) -> Iterator[Stretch]:
        for feed in self.feeds:
            feed.fill(-1e308)
        self.start = min((f.first for f in self.feeds if not np.isnan(f.first)), default=np.nan)
        if np.isnan(self.start):
            return
        self.steps = {name: usual_step(feed.series(name)[0]) for feed in self.feeds for name in feed.channels}
        self._limit_memory()
        at, part, covered, expected = self.start, 0, self.start, np.nan
        while True:
            for feed in self.feeds:
                feed.drop(at - self.context)
                feed.fill(at + self.longest + self.context)
            finished = all(f.done for f in self.feeds)
            horizon = min((f.last for f in self.feeds if not f.done), default=np.inf)
            pieces = {name: self._pieces(feed, name) for feed in self.feeds for name in feed.channels}
            resume = None
            for begin, end in _common(list(pieces.values()), at, max(f.last for f in self.feeds)):
                if self._clock_set(covered, begin):
                    covered = begin
                elif begin != expected:  # not the continuation of the part before
                    part = 0
                    self._note(covered, begin, pieces)
                    covered = begin
                if not finished and begin > at and end > horizon - self.finite_gap * (1 + _SLACK):
                    resume = begin  # it may go on: read on from its beginning
                    break
                cut = end - begin > self.longest * (1 + _SLACK)
                if cut:
                    end = begin + self.longest
                yield Stretch(begin, end, self._context(begin, end, pieces), part, not cut and not self._clock_set(end))
                covered, part = end, part + 1
                if cut:
                    resume = expected = end + self.step
                    break
            if resume is None:
                if finished:
                    break
                resume = max(horizon, at)
            at = resume
        self.end = max(f.last for f in self.feeds)
        self._note(covered, self.end, pieces)

    def _clock_set(self, end: float, begin: float = np.inf) -> bool:
        """Whether a clock was set just after `end` (and just before `begin`): no pause, but nothing may be joined
        there."""
        near = self.finite_gap * (1 + _SLACK)
        breaks = [b for feed in self.feeds for b in feed.breaks]
        return any(
            end <= before <= end + near and (after <= begin <= after + near or begin == np.inf)
            for before, after in breaks
        )

    def _limit_memory(self) -> None:
        """Shorten the parts of a log that is sampled so densely that the longest part would not fit."""
        rates = [len(f.t) * len(f.channels) / (f.last - f.first) for f in self.feeds if f.last > f.first]
        held = THRESHOLDS.count("readings_in_memory") / max(sum(rates), 1e-9)
        steps = min(max(int(held / self.step), 1), THRESHOLDS.count("samples_of_a_part"))
        self.longest = min(self.longest, steps * self.step)

    def _pieces(self, feed: Feed, channel: str) -> np.ndarray:
        """Times (m, 2) of the first and last sample of the channel's pieces without gaps."""
        t, _ = feed.series(channel)
        if len(t) == 0:
            return np.empty((0, 2))
        gap = self.gaps[channel] * (1 + _SLACK)
        breaks = np.flatnonzero(np.diff(t) > gap)
        if channel not in self.held:  # what was ordered stays ordered when the clock is set
            set_at = np.array([after for _, after in feed.breaks])
            breaks = np.union1d(breaks, np.searchsorted(t, set_at[(set_at > t[0]) & (set_at <= t[-1])]) - 1)
        ends = t[np.r_[breaks, len(t) - 1]]
        if channel in self.held:  # a command holds until the next, at most as long as the limit
            ends = np.minimum(ends + self.gaps[channel], max(f.last for f in self.feeds))
            ends = np.maximum(ends, t[np.r_[breaks, len(t) - 1]])
        elif not feed.done and feed.last - ends[-1] <= gap:
            ends[-1] = feed.last
        return np.column_stack([t[np.r_[0, breaks + 1]], ends])

    def _context(
        self, start: float, end: float, pieces: dict[str, np.ndarray]
    ) -> dict[str, tuple[np.ndarray, np.ndarray]]:
        """Samples of the piece that each channel has around [start, end]."""
        found = {}
        for feed in self.feeds:
            for name in feed.channels:
                spans = pieces[name]
                first, last = spans[np.searchsorted(spans[:, 0], start, side="right") - 1]
                t, v = feed.series(name)
                low, high = max(first, start - self.context), min(last, end + self.context)
                a = min(int(np.searchsorted(t, start, side="right")) - 1, int(np.searchsorted(t, low)))
                b = int(np.searchsorted(t, high, side="right"))
                found[name] = (t[a:b], v[a:b])
        return found

    def _note(self, start: float, end: float, pieces: dict[str, np.ndarray]) -> None:
        if end <= start:
            return
        middle = 0.5 * (start + end)
        silent = tuple(
            n for n, spans in pieces.items() if not ((spans[:, 0] <= middle) & (spans[:, 1] >= middle)).any()
        )
        self.cuts.append(Cut(start, end, silent))


def _common(pieces: list[np.ndarray], low: float, high: float) -> list[tuple[float, float]]:
    """Spans inside [low, high] that every list of spans covers."""
    common = [(low, high)]
    for spans in pieces:
        both = []
        for a, b in common:
            first = int(np.searchsorted(spans[:, 1], a))
            for c, d in spans[first:]:
                if c > b:
                    break
                both.append((max(a, float(c)), min(b, float(d))))
        common = [(a, b) for a, b in both if b > a]
    return common
