"""Tables and paragraphs on a terminal: no line is longer than the terminal is wide, no name and no number is cut.

Columns that do not fit stand in a further table below the first, beside the names of the rows again.
"""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from rich.text import Text

from ..names import shown

if TYPE_CHECKING:
    from rich.console import Console

    from .table import Table, TableColumn

_GAP = 2
"""Columns of the screen between two columns of a table."""
_PROSE, _NARROW = 30, 22
"""A text that is longer than `_PROSE` may be wrapped, to `_NARROW` at least."""
MOST_INTERVALS = 8
"""Intervals of a table with more columns that have one stand on the page only."""


def paragraph(text: str, width: int, indent: str = "", hanging: str = "") -> list[str]:
    """Lines of at most `width`; `hanging` begins every line but the first. A word that is longer than a line is
    broken."""
    return textwrap.wrap(
        text, max(width, 20), initial_indent=indent, subsequent_indent=hanging or indent, break_on_hyphens=False
    )


def command_lines(command: str, width: int, indent: str = "  ") -> list[str]:
    """A command in lines of at most `width` that a shell takes as one: broken before an option, with a backslash at the
    end."""
    words = shlex.split(command)
    parts = [shlex.quote(words[0])] if words else []
    for word in words[1:]:
        if word.startswith("-"):
            parts.append(word)
        else:
            parts[-1] += f" {shlex.quote(word)}"
    lines = [indent + parts[0]] if parts else []
    for part in parts[1:]:
        if len(lines[-1]) + len(part) + 3 <= width:
            lines[-1] += f" {part}"
        else:
            lines[-1] += " \\"
            lines.append(f"{indent}  {part}")
    return lines


def show_table(table: Table, console: Console) -> None:
    """Print a table.

    Columns that do not fit stand in a further part, beside the names of the rows again. Names that take half of the
    screen stand on a line of their own above their figures. A table of words alone that does not fit becomes a list.
    """
    screen = _Screen(table, console.width)
    lines = [Text(shown(line), style="bold") for line in paragraph(table.title, console.width)]
    if table.columns:
        lines += screen.listed() if screen.is_prose else screen.folded()
    for note in table.notes:
        lines += [Text(shown(line), style="dim") for line in paragraph(note, console.width)]
    for line in [*lines, *([Text("")] if table.notes else [])]:
        console.print(line, no_wrap=True, overflow="ignore", crop=False)


class _Screen:
    """A table on a screen of `width` columns."""

    def __init__(self, table: Table, width: int) -> None:
        self.table, self.width = table, width
        self.between = sum(c.interval for c in table.columns) <= MOST_INTERVALS
        self.needed = [self._needed(column) for column in table.columns]
        self.least = [
            w if c.format or w <= _PROSE else _NARROW for w, c in zip(self.needed, table.columns, strict=True)
        ]

    @property
    def is_prose(self) -> bool:
        """Whether there are words alone, too many for columns side by side."""
        return (
            not any(c.format for c in self.table.columns)
            and sum(self.needed) + _GAP * (len(self.needed) - 1) > self.width
        )

    def _cell(self, column: TableColumn, row: dict[str, Any]) -> list[tuple[str, str]]:
        """Lines of a cell, each with its style."""
        style = "italic dim" if row.get("_reference") else ""
        lines = [(shown(line), style) for line in column.text(row).split("\n")]
        interval = column.interval_text(row) if self.between else ""
        return [*lines, (interval, "dim")] if interval else lines

    def _needed(self, column: TableColumn) -> int:
        """Room that no line of the column is wrapped in, and no word of its header is broken in."""
        cells = [len(line) for row in self.table.rows for line, _ in self._cell(column, row)]
        return max([1, *cells, *map(len, shown(column.header).split())])

    def _names(self) -> list[int]:
        """Places of the columns that name a row, which every part repeats: one before the first figure whose cells
        differ, else all of these."""
        columns = self.table.columns
        leading = range(max(next((i for i, c in enumerate(columns) if c.format is not None), 1), 1))
        for i in leading:
            cells = [columns[i].text(row) for row in self.table.rows]
            if len(set(cells)) == len(cells) and all(cells) and not any(cell.isdigit() for cell in cells):
                return [i]
        return list(leading)

    def folded(self) -> list[Text]:
        """The table in parts."""
        names = self._names()
        apart = sum(self.needed[i] + _GAP for i in names) > self.width // 2
        repeated = [] if apart else names
        room = self.width - sum(self.needed[i] + _GAP for i in repeated)
        parts: list[list[int]] = [[]]
        for i in (i for i in range(len(self.needed)) if i not in names):
            if parts[-1] and sum(self.least[j] + _GAP for j in [*parts[-1], i]) - _GAP > room:
                parts.append([])
            parts[-1].append(i)
        lines: list[Text] = []
        for number, part in enumerate(parts):
            shown_here = sorted([*repeated, *part]) if number == 0 else [*repeated, *part]
            lines += self._part(shown_here, names if apart else [])
        return lines

    def _widths(self, part: Sequence[int]) -> dict[int, int]:
        """Widths in one part: columns of prose share what is left."""
        widths = {i: min(self.least[i], self.width) for i in part}
        spare = self.width - sum(w + _GAP for w in widths.values()) + _GAP
        for i in part:
            more = max(0, min(self.needed[i] - widths[i], spare))
            widths[i] += more
            spare -= more
        return widths

    def _part(self, part: Sequence[int], apart: Sequence[int]) -> list[Text]:
        """Header, rule and rows of the columns `part`; `apart`: columns whose cells stand on a line above."""
        widths = self._widths(part)
        heads = {
            i: [(line, "bold") for line in textwrap.wrap(shown(self.table.columns[i].header), widths[i])] for i in part
        }
        deepest = max(map(len, heads.values()), default=0)
        heads = {i: [("", "")] * (deepest - len(lines)) + lines for i, lines in heads.items()}
        above = "  ".join(shown(self.table.columns[i].header) for i in apart)
        lines = [Text(line, style="bold") for line in paragraph(above, self.width)] + self._side_by_side(heads, widths)
        lines.append(Text("─" * min(self.width, max(len(line) for line in lines))))
        for row in self.table.rows:
            name = "  ".join(self.table.columns[i].text(row) for i in apart)
            lines += [Text(shown(line)) for line in paragraph(name, self.width)]
            lines += self._side_by_side({i: self._cell(self.table.columns[i], row) for i in part}, widths)
        return [*lines, Text("")]

    def _side_by_side(self, cells: dict[int, list[tuple[str, str]]], widths: dict[int, int]) -> list[Text]:
        wrapped = {
            i: [(part, style) for line, style in lines for part in _broken(line, widths[i])]
            for i, lines in cells.items()
        }
        found = []
        for k in range(max(map(len, wrapped.values()), default=0)):
            line = Text()
            for i, lines in wrapped.items():
                text, style = lines[k] if k < len(lines) else ("", "")
                line.append(
                    text.rjust(widths[i]) if self.table.columns[i].format else text.ljust(widths[i]), style=style
                ).append(" " * _GAP)
            line.rstrip()
            found.append(line)
        return found

    def listed(self) -> list[Text]:
        """One paragraph a row: its first cell and those without a header, then the others with their headers."""
        heads = [c for i, c in enumerate(self.table.columns) if i == 0 or not c.header]
        lines: list[Text] = []
        for row in self.table.rows:
            head = "  ".join(text for c in heads if (text := shown(c.text(row))))
            lines += [Text(line, style="bold") for line in paragraph(head, self.width)]
            for column in (c for c in self.table.columns if c not in heads):
                text = " ".join(shown(column.text(row), keep="\n").split())
                lines += (
                    [Text(line) for line in paragraph(f"{shown(column.header)}: {text}", self.width, "  ", "    ")]
                    if text
                    else []
                )
        return [*lines, Text("")]


def _broken(line: str, width: int) -> list[str]:
    return textwrap.wrap(line, width, break_on_hyphens=False) or [""] if len(line) > width else [line]
