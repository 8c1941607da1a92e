"""Limits of work and memory of one diagnosis.

Work is counted where fits iterate. Every loop over fits, candidates or forms checks `is_spent`. Then fits stop where
they are, and results of these fits are not reported. Earlier results stand; parts that were not searched are stated.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field

from ..errors import InputError
from ..steps import tick


@dataclass
class Budget:
    """Limits of one diagnosis, or of one of its training parts, and the work done.

    iterations: linearisations of all fits together; seconds: CPU time of this process, which other processes do not
    change; gigabytes: of the arrays of one linearisation. stopped: iterations and seconds when the limit acted first.
    """

    iterations: int = 2000
    seconds: float = 900.0
    gigabytes: float = 8.0
    used: int = 0
    stopped: tuple[int, float] | None = None
    began: float = field(default_factory=time.process_time)

    @property
    def is_spent(self) -> bool:
        """Check whether a limit is reached; remembered."""
        seconds = time.process_time() - self.began
        if self.stopped is None and (self.used >= self.iterations or seconds >= self.seconds):
            self.stopped = self.used, seconds
        return self.stopped is not None

    def part(self, parts: int) -> Budget:
        """Budget of one of `parts`, which share the remaining seconds."""
        left = self.seconds - (time.process_time() - self.began)
        return Budget(self.iterations, max(left, 0.0) / parts, self.gigabytes)

    def said(self, nothing: bool) -> list[str]:
        """Line for the reader where the limit has acted; nothing: so early that no cause is identified."""
        if self.stopped is None:
            return []
        iterations, seconds = self.stopped
        stands = (
            "The plain model did not converge, so no cause is named." if nothing
            else "The causes named so far are valid; further ones were not searched."
        )  # fmt: skip
        return [
            f"stopped after {iterations} iterations of fits in {seconds:.0f} s of CPU time; the limits are "
            f"{self.iterations} iterations and "
            f"{self.seconds:g} s. {stands} Diagnose fewer or shorter runs, or raise the limit with --cpu-limit SECONDS."
        ]

    def refuse_large(self, pieces: int, samples: int, columns: int) -> None:
        """Refuse a linearisation of `columns` at so many samples of each segment, before it is made.

        Raises:
            InputError: it would take more than the `gigabytes`.
        """
        products, sensitivities = columns**2, samples * columns
        needed = 8e-9 * pieces * (3 * 6 * (products + sensitivities))  # of six channels, three copies at once
        if needed > self.gigabytes:
            raise InputError(
                f"the record: {pieces} pieces of {samples} samples with {columns} columns would take {needed:.3g} "
                "GB of memory. "
                f"Accepted: up to {self.gigabytes:g} GB, here {int(pieces * self.gigabytes / needed)} pieces, one "
                "or more for each run. "
                "Diagnose fewer runs."
            )


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
    """Count one iteration of a fit, also for the progress."""
    tick(60)  # about as many in one step of a diagnosis
    budget = _NOW.get()
    if budget is not None:
        budget.used += 1


def is_spent() -> bool:
    """Check whether the diagnosis in progress has to end."""
    budget = _NOW.get()
    return budget is not None and budget.is_spent


def refuse_large(pieces: int, samples: int, columns: int) -> None:
    """Refuse a large linearisation of the diagnosis in progress, see `Budget.refuse_large`."""
    (_NOW.get() or Budget()).refuse_large(pieces, samples, columns)
