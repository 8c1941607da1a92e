"""Tables and paragraphs on a terminal: no line is longer than the terminal is wide, no name and no number is cut.

Columns that do not fit stand in a further table below the first, beside the names of the rows again.
"""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from ..names import shown

if TYPE_CHECKING:
    from rich.console import Console

    from .tables import Table, TableColumn

_GAP = 2
"""Columns of the screen between two columns of a table."""
_PROSE, _NARROW = 30, 22
"""A text that is longer than `_PROSE` may be wrapped, to `_NARROW` at least."""
MOST_INTERVALS = 8
"""Intervals of a table with more columns that have one stand on the page only."""


def paragraph(text: str, width: int, indent: str = "", hanging: str = "") -> list[str]:
    """Lines of at most `width`; `hanging` begins every line but the first. A word that is longer than a line is broken."""
    return textwrap.wrap(text, max(width, 20), initial_indent=indent, subsequent_indent=hanging or indent, break_on_hyphens=False)


def command_lines(command: str, width: int, indent: str = "  ") -> list[str]:
    """A command in lines of at most `width` that a shell takes as one: broken before an option, with a backslash at the end."""
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
    """Print a table, in several parts where its columns do not fit side by side."""
    from rich.text import Text

    if table.columns:
        names, parts = _parts(table, console.width)
        for i, part in enumerate(parts):
            _show_part(table, {**names, **part}, console, first=i == 0)
    for note in table.notes:
        console.print(Text(shown(note), style="dim"))


def _parts(table: Table, width: int) -> tuple[dict[int, int], list[dict[int, int]]]:
    """Place -> width on the screen of the columns that name a row, and of the others in each part; one part at least."""
    needed = [_width(table, column) for column in table.columns]
    leading = next((i for i, column in enumerate(table.columns) if column.format is not None), len(needed))
    count = leading if 0 < leading < len(needed) else 1  # a table of words alone is named by its first column
    rest = range(count, len(needed))
    least = {i: needed[i] if table.columns[i].format is not None else min(needed[i], _prose_width(table, i)) for i in rest}
    room = width - max((least[i] + _GAP for i in rest), default=0)
    names = _fitted(table, {i: needed[i] for i in range(count)}, room)
    left = width - sum(w + _GAP for w in names.values())
    parts: list[dict[int, int]] = [{}]
    for i in rest:
        if parts[-1] and sum(w + _GAP for w in parts[-1].values()) + least[i] > left:
            parts.append({})
        parts[-1][i] = least[i]
    return names, [_widened(part, needed, left) for part in parts]


def _fitted(table: Table, names: dict[int, int], room: int) -> dict[int, int]:
    """The names' columns within `room`: the widest is wrapped where they are wider."""
    names = dict(names)
    while (over := sum(w + _GAP for w in names.values()) - room) > 0:
        widest = max(names, key=lambda i: names[i])
        narrower = max(names[widest] - over, 8)
        if narrower == names[widest]:
            break
        names[widest] = narrower
    return names


def _widened(part: dict[int, int], needed: Sequence[int], left: int) -> dict[int, int]:
    """Columns of prose share what room is left."""
    spare = left - sum(w + _GAP for w in part.values()) + _GAP
    prose = [i for i in part if part[i] < needed[i]]
    while spare > 0 and prose:
        for i in prose:
            more = min(needed[i] - part[i], max(1, spare // len(prose)), spare)
            part[i] += more
            spare -= more
        prose = [i for i in prose if part[i] < needed[i]]
    return part


def _lines(table: Table, column: TableColumn) -> list[str]:
    """Every line that stands in a column, without its header."""
    return [shown(line) for row in table.rows for text in (column.text(row), _between(table, column, row)) for line in text.split("\n")]


def _between(table: Table, column: TableColumn, row: dict[str, Any]) -> str:
    return column.interval_text(row) if sum(c.interval for c in table.columns) <= MOST_INTERVALS else ""


def _width(table: Table, column: TableColumn) -> int:
    """Room that a column needs: its longest line, and no word of its header broken."""
    header = shown(column.header)
    words = max(map(len, header.split()), default=1)
    cells = max(map(len, _lines(table, column)), default=1)
    whole = len(header) if len(header) <= 12 else words
    return max(whole, cells, 1)


def _prose_width(table: Table, place: int) -> int:
    """Least room of a column of words: all of it where it is short, else its longest word within bounds."""
    needed = _width(table, table.columns[place])
    if needed <= _PROSE:
        return needed
    words = max((len(word) for line in _lines(table, table.columns[place]) for word in line.split()), default=1)
    return max(_NARROW, min(words, 2 * _NARROW), len(table.columns[place].header) if len(table.columns[place].header) <= _PROSE else 0)


def _show_part(table: Table, widths: dict[int, int], console: Console, first: bool) -> None:
    from rich import box
    from rich.table import Table as RichTable
    from rich.text import Text

    title = Text(shown(table.title), style="bold") if first else None
    rich = RichTable(title=title, title_justify="left", box=box.SIMPLE_HEAD, padding=(0, _GAP, 0, 0), pad_edge=False, show_edge=False)
    columns = [(table.columns[i], width) for i, width in widths.items()]
    for column, width in columns:
        rich.add_column(Text(shown(column.header)), justify="right" if column.format else "left", width=width, overflow="fold")
    for row in table.rows:
        cells = []
        for column, _ in columns:
            text, between = Text(shown(column.text(row), keep="\n")), _between(table, column, row)
            cells.append(text.append(f"\n{between}", style="dim") if between else text)
        rich.add_row(*cells, style="italic dim" if row.get("_reference") else None)
    console.print(rich)
    console.print()
