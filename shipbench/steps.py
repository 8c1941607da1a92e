"""Progress of long work: functions report their current step to a listener. Without a listener nothing happens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

Listener = Callable[[str, float], None]
"""Function of the name of a step and the finished share of the whole work, 0 to 1."""


@dataclass
class _Now:
    """Current step: it takes the work from the share `begin` to `end`; ticks: iterations in it."""

    listener: Listener
    what: str = ""
    begin: float = 0.0
    end: float = 1.0
    ticks: int = 0

    def tell(self, share: float) -> None:
        self.listener(self.what, self.begin + share * (self.end - self.begin))


_NOW: ContextVar[_Now | None] = ContextVar("steps", default=None)


@contextmanager
def listening(listener: Listener) -> Iterator[None]:
    """Report to `listener` every step that begins inside, and its progress."""
    token = _NOW.set(_Now(listener))
    try:
        yield
    finally:
        _NOW.reset(token)


def step(what: str, begin: float, end: float) -> None:
    """Begin a step that takes the work from the share `begin` to `end`."""
    now = _NOW.get()
    if now is not None:
        now.what, now.begin, now.end, now.ticks = what, begin, end, 0
        now.tell(0.0)


def within(share: float, what: str = "") -> None:
    """Report the finished share of the step, 0 to 1; `what` renames it."""
    now = _NOW.get()
    if now is not None:
        now.what = what or now.what
        now.tell(min(max(share, 0.0), 1.0))


def tick(usual: int) -> None:
    """Count one iteration of a step that takes about `usual` of them; its progress slows down the more it takes."""
    now = _NOW.get()
    if now is not None:
        now.ticks += 1
        now.tell(1.0 - 0.5 ** (2.0 * now.ticks / usual))
