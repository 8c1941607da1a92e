"""Progress of a study and of other long work: a bar with remaining time on a terminal, plain lines elsewhere, nothing
when quiet. All on stderr."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Protocol, TextIO

from ..names import shown
from ..steps import listening
from .durations import Remaining, duration


class Progress(Protocol):
    """Receiver of a study's progress: number of cells, current model, step of its fit, each finished cell, and
    warnings.

    `kinds`: number of cells of each kind; cells of one kind cost about the same. `cost` of a cell [s]: 0 where it was
    kept.
    """

    def start(self, total: int, kinds: Mapping[str, int] | None = None) -> None: ...

    def working(self, label: str) -> None: ...

    def step(self, what: str, share: float) -> None: ...

    def done(self, label: str, outcome: str, kind: str = "", cost: float = 1.0) -> None: ...

    def warn(self, text: str) -> None: ...

    def finish(self) -> None: ...


class Silent:
    """Reporter that prints warnings only."""

    def start(self, total: int, kinds: Mapping[str, int] | None = None) -> None: ...

    def working(self, label: str) -> None: ...

    def step(self, what: str, share: float) -> None: ...

    def done(self, label: str, outcome: str, kind: str = "", cost: float = 1.0) -> None: ...

    def warn(self, text: str) -> None:
        print(f"warning: {text}", file=sys.stderr, flush=True)

    def finish(self) -> None: ...


EVERY_S = 10.0
"""Seconds between two plain lines on one piece of work."""


class StepLines:
    """Reporter that prints a plain line on the steps of one piece of work every 10 s, with the remaining time at the
    mean pace so far."""

    def __init__(self, stream: TextIO | None = None, before: str = "") -> None:
        self.stream, self.before = stream or sys.stderr, before
        self.began = self.told = time.monotonic()

    def __call__(self, what: str, share: float) -> None:
        now = time.monotonic()
        if now - self.told < EVERY_S:
            return
        self.told = now
        left = f"; about {duration((now - self.began) * (1.0 - share) / share)} left" if share > 0.0 else ""
        print(shown(f"        {self.before}{what}, {100.0 * share:.0f} %{left}"), file=self.stream, flush=True)

    def finish(self) -> None:
        """Do nothing: printed lines stay."""


class StepBar:
    """Bar (rich) for the steps of one piece of work: share done, elapsed and remaining time, the step."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            Progress,
            SpinnerColumn,
            TaskProgressColumn,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        self.progress = Progress(
            SpinnerColumn(), BarColumn(bar_width=16), TaskProgressColumn(), TimeElapsedColumn(), TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.description}", markup=False), console=Console(stderr=True), speed_estimate_period=3600,
            transient=True,
        )  # fmt: skip
        self.bar = self.progress.add_task("", total=1.0)
        self.progress.start()

    def __call__(self, what: str, share: float) -> None:
        self.progress.update(self.bar, description=shown(what), completed=share)

    def finish(self) -> None:
        """Remove the bar."""
        self.progress.stop()


@contextmanager
def steps_shown(quiet: bool) -> Iterator[None]:
    """Show the steps (`shipbench.steps`) of the work inside."""
    if quiet:
        yield
        return
    from .notebook_bar import NotebookSteps, in_notebook

    shown_by = NotebookSteps() if in_notebook() else StepBar() if sys.stderr.isatty() else StepLines()
    try:
        with listening(shown_by):
            yield
    finally:
        shown_by.finish()


class Lines:
    """Reporter that prints one line per finished cell, with the remaining time."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self.stream = stream or sys.stderr
        self.total, self.count, self.began = 0, 0, time.monotonic()
        self.remaining = Remaining({})
        self.steps: StepLines | None = None

    def start(self, total: int, kinds: Mapping[str, int] | None = None) -> None:
        self.total, self.count, self.began = total, 0, time.monotonic()
        self.remaining = Remaining(kinds or {"": total})

    def working(self, label: str) -> None:
        self.steps = StepLines(self.stream, f"{label}: ")
        print(shown(f"        {label} ..."), file=self.stream, flush=True)

    def step(self, what: str, share: float) -> None:
        if self.steps is not None:
            self.steps(what, share)

    def done(self, label: str, outcome: str, kind: str = "", cost: float = 1.0) -> None:
        self.count += 1
        self.remaining.done(kind, cost)
        left = self.remaining.seconds(time.monotonic() - self.began)
        after = f"; about {duration(left)} left" if left is not None and self.count < self.total else ""
        print(shown(f"{f'[{self.count}/{self.total}]':>8s} {label}: {outcome}{after}"), file=self.stream, flush=True)

    def warn(self, text: str) -> None:
        print(f"warning: {text}", file=self.stream, flush=True)

    def finish(self) -> None:
        how = "finished in" if self.count == self.total else "stopped after"
        print(f"        {how} {duration(time.monotonic() - self.began)}", file=self.stream, flush=True)


class Bar:
    """Bar (rich) of cells done, elapsed and remaining time, and the current model."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

        self.progress = Progress(
            SpinnerColumn(), BarColumn(bar_width=24), MofNCompleteColumn(), TimeElapsedColumn(),
            TextColumn("{task.fields[left]}"),
            TextColumn("{task.description}", markup=False), console=Console(stderr=True),
        )  # fmt: skip
        self.bar: Any = None
        self.label, self.began, self.remaining = "", time.monotonic(), Remaining({})

    def start(self, total: int, kinds: Mapping[str, int] | None = None) -> None:
        self.began, self.remaining = time.monotonic(), Remaining(kinds or {"": total})
        self.bar = self.progress.add_task("", total=total, left="")
        self.progress.start()

    def working(self, label: str) -> None:
        self.label = label
        self.progress.update(self.bar, description=shown(label))

    def step(self, what: str, share: float) -> None:
        self.progress.update(self.bar, description=shown(f"{self.label}: {what}"))

    def done(self, label: str, outcome: str, kind: str = "", cost: float = 1.0) -> None:
        self.remaining.done(kind, cost)
        left = self.remaining.seconds(time.monotonic() - self.began)
        self.progress.update(self.bar, advance=1, left=f"about {duration(left)} left" if left is not None else "")
        if not outcome.startswith("ok"):
            self.progress.console.print(shown(f"{label}: {outcome}"), highlight=False, markup=False)

    def warn(self, text: str) -> None:
        self.progress.console.print(f"warning: {text}", highlight=False, markup=False)

    def finish(self) -> None:
        self.progress.update(self.bar, description="", left="")
        self.progress.stop()


def make_progress(quiet: bool = False) -> Progress:
    """Reporter that fits the output: silent, bar or lines."""
    if quiet:
        return Silent()
    from .notebook_bar import NotebookBar, in_notebook

    if in_notebook():
        return NotebookBar()
    return Bar() if sys.stderr.isatty() else Lines()
