"""How much work one diagnosis may take. It is counted where fits iterate, and asked for where another search would begin: what was found stands, what
was not looked for is said."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field


@dataclass
class Budget:
    """Limits of one diagnosis, or of one of its training parts, and what it has used.

    iterations: linearisations of all fits together (24 runs of 120 s take 50 to 500); seconds: CPU time of this process, which other work beside it
    does not change. From `overrun` times the limit on every fit ends where it stands, and nothing is named. stopped: iterations and seconds when the
    limit acted first.
    """

    iterations: int = 2000
    seconds: float = 900.0
    overrun: float = 2.0
    used: int = 0
    stopped: tuple[int, float] | None = None
    began: float = field(default_factory=time.process_time)

    @property
    def share(self) -> float:
        """Of the limits, that which is used up first."""
        return max(self.used / self.iterations, (time.process_time() - self.began) / self.seconds)

    @property
    def is_overrun(self) -> bool:
        """Whether fits end where they stand."""
        return self.share >= self.overrun

    def refuses(self) -> bool:
        """Whether no other search may begin; remembered."""
        if self.stopped is None and self.share >= 1.0:
            self.stopped = self.used, time.process_time() - self.began
        return self.stopped is not None

    def said(self, overrun: bool) -> list[str]:
        """A line for the reader where the limit has acted; overrun: so far that nothing is named."""
        if self.stopped is None:
            return []
        iterations, seconds = self.stopped
        stands = "Nothing is named." if overrun else "What is named so far stands; what could have followed was not looked for."
        return [
            f"stopped after {iterations} iterations of fits in {seconds:.0f} s of CPU time; the limits are {self.iterations} iterations and "
            f"{self.seconds:g} s. {stands} Diagnose fewer or shorter runs, or raise the limit with --cpu-limit SECONDS."
        ]


_NOW: ContextVar[Budget | None] = ContextVar("budget", default=None)


@contextmanager
def limited(budget: Budget) -> Iterator[Budget]:
    """Count the fits made inside against `budget`."""
    token = _NOW.set(budget)
    try:
        yield budget
    finally:
        _NOW.reset(token)


def count() -> None:
    """Count one iteration of a fit."""
    budget = _NOW.get()
    if budget is not None:
        budget.used += 1


def is_overrun() -> bool:
    """Whether fits end where they stand."""
    budget = _NOW.get()
    return budget is not None and budget.is_overrun


def is_spent() -> bool:
    """Whether no other search may begin."""
    budget = _NOW.get()
    return budget is not None and budget.refuses()
