"""Progress in a notebook: one bar that is redrawn in its place. Jupyter brings all that it needs, without widgets."""

from __future__ import annotations

import sys
import time
from html import escape

from ..names import shown
from .progress import duration


def in_notebook() -> bool:
    """Whether this runs in the kernel of a notebook."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return type(shell).__name__ == "ZMQInteractiveShell"


class NotebookBar:
    """A bar with the finished part, the remaining time and the work at hand; lines below it on what did not go well."""

    def __init__(self) -> None:
        from IPython.display import HTML, display

        self.html, self.handle = HTML, display(HTML(""), display_id=True)
        self.total, self.count, self.began, self.label = 0, 0, time.monotonic(), ""
        self.lines: list[str] = []

    def start(self, total: int) -> None:
        self.total, self.count, self.began = total, 0, time.monotonic()
        self._draw("")

    def working(self, label: str) -> None:
        self.label = label
        self._draw(label)

    def step(self, what: str, share: float) -> None:
        self._draw(f"{self.label}: {what}" if self.label else what)

    def done(self, label: str, outcome: str) -> None:
        self.count += 1
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
        if self.count and not ended:
            left = (time.monotonic() - self.began) / self.count * (self.total - self.count)
            text = f"about {duration(left)} left {text}"
        bar = f'<progress value="{self.count}" max="{max(self.total, 1)}"></progress> {self.count}/{self.total} {escape(shown(text))}'
        below = "".join(f"<br>{escape(shown(line))}" for line in self.lines[-10:])
        self.handle.update(self.html(f"<div>{bar}{below}</div>"))
