"""Columns of a log: heads, cells at the beginning, and these as numbers with the decimal and thousands marks that fit
all columns."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ...errors import InputError
from ..mapping import Layout
from ..table import Table
from ..tables import open_table
from ..thresholds import THRESHOLDS
from .heads import Head, read_head
from .layout import Form, find_form

_MARKS = ((".", ""), (",", ""), (".", ","), (",", "."), (".", " "), (",", " "), (".", "'"), (",", "'"))
"""Decimal and thousands marks, the usual ones first."""
_GROUPING = {".": "[.]", ",": ",", " ": "[ \u00a0\u2009\u202f]", "'": "['\u2019]"}
"""Characters that a thousands mark stands for, as the import reads them."""


@dataclass(frozen=True)
class Column:
    """Column of a log: its name in the mapping, its head, its cells and these as numbers (n,), NaN where a cell is
    none."""

    name: str
    head: Head
    cells: pa.Array
    values: np.ndarray

    @property
    def is_text(self) -> bool:
        """Whether the cells are texts."""
        return bool(pa.types.is_string(self.cells.type) or pa.types.is_large_string(self.cells.type))

    @property
    def known(self) -> np.ndarray:
        """Values that are numbers."""
        return self.values[np.isfinite(self.values)]

    def texts(self, count: int = 2000) -> list[str]:
        """Cells that are not empty, from the beginning."""
        return [
            text for cell in self.cells.slice(0, count).to_pylist() if cell is not None and (text := str(cell).strip())
        ]

    def evidence(self) -> str:
        """Text on the beginning of the column, for a comment."""
        if len(self.known) and len(self.known) >= THRESHOLDS.value("numeric_share") * len(self.texts(len(self.cells))):
            first = ", ".join(f"{v:.6g}" for v in self.known[:3])
            return f"first values {first}; {self.known.min():.6g} to {self.known.max():.6g}"
        return (
            f"first values {', '.join(repr(t[:24]) for t in self.texts(50)[:3])}"
            if self.texts(50)
            else "empty at the beginning"
        )


@dataclass(frozen=True)
class Sample:
    """Beginning of a log: `columns` that can be mapped, `form` in words, `file`, the [file] of its mapping, and `notes`
    for the reader."""

    path: Path
    form: str
    columns: tuple[Column, ...]
    file: dict[str, Any]
    notes: tuple[str, ...]

    @property
    def layout(self) -> Layout:
        return Layout(**self.file)


def read_samples(path: Path, given: dict[str, Any]) -> list[Sample]:
    """Read the beginning of a log: one sample, or of a MATLAB file one for each length of its vectors.

    Args:
        given: the [file] of a partial mapping.

    Raises:
        InputError: the log cannot be read, or it has no columns with names, or no rows.
    """
    form = find_form(path, given)
    table = open_table(path, form.layout)
    names = [name for name in dict.fromkeys(table.columns) if name and table.columns.count(name) == 1]
    if not names:
        raise InputError(f"{path} has no columns with names. Give a log with a header and rows.")
    return [_sample(path, form, table, _first(table, own), given) for own in _of_one_length(table, names)]


def _sample(path: Path, form: Form, table: Table, cells: pa.RecordBatch, given: dict[str, Any]) -> Sample:
    file, notes = dict(form.given), list(form.notes)
    marks = (file.get("decimal", "."), file.get("thousands", ""))
    if not {"decimal", "thousands"} & set(given):
        marks, unsure = _marks(cells.columns)
        notes += unsure
    file |= {
        key: mark for key, mark, usual in (("decimal", marks[0], "."), ("thousands", marks[1], "")) if mark != usual
    }
    by_number = form.layout.header == 0 and table.form.startswith(("text", "Excel"))
    columns = []
    for name, array in zip(cells.schema.names, cells.columns, strict=True):
        place = table.columns.index(name)
        unit = form.units[place] if place < len(form.units) else ""
        head = form.heads[place] if place < len(form.heads) else "" if by_number else name
        columns.append(Column(name, read_head(head, unit), array, numbers(array, *marks)))
    return Sample(path, table.form, tuple(columns), file, tuple(notes))


def _of_one_length(table: Table, names: list[str]) -> list[list[str]]:
    """Columns in groups of one length: only MATLAB's vectors differ; a vector shorter than ten is a parameter."""
    if not table.form.startswith("MATLAB"):
        return [names]
    groups: dict[int, list[str]] = {}
    for name in names:
        groups.setdefault(sum(batch.num_rows for batch in table.batches([name])), []).append(name)
    long = {length: group for length, group in groups.items() if length >= THRESHOLDS.count("least_samples")}
    return list((long or groups).values())


def _first(table: Table, names: list[str]) -> pa.RecordBatch:
    first = next(itertools.islice(table.batches(names), 1), None)
    if first is None or first.num_rows == 0:
        raise InputError(f"{table.path} has no rows. Give a log with a header and rows.")
    return first.slice(0, THRESHOLDS.count("proposal_rows"))


def numbers(array: pa.Array, decimal: str, thousands: str) -> np.ndarray:
    """Cells as numbers (n,), NaN where they are none."""
    if pa.types.is_string(array.type) or pa.types.is_large_string(array.type):
        text = pc.replace_substring(pc.utf8_trim_whitespace(array.cast(pa.string())), "\u2212", "-")
        good = pc.match_substring_regex(text, _pattern(decimal, thousands))
        text = pc.if_else(good, text, None)
        text = pc.replace_substring_regex(text, _GROUPING[thousands], "") if thousands else text
        return pc.replace_substring(text, decimal, ".").cast(pa.float64()).to_numpy(zero_copy_only=False)
    if not (pa.types.is_integer(array.type) or pa.types.is_floating(array.type) or pa.types.is_decimal(array.type)):
        return np.full(len(array), np.nan)
    return array.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)


def _pattern(decimal: str, thousands: str) -> str:
    whole = r"\d+" + (rf"|\d{{1,3}}({_GROUPING[thousands]}\d{{3}})+" if thousands else "")
    return rf"^[-+]?(({whole})([{decimal}]\d*)?|[{decimal}]\d+)([eE][-+]?\d+)?$"


def _marks(cells: list[pa.Array]) -> tuple[tuple[str, str], list[str]]:
    """Marks with which most cells of all columns are numbers, and a note where two ways fit as well."""
    texts = [
        pc.utf8_trim_whitespace(a.cast(pa.string()))
        for a in cells
        if pa.types.is_string(a.type) or pa.types.is_large_string(a.type)
    ]
    counts = {marks: sum(_count(text, _pattern(*marks)) for text in texts) for marks in _MARKS}
    most = max(counts.values(), default=0)
    best = next(marks for marks in _MARKS if counts.get(marks, 0) == most)
    for other in [
        marks for marks in _MARKS if counts[marks] == most and marks != best and marks[1] and marks[1] in best
    ]:
        for text in texts:
            plain, grouped = numbers(text, *best), numbers(text, *other)
            changed = np.isfinite(plain) & (plain != grouped)
            smoother = _roughness(grouped) < THRESHOLDS.value("thousands_gain") * _roughness(plain)
            if changed.any() and not changed.all() and smoother:
                return other, [
                    (
                        f"NOT SURE: '{text[int(np.argmax(changed))]}' is read as thousands: only so does its column "
                        "run "
                        "on without leaps."
                    )
                ]
    grouped_only = [
        t for t in texts if best[1] == "" and _count(t, rf"^\d{{1,3}}[{best[0]}]\d{{3}}$") == len(t.drop_null()) > 0
    ]
    others = sum(_count(t, rf"\d[{best[0]}]\d") for t in texts) - sum(len(t.drop_null()) for t in grouped_only)
    if grouped_only and others == 0:
        return best, [
            (
                f"NOT SURE: '{grouped_only[0][0]}' may have a decimal or a thousands mark; taken as decimal. Else set "
                "[file] thousands."
            )
        ]
    return best, []


def _roughness(values: np.ndarray) -> float:
    """Largest step from row to row over the range."""
    known = values[np.isfinite(values)]
    return float(np.abs(np.diff(known)).max() / np.ptp(known)) if len(known) > 2 and np.ptp(known) > 0 else 0.0


def _count(text: pa.Array, pattern: str) -> int:
    return int(pc.sum(pc.match_substring_regex(text, pattern)).as_py() or 0)
