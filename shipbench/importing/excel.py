"""Excel workbooks (.xlsx) through openpyxl, row by row; needs the extra `shipbench[excel]`."""

from __future__ import annotations

import datetime
import itertools
import zipfile
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import pyarrow as pa

from ..errors import InputError, option
from ..extras import needed_by
from .mapping import Layout
from .table import MOST_COLUMNS, Table, as_batch, most_unpacked
from .thresholds import THRESHOLDS

_ROWS = 20_000
"""Rows of a block: fewer than of other logs, since each cell is a Python object."""


def open_excel(path: Path, layout: Layout) -> Table:
    """Open the sheet named in the mapping, else the only one.

    Raises:
        InputError: openpyxl is not installed, or the file is no workbook, holds more than 1 GB (100 MB of texts), or
            has several sheets and none is named.
    """
    _check_book(path)
    header = next(itertools.islice(_rows(path, layout), (layout.header or layout.skip + 1) - 1, None), None)
    if header is None or all(cell is None for cell in header):
        raise InputError(
            f"{path}: row {layout.header} holds no header ([file] header = {layout.header}). Set the number of the "
            "row with the names."
        )
    columns = tuple("" if cell is None else str(cell).strip() for cell in header)
    if not layout.header:
        columns = tuple(str(k + 1) for k in range(len(columns)))
    if len(columns) > MOST_COLUMNS:
        raise InputError(f"{path} has {len(columns)} columns; accepted: up to {MOST_COLUMNS}.")

    def stream(wanted: Sequence[str]) -> Iterator[pa.RecordBatch]:
        places = [columns.index(name) for name in wanted]
        body = itertools.islice(_rows(path, layout), layout.header + layout.skip, None)
        empty = True
        while block := list(itertools.islice(body, _ROWS)):
            empty = False
            yield as_batch(
                {
                    name: [_cell(row[i]) if i < len(row) else None for row in block]
                    for name, i in zip(wanted, places, strict=True)
                }
            )
        if empty:
            raise InputError(f"{path} has a header and no rows. Give a log with one row per sample.")

    return Table(path, columns, stream, layout.header + layout.skip + 1, "Excel")


def first_rows(path: Path, layout: Layout, count: int) -> list[list[Any]]:
    """Cells of the first rows of a sheet, of any type, for the search of the header."""
    _check_book(path)
    return [[_cell(cell) for cell in row] for row in itertools.islice(_rows(path, layout), count)]


def _check_book(path: Path) -> None:
    """Check that the library is installed, and that the file is a workbook of a size that can be read."""
    with needed_by(f"{path}: reading .xlsx", "Save the sheet as CSV"):
        import openpyxl  # noqa: F401
    if not zipfile.is_zipfile(path):
        raise InputError(f"{path} is no Excel workbook or is cut short. Save it anew as .xlsx, or as CSV.")
    with zipfile.ZipFile(path) as packed:
        parts = packed.infolist()
    size, whole = (
        sum(p.file_size for p in parts),
        sum(p.file_size for p in parts if not p.filename.startswith("xl/worksheets/")),
    )
    largest, texts = THRESHOLDS.count("workbook_size"), THRESHOLDS.count("workbook_texts")
    if size > largest or whole > texts or size > most_unpacked(path):
        raise InputError(
            f"{path} has {path.stat().st_size / 1e6:.1f} MB and holds {size / 1e6:.0f} MB unpacked, "
            f"{whole / 1e6:.0f} MB of them texts and styles; "
            f"accepted: up to {largest / 1e6:.0f} MB, {texts / 1e6:.0f} MB of texts and styles, and "
            f"{THRESHOLDS.count('unpacked_ratio')} times its size. "
            "Save the sheet as CSV, which is streamed."
        )


def _rows(path: Path, layout: Layout) -> Iterator[tuple[Any, ...]]:
    """Rows of the sheet from the top, its cells as values."""
    import openpyxl
    from openpyxl.utils.exceptions import InvalidFileException

    try:
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
    except (InvalidFileException, LookupError, SyntaxError, zipfile.BadZipFile, TypeError, AttributeError) as error:
        raise ValueError(
            f"damaged workbook ({type(error).__name__}: {error})"
        ) from None  # tables.reading makes the message
    try:
        if not book.sheetnames:
            raise InputError(f"{path} has no sheet, or is damaged. Save it anew as .xlsx, or as CSV.")
        if layout.sheet is None and len(book.sheetnames) > 1:
            raise InputError(
                f'{path} has the sheets {", ".join(book.sheetnames)}. Name one: [file] sheet = "..." in the '
                "mapping, or "
                f"{option('--sheet with --propose', 'propose_mapping(..., sheet=NAME)')}."
            )
        if layout.sheet is not None and layout.sheet not in book.sheetnames:
            raise InputError(f"{path} has no sheet '{layout.sheet}'; it has {', '.join(book.sheetnames)}.")
        yield from book[layout.sheet or book.sheetnames[0]].iter_rows(values_only=True)
    except (LookupError, SyntaxError, zipfile.BadZipFile, TypeError, AttributeError) as error:
        raise ValueError(f"damaged workbook ({type(error).__name__}: {error})") from None
    finally:
        book.close()


def _cell(value: Any) -> Any:
    """Cell with dates and times as ISO text; a date without a time of day as a date alone, so that a time column can
    follow it."""
    if isinstance(value, datetime.datetime):
        whole_day = value.time() == datetime.time() and value.tzinfo is None
        return value.date().isoformat() if whole_day else value.isoformat(sep=" ")
    if isinstance(value, datetime.date | datetime.time):
        return value.isoformat()
    return value
