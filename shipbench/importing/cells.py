"""Cells of a log as numbers, texts or names, with counts of irregular cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from ..errors import InputError
from .mapping import Source
from .numerals import Survey, UnreadError, no_number, survey, to_floats
from .thresholds import THRESHOLDS

EMPTY = ("", "NA", "N/A", "NaN", "nan", "NAN", "null", "NULL", "None", "#N/A", "NaT")
_TEXTS = (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)
_NUMBERS = (pa.types.is_integer, pa.types.is_floating, pa.types.is_decimal, pa.types.is_boolean, pa.types.is_null)


@dataclass
class Counts:
    """Counts of irregularities while reading, for the summary: `what` was left out, `doubtful` was kept, `notes` on the
    reading of files, `clock` on their clocks."""

    rows: int = 0
    what: Counter[str] = field(default_factory=Counter)
    doubtful: Counter[str] = field(default_factory=Counter)
    reach: dict[str, float] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    clock: list[str] = field(default_factory=list)
    forms: dict[str, str] = field(default_factory=dict)


class Cells:
    """Cells of one batch of a log; `first_row` is the number of its first row in the file, `top` that of the first data
    row."""

    def __init__(
        self, path: Path, batch: pa.RecordBatch, source: Source, first_row: int, top: int, met: Counts
    ) -> None:
        self.path, self.batch, self.source, self.first_row, self.top, self.met = (
            path,
            batch,
            source,
            first_row,
            top,
            met,
        )

    def numbers(self, column: str, missing: Sequence[str | float] | None = None) -> np.ndarray:
        """Numbers (n,); NaN where the cell is empty or one of `missing` (default: the source's).

        Raises:
            InputError: a cell is no number.
        """
        missing = self.source.missing if missing is None else missing
        array = self._array(column)
        if is_text(array):
            array = self.parsed(column, self.texts(column, missing))
        elif not any(is_kind(array.type) for is_kind in _NUMBERS):
            raise InputError(f"{self.path}: column '{column}' holds {array.type}; accepted: numbers.")
        return self.finite(array, missing)

    def finite(self, array: pa.Array, missing: Sequence[str | float]) -> np.ndarray:
        """Numbers (n,) of an array, NaN where there is no quantity."""
        values = pc.fill_null(array.cast(pa.float64(), safe=False), np.nan).to_numpy(zero_copy_only=False).astype(float)
        infinite = THRESHOLDS.value("infinite_reading")
        absurd = np.abs(values) > infinite
        self.met.what[f"infinite values (above {infinite:g}), taken as missing"] += int(absurd.sum())
        return np.where(absurd | np.isin(values, [m for m in missing if not isinstance(m, str)]), np.nan, values)

    def parsed(self, column: str, text: pa.Array) -> pa.Array:
        """Numbers (n,) of texts that stand in `column`, null where there is none.

        Raises:
            InputError: a cell is no number, or can be read in two ways.
        """
        try:
            return to_floats(text, self.source.file, lambda: self._survey)
        except UnreadError as error:
            raise self.unread(column, error.row, error.hint) from None

    def unread(self, column: str, row: int, hint: str = "", what: str = "not a number") -> InputError:
        """Error for a cell (rows of the batch from 0) that is no number, or another text on the fault."""
        cell = str(self._array(column)[row].as_py()).strip()
        if not hint and self.first_row == self.top and row == 0 and not any(c.isdigit() for c in cell):
            hint = " If the rows under the header are units or remarks, set [file] skip."
        return no_number(f"{self.path}, row {self.first_row + row}", column, cell, hint, what)

    def is_text(self, column: str) -> bool:
        """Whether the column holds texts, of numbers or others."""
        return is_text(self._array(column))

    def texts(self, column: str, missing: Sequence[str | float] = ()) -> pa.Array:
        """Trimmed text (n,), null where the cell is empty or one of `missing`."""
        text = pc.utf8_trim_whitespace(self._array(column).cast(pa.large_string()))
        marks = [*EMPTY, *(m for m in missing if isinstance(m, str))]
        return pc.if_else(pc.is_in(text, pa.array(marks, text.type)), None, text)

    def names(self, column: str) -> np.ndarray:
        """Text (n,), None where empty."""
        array = self.batch.column(column)
        text = pc.utf8_trim_whitespace(array.cast(pa.string()))
        return pc.if_else(pc.equal(pc.utf8_length(text), 0), None, text).to_numpy(zero_copy_only=False)

    def _array(self, column: str) -> pa.Array:
        array = self.batch.column(column)
        return array.dictionary_decode() if pa.types.is_dictionary(array.type) else array

    @cached_property
    def _survey(self) -> Survey:
        names = dict.fromkeys(n for c in self.source.channels.values() for n in c.columns)
        return survey(self.texts(name) for name in names if self.is_text(name))


def is_text(array: pa.Array) -> bool:
    """Whether an array holds texts."""
    return any(is_kind(array.type) for is_kind in _TEXTS)
