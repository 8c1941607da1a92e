"""Progress of a study: a bar with remaining time on a terminal, plain lines elsewhere, nothing when quiet. All on stderr."""

from __future__ import annotations

import sys
import time
from typing import Any, Protocol, TextIO

from ..names import shown


class Progress(Protocol):
    """What the runner tells: `total` cells; which model is being worked on; each cell as it ends; what is wrong meanwhile."""

    def start(self, total: int) -> None: ...

    def working(self, label: str) -> None: ...

    def done(self, label: str, outcome: str) -> None: ...

    def warn(self, text: str) -> None: ...

    def finish(self) -> None: ...


class Silent:
    """Says nothing but warnings."""

    def start(self, total: int) -> None: ...

    def working(self, label: str) -> None: ...

    def done(self, label: str, outcome: str) -> None: ...

    def warn(self, text: str) -> None:
        print(f"warning: {text}", file=sys.stderr, flush=True)

    def finish(self) -> None: ...


def duration(seconds: float) -> str:
    """Seconds as people say them: 42 s, 3 min 05 s, 1 h 12 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    return f"{whole // 60} min {whole % 60:02d} s" if whole < 3600 else f"{whole // 3600} h {whole % 3600 // 60:02d} min"


class Lines:
    """One line per finished cell, with the time that is left at the mean pace so far."""

    def __init__(self, stream: TextIO | None = None) -> None:
        self.stream = stream or sys.stderr
        self.total, self.count, self.began = 0, 0, time.monotonic()

    def start(self, total: int) -> None:
        self.total, self.count, self.began = total, 0, time.monotonic()

    def working(self, label: str) -> None:
        print(shown(f"        {label} ..."), file=self.stream, flush=True)

    def done(self, label: str, outcome: str) -> None:
        self.count += 1
        left = (time.monotonic() - self.began) / self.count * (self.total - self.count)
        after = f"; about {duration(left)} left" if self.count < self.total else ""
        print(shown(f"{f'[{self.count}/{self.total}]':>8s} {label}: {outcome}{after}"), file=self.stream, flush=True)

    def warn(self, text: str) -> None:
        print(f"warning: {text}", file=self.stream, flush=True)

    def finish(self) -> None:
        how = "finished in" if self.count == self.total else "stopped after"
        print(f"        {how} {duration(time.monotonic() - self.began)}", file=self.stream, flush=True)


class Bar:
    """A rich bar: cells done, elapsed and remaining time, the model being worked on."""

    def __init__(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn, TimeRemainingColumn

        self.progress = Progress(
            SpinnerColumn(), BarColumn(bar_width=24), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("left"),
            TimeRemainingColumn(), TextColumn("{task.description}", markup=False), console=Console(stderr=True), speed_estimate_period=3600,
        )  # fmt: skip
        self.bar: Any = None

    def start(self, total: int) -> None:
        self.bar = self.progress.add_task("", total=total)
        self.progress.start()

    def working(self, label: str) -> None:
        self.progress.update(self.bar, description=shown(label))

    def done(self, label: str, outcome: str) -> None:
        self.progress.advance(self.bar)
        if not outcome.startswith("ok"):
            self.progress.console.print(shown(f"{label}: {outcome}"), highlight=False, markup=False)

    def warn(self, text: str) -> None:
        self.progress.console.print(f"warning: {text}", highlight=False, markup=False)

    def finish(self) -> None:
        self.progress.update(self.bar, description="")
        self.progress.stop()


def make_progress(quiet: bool = False) -> Progress:
    """The reporter that fits the place: silent, bar or lines."""
    if quiet:
        return Silent()
    from .notebook_bar import NotebookBar, in_notebook

    if in_notebook():
        return NotebookBar()
    return Bar() if sys.stderr.isatty() else Lines()
