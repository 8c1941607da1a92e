"""Data of linked plots: tracks and time histories of a run, drawn and tied together by `linked.js`.

The contract, as JSON in the page (macro `linked` of `macros.html.j2`):

    columns   one entry for each quantity: `name`, `label`, `unit`, `decimals`
    series    one entry for each line: `name`, `role` ("measured", or the number of a model: its colour and its
              switch `data-toggle`)
    track     names of the columns east and north [m], or null for a page without tracks
    histories names of the columns that are drawn against time, from the top
    runs      one entry for each run: `name`, `note`, `t`, `values[series][column]`, `outlines`, `cells[model]`, and
              `bands[series][column]` where a series has a band: half-widths about its values. A band is drawn while
              no other series with a band is switched on
    start     the number of the run shown first

`t` [s, two decimals], each `values[series][column]` and each of `bands` are whole numbers in the last decimal: the
first one, then the steps from the last finite value; null where nothing is drawn; a whole column that a series does not
have is null. `outlines` are closed polygons [[east...], [north...]] [m]. `cells` are texts for elements with
`data-cell="model-number"`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

COLOURS = 8
"""Colours of the style sheet (`--c0` to `--c7`); model i has colour i modulo this, and from there on other dashes.
`linked.js` does the same."""
_DASHES = ("", "7 3", "2 2", "8 2 2 2")
_LARGEST = 1e9
"""Largest value that is drawn; beyond it a prediction has diverged."""


def stroke(i: int) -> str:
    """Attributes of a line of model number `i`."""
    dash = _DASHES[(i + i // COLOURS) % len(_DASHES)]
    return f'class="line c{i % COLOURS}"' + (f' stroke-dasharray="{dash}"' if dash else "")


def switch(i: int, name: str) -> dict[str, Any]:
    """Values of model number `i` for the macros `switches` and `errors` of `macros.html.j2`."""
    return {"i": i, "name": name, "stroke": stroke(i)}


@dataclass(frozen=True)
class Quantity:
    """Column: its name, its label in words, the unit in which it is shown, and the decimals that are kept."""

    name: str
    label: str
    unit: str
    decimals: int


@dataclass(frozen=True)
class Line:
    """Series: its name and its role, "measured" or the number of a model."""

    name: str
    role: str | int


def packed(values: np.ndarray, decimals: int) -> list[int | None]:
    """Values (n,) as whole numbers of the last decimal, each as the step from the finite one before it; None where not
    finite."""
    found: list[int | None] = []
    last = 0
    for value in np.asarray(values, float).tolist():
        if np.isfinite(value) and abs(value) <= _LARGEST:
            now = round(value * 10**decimals)
            found.append(now - last)
            last = now
        else:
            found.append(None)
    return found


def linked_run(
    name: str,
    note: str,
    t: np.ndarray,
    columns: Sequence[Quantity],
    lines: Sequence[Mapping[str, np.ndarray]],
    outlines: Sequence[np.ndarray] = (),
    cells: Sequence[Sequence[str]] = (),
    bands: Sequence[Mapping[str, np.ndarray]] = (),
) -> dict[str, Any]:
    """Data of one run in the contract.

    Args:
        name, note: as the run selector shows them.
        t: (n,) [s].
        columns: as in `linked_plots`.
        lines: for each series its columns (n,) by name, in the units of `columns`; one that is missing is not drawn.
        outlines: closed polygons (points, 2), east and north [m].
        cells: texts for each model.
        bands: for each series the half-widths (n,) of its band by column, in the units of `columns`; or nothing.
    """
    drawn = {"bands": [_packed(band, columns) for band in bands]} if any(bands) else {}
    values = [_packed(line, columns) for line in lines]
    rings = [np.round(ring.T, 1).tolist() for ring in outlines]
    return {
        "name": name,
        "note": note,
        "t": packed(t, 2),
        "values": values,
        "outlines": rings,
        "cells": [list(row) for row in cells],
        **drawn,
    }


def _packed(line: Mapping[str, np.ndarray], columns: Sequence[Quantity]) -> list[list[int | None] | None]:
    return [packed(line[c.name], c.decimals) if c.name in line else None for c in columns]


def linked_plots(
    columns: Sequence[Quantity],
    lines: Sequence[Line],
    histories: Sequence[str],
    runs: Sequence[dict[str, Any]],
    track: tuple[str, str] | None = None,
    start: int = 0,
) -> dict[str, Any]:
    """Complete data of the contract; `runs` come from `linked_run`."""
    return {
        "columns": [asdict(c) for c in columns], "series": [asdict(s) for s in lines],
        "track": list(track) if track else None,
        "histories": list(histories), "runs": list(runs), "start": start,
    }  # fmt: skip
