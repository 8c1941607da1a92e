"""Progress of long work: whoever works says at which step it is, whoever shows that listens. Without a listener nothing
happens."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass

Listener = Callable[[str, float], None]
"""Takes the name of a step and the share of the whole work that is done, 0 to 1."""


@dataclass
class _Now:
    """The step at work: it takes the work from the share `begin` to `end`; ticks: iterations in it."""

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
    """Tell `listener` of every step that begins inside, and how far it is."""
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
    """Say how much of the step is done, 0 to 1; `what` renames it."""
    now = _NOW.get()
    if now is not None:
        now.what = what or now.what
        now.tell(min(max(share, 0.0), 1.0))


def tick(usual: int) -> None:
    """Count one iteration of a step that takes about `usual` of them; it nears its end the slower the more it takes."""
    now = _NOW.get()
    if now is not None:
        now.ticks += 1
        now.tell(1.0 - 0.5 ** (2.0 * now.ticks / usual))
