"""Leaderboard as tables, with its head lines and summary."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..names import brief
from ..render.escaping import markdown_text
from ..render.html import Tile
from ..render.table import Table


@dataclass(frozen=True, eq=False)
class Board:
    """Tables of one data set, best model first; `ranking` holds the model specs in that order."""

    dataset: str
    ranking: list[str]
    tables: list[Table]
    head: list[str]
    """Lines on the origin of the figures."""
    heading: str = "Leaderboard"
    lead: str = ""
    """Sentence on the first model, its lead, and the certainty."""
    tiles: Sequence[Tile] = ()
    """Figures of the same result, for a page."""
    short: Table | None = None
    """Short table for a terminal."""

    def __repr__(self) -> str:
        return brief(f"<Board {self.title}: {len(self.tables)} tables; {', '.join(self.ranking)}>")

    @property
    def title(self) -> str:
        """Title of the page."""
        return f"{self.heading}: {self.dataset}"

    def markdown(self, command: str, plots: Sequence[str] = ()) -> str:
        """Page as Markdown; `command` is the command that rendered it, `plots` are image paths relative to it."""
        lines = [
            f"# {markdown_text(self.title)}",
            "",
            *[f"- {markdown_text(line)}" for line in [*self.head, f"Rendered by `{command}`."]],
            "",
        ]
        tables = [table.markdown() for table in self.tables]
        images = [f"![{Path(p).stem.replace('-', ' ')}]({p})\n" for p in plots]
        return "\n".join(["\n".join(lines), *tables[:1], *images, *tables[1:]])

    def as_json(self) -> dict[str, Any]:
        """Board as plain data."""
        return {
            "dataset": self.dataset,
            "ranking": self.ranking,
            "about": self.head,
            "tables": [t.as_json() for t in self.tables],
        }
