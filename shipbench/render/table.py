"""A table of raw values that renders as Markdown, on a terminal and as JSON."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from .escaping import markdown_text

if TYPE_CHECKING:
    pass

DISPLAY = {"rad": ("deg", 180.0 / math.pi), "rad/s": ("deg/s", 180.0 / math.pi), "N": ("kN", 1e-3)}
"""Unit of display for a stored unit: name and factor."""


def display_unit(unit: str) -> tuple[str, float]:
    """Unit that a table prints for `unit`, and the factor of the values."""
    return DISPLAY.get(unit, (unit, 1.0))


def number(digits: int) -> Callable[[Any], str]:
    """Format with that many decimals; missing values as a dash, too large ones in powers of ten."""

    def text(value: Any) -> str:
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return "-"
        return f"{value:.{digits}f}" if abs(value) < 1e6 else f"{value:.2e}"

    return text


def significant(digits: int) -> Callable[[Any], str]:
    """Format with that many significant digits; missing values as a dash."""

    def text(value: Any) -> str:
        if value is None or (isinstance(value, float) and math.isnan(value)):
            return "-"
        if abs(value) < 1e-9:  # rounding only
            return "0"
        if not 1e-3 <= abs(value) < 1e6:
            return f"{value:.{digits}g}"
        return f"{value:.{max(0, digits - 1 - math.floor(math.log10(abs(value))))}f}"

    return text


@dataclass(frozen=True)
class TableColumn:
    """Column of a table: header, key in the rows, and format of a value (None: text, left aligned).

    `interval`: the rows may hold the ends of an interval under `key_low` and `key_high`.
    """

    header: str
    key: str
    format: Callable[[Any], str] | None = None
    interval: bool = False

    def text(self, row: dict[str, Any]) -> str:
        """Cell of `row`."""
        value = row.get(self.key)
        return self.format(value) if self.format else "" if value is None else str(value)

    def interval_text(self, row: dict[str, Any]) -> str:
        """Interval of the cell, "" where there is none or its width is only rounding."""
        low, high = (row.get(f"{self.key}_{end}") for end in ("low", "high"))
        if not self.interval or self.format is None or low is None or high is None or not high - low > 1e-9:
            return ""
        return f"{self.format(low)} to {self.format(high)}"


@dataclass(frozen=True)
class Table:
    """Table whose rows are dicts by column key; a row with `_reference` true is quoted from elsewhere and printed in
    italics."""

    title: str
    columns: Sequence[TableColumn]
    rows: Sequence[dict[str, Any]]
    notes: Sequence[str] = field(default_factory=tuple)

    def markdown(self) -> str:
        """Heading, table and notes."""

        def cell_text(text: str) -> str:
            return markdown_text(" ".join(text.split())).replace("|", "\\|")

        lines = [f"## {markdown_text(self.title)}", ""]
        lines.append("| " + " | ".join(cell_text(c.header) for c in self.columns) + " |")
        lines.append("|" + "|".join("---:" if c.format else ":---" for c in self.columns) + "|")
        for row in self.rows:
            cells = [cell_text(c.text(row)) for c in self.columns]
            intervals = [c.interval_text(row).replace(" to ", " to\u00a0") for c in self.columns]  # wraps once at most
            cells = [
                f"{cell}<br><sub>{between}</sub>" if between else cell
                for cell, between in zip(cells, intervals, strict=True)
            ]
            if row.get("_reference"):
                cells = [f"*{cell}*" if cell else "" for cell in cells]
            lines.append("| " + " | ".join(cells) + " |")
        lines += [""] + [f"{markdown_text(note)}  " for note in self.notes]
        return "\n".join(lines).rstrip() + "\n"

    def as_json(self) -> dict[str, Any]:
        """Title, rows with raw values (NaN as null), notes."""

        def plain(value: Any) -> Any:
            value = value.item() if hasattr(value, "item") else value
            return None if isinstance(value, float) and not math.isfinite(value) else value

        keys = [
            key for c in self.columns for key in (c.key, *((f"{c.key}_low", f"{c.key}_high") if c.interval else ()))
        ]
        rows = [{key: plain(row.get(key)) for key in keys} for row in self.rows]
        return {
            "title": self.title,
            "columns": {c.key: c.header for c in self.columns},
            "rows": rows,
            "notes": list(self.notes),
        }


def table_cells(table: Table) -> dict[str, Any]:
    """Values for the macro `table` of `render/templates/macros.html.j2`: cells as text, with the value by which they
    are sorted.

    The head of a row is its model; in a table without models its first text. It stays visible when the table is
    scrolled sideways.
    """
    models = any(c.key == "model" for c in table.columns)
    heads = {
        c.key for i, c in enumerate(table.columns) if c.key == "model" or (not models and i == 0 and c.format is None)
    }
    lines = []
    for row in table.rows:
        cells = [
            {
                "text": c.text(row),
                "between": _between(c, row),
                "by": _sort_key(row.get(c.key)),
                "number": c.format is not None,
            }
            for c in table.columns
        ]
        lines.append({"cells": cells, "reference": bool(row.get("_reference"))})
    head = [{"text": c.header, "number": c.format is not None, "model": c.key in heads} for c in table.columns]
    return {"title": table.title, "head": head, "rows": lines, "notes": list(table.notes)}


def _between(column: TableColumn, row: dict[str, Any]) -> str:
    """The interval of a cell, where its row holds one under `key_low` and `key_high`."""
    low, high = row.get(f"{column.key}_low"), row.get(f"{column.key}_high")
    if column.format is None or low is None or high is None or not high > low:
        return ""
    return f"{column.format(low)} to {column.format(high)}"


def _sort_key(value: Any) -> str:
    """Number as text that a browser reads back; "" for a cell without a number, which comes last."""
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, bool | int | float):
        return repr(float(value)) if np.isfinite(value) else ""
    return "" if value is None else str(value)
