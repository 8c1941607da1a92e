"""Progress in a notebook: one bar that is redrawn in place, without widgets."""

from __future__ import annotations

import sys
import time
from collections.abc import Mapping, Sequence
from html import escape

from ..names import shown
from .durations import Remaining, duration


def in_notebook() -> bool:
    """Whether this runs in the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"


_EVERY_S = 0.2
"""Seconds between two drawings of steps, of which there may be thousands."""


class _Place:
    """Output area of the page that is redrawn."""

    def __init__(self) -> None:
        from IPython.display import HTML, display

        self.html, self.handle = HTML, display(HTML(""), display_id=True)
        self.drawn = 0.0

    @property
    def due(self) -> bool:
        """Whether the last drawing is old enough."""
        return time.monotonic() - self.drawn >= _EVERY_S

    def draw(self, part: float, whole: float, text: str, below: Sequence[str] = ()) -> None:
        """Draw a bar with text behind it and lines below."""
        bar = f'<progress value="{part:g}" max="{whole:g}"></progress> {escape(shown(text))}'
        self.handle.update(self.html(f"<div>{bar}{''.join(f'<br>{escape(shown(line))}' for line in below)}</div>"))
        self.drawn = time.monotonic()


class NotebookSteps:
    """Progress bar for the steps of one piece of work, with the remaining time at the mean pace so far."""

    def __init__(self) -> None:
        self.place, self.began = _Place(), time.monotonic()

    def __call__(self, what: str, share: float) -> None:
        if self.place.due:
            spent = time.monotonic() - self.began
            left = f", about {duration(spent / share * (1.0 - share))} left" if share > 0.02 else ""
            self.place.draw(share, 1.0, f"{what}{left}")

    def finish(self) -> None:
        self.place.draw(1.0, 1.0, f"ended after {duration(time.monotonic() - self.began)}")


class NotebookBar:
    """Progress bar with the finished part, the remaining time and the current work; lines below it report problems."""

    def __init__(self) -> None:
        self.place = _Place()
        self.total, self.count, self.began, self.label = 0, 0, time.monotonic(), ""
        self.remaining = Remaining({})
        self.lines: list[str] = []

    def start(self, total: int, kinds: Mapping[str, int] | None = None) -> None:
        self.total, self.count, self.began = total, 0, time.monotonic()
        self.remaining = Remaining(kinds or {"": total})
        self._draw("")

    def working(self, label: str) -> None:
        self.label = label
        self._draw(label)

    def step(self, what: str, share: float) -> None:
        if self.place.due:
            self._draw(f"{self.label}: {what}")

    def done(self, label: str, outcome: str, kind: str = "", cost: float = 1.0) -> None:
        self.count += 1
        self.remaining.done(kind, cost)
        if not outcome.startswith("ok"):
            self.lines.append(f"{label}: {outcome}")
        self._draw("")

    def warn(self, text: str) -> None:
        self.lines.append(f"warning: {text}")
        self._draw(self.label)

    def finish(self) -> None:
        how = "finished in" if self.count == self.total else "stopped after"
        self._draw(f"{how} {duration(time.monotonic() - self.began)}", ended=True)

    def _draw(self, text: str, ended: bool = False) -> None:
        left = self.remaining.seconds(time.monotonic() - self.began)
        if left is not None and not ended:
            text = f"about {duration(left)} left {text}"
        self.place.draw(self.count, max(self.total, 1), f"{self.count}/{self.total} {text}", self.lines[-10:])
