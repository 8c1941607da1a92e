"""Intervals of every model on one axis: a strip beside each name, in percent of its width, so that names and numbers
keep their size on a phone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ..render.linked import COLOURS
from ..render.svg import label, limits, ticks
from ..render.table import Table, TableColumn

TITLES = {
    "ed_mean": "Position error ED [m]",
    "edh_mean": "EDH [m]",
    "cvdm_mean": "cVDM [%]",
    "rank": "Mean rank, 1 is best",
}
"""Columns with an interval that are drawn, and the title of their axis."""
STYLE = """
.strips { display: grid; grid-template-columns: minmax(8rem, 17rem) minmax(0, 1fr);
  column-gap: .8rem; align-items: center; max-width: 62rem; }
.strips > span { overflow-wrap: anywhere; font-size: .88rem; } .strips small { color: var(--dim); white-space: nowrap; }
.strip { width: 100%; height: 1.6rem; display: block; overflow: visible; } .interval { stroke-width: 5; }
.strip .band { opacity: .3; }
.strip .dot { stroke: var(--paper); stroke-width: 1.5; }
@media (max-width: 40rem) { .strips { grid-template-columns: minmax(0, 1fr); }
  .strips > span:not(:empty) { margin-top: .4rem; } .strips > span:empty { display: none; } }
img { max-width: 100%; height: auto; background: #fff; }
"""
_EDGE = 3.0
"""Margin on either side, in percent of the width, for the numbers at the ends of the axis."""


@dataclass(frozen=True)
class _Scale:
    """Positions along a strip, in percent of its width."""

    low: float
    high: float
    log: bool

    def __call__(self, value: float) -> float:
        low, high = (np.log(x) if self.log else x for x in (self.low, self.high))
        at = (np.log(max(value, self.low)) if self.log else value) - low
        return float(_EDGE + (100.0 - 2.0 * _EDGE) * np.clip(at / (high - low), 0.0, 1.0))


def strips(table: Table) -> list[dict[str, Any]]:
    """Drawings, one for each column of `TITLES` that the table has: `title`, `rows` (model, text, svg) and the svg of
    the `axis`.

    A row's mean is a dot, its 95 % interval a bar; a pale band is the middle half of the runs, where the row holds it.
    """
    return [_strips(table, c) for c in table.columns if c.interval and c.key in TITLES]


def _strips(table: Table, column: TableColumn) -> dict[str, Any]:
    key = column.key
    middle = f"_{key.removesuffix('_mean')}_middle"
    rows = [
        (i, row) for i, row in enumerate(table.rows) if not row.get("_reference") and np.isfinite(row.get(key, np.nan))
    ]
    known = {
        i: [
            x
            for x in (row[key], row.get(f"{key}_low"), row.get(f"{key}_high"), *row.get(middle, ()))
            if x is not None and np.isfinite(x)
        ]
        for i, row in rows
    }
    (low, high), log = limits(
        [min(v) for v in known.values()], [max(v) for v in known.values()], [row[key] for _, row in rows]
    )
    scale = _Scale(low, high, log)
    marks = [(scale(value), label(value)) for value in ticks(low, high, log)]
    grid = "".join(f'<line class="grid" x1="{at:.2f}%" x2="{at:.2f}%" y1="0" y2="100%"/>' for at, _ in marks)
    axis = "".join(f'<text class="x" x="{at:.2f}%" y="14">{text}</text>' for at, text in marks)
    drawn = [
        (row["model"], _text(column, row), grid + _row(scale, row, key, middle, f"c{i % COLOURS}")) for i, row in rows
    ]
    return {
        "title": TITLES[key] + (", logarithmic" if log else ""),
        "rows": drawn,
        "axis": axis,
        "middle": any(middle in row for _, row in rows),
    }


def _row(scale: _Scale, row: dict[str, Any], key: str, middle: str, colour: str) -> str:
    parts = []
    if middle in row:
        a, b = (scale(x) for x in row[middle])
        parts.append(f'<rect class="band {colour}" x="{a:.2f}%" width="{max(b - a, 0.0):.2f}%" y="15%" height="70%"/>')
    low, high = row.get(f"{key}_low"), row.get(f"{key}_high")
    if low is not None and high is not None and np.isfinite([low, high]).all():
        parts.append(
            f'<line class="interval {colour}" x1="{scale(low):.2f}%" x2="{scale(high):.2f}%" y1="50%" y2="50%"/>'
        )
    return "".join(parts) + f'<circle class="dot {colour}" cx="{scale(row[key]):.2f}%" cy="50%" r="5"/>'


def _text(column: TableColumn, row: dict[str, Any]) -> str:
    between = column.interval_text(row)
    return column.text(row) + (f" ({between})" if between else "")
