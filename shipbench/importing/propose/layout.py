"""Layout of a log: encoding, delimiter, the row of the heads, a row of units, and the first row of data."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ...errors import InputError, option
from ..delimited import find_encoding
from ..excel import first_rows
from ..mapping import Layout
from ..table import BLANKS, DELIMITERS, TEXT_BLOCK, reading, uncompressed
from ..tables import kind_of
from ..thresholds import THRESHOLDS
from .heads import read_head, units_of

_SIGN = "[-+\u2212]?"
_NUMBER = rf"{_SIGN}(\d+([.,]\d*)?|[.,]\d+|\d{{1,3}}([ .,'\u00a0\u2009\u202f\u2019]\d{{3}})+([.,]\d+)?)([eE][-+]?\d+)?"
_DATE = r"\d{1,4}[-./]([A-Za-z]{3,9}|\d{1,2})[-./]\d{2,4}"
_CLOCK = r"\d+:\d\d(:\d\d)?([.,]\d+)?( ?[AaPp][Mm])?"
_STAMP = rf"({_CLOCK}|{_DATE}([T ]+{_CLOCK})?|{_CLOCK}[T ]+{_DATE}|\d+ days.*)( ?(Z|[+-]\d\d:?\d\d|[A-Z]{{3,4}}))?"
_DATUM = re.compile(rf"\s*({_NUMBER}( ?[NSEWO])?|{_STAMP})\s*")
_NONE = re.compile(r"(?i)\s*(|nan|n/?a|null|none|-+|\*+|#n/a)\s*")


@dataclass(frozen=True)
class Form:
    """Layout of a log as found: `heads` and `units` are the texts over the columns, where the layout itself cannot name
    them."""

    layout: Layout
    heads: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    given: dict[str, Any] = field(default_factory=dict)


def find_form(path: Path, given: dict[str, Any]) -> Form:
    """Find the layout of a log; the entries of `given`, the [file] of a partial mapping, are kept.

    Raises:
        InputError: the log cannot be read, or no row in its beginning looks like data.
    """
    kind, count = kind_of(path), THRESHOLDS.count("proposal_lines")
    if kind == "Excel":
        layout = Layout(**{k: v for k, v in given.items() if k == "sheet"})
        with reading(path):
            rows = [["" if cell is None else str(cell) for cell in row] for row in first_rows(path, layout, count)]
        return _form(path, rows, dict(given), ())
    if kind != "text":
        return Form(Layout(**given), given=dict(given))
    found = dict(given)
    with reading(path), uncompressed(path) as file:
        head = file.read(TEXT_BLOCK)
    encoding, notes = find_encoding(path, head, Layout(**{k: v for k, v in given.items() if k == "encoding"}))
    if notes:
        found["encoding"] = encoding
    try:
        text = codecs.getincrementaldecoder(encoding)().decode(head, final=False)
    except UnicodeError:
        example = option("--encoding latin-1", 'encoding="latin-1"')
        raise InputError(
            f"{path} is not {encoding} text. Accepted: Python's names of encodings, such as {example}."
        ) from None
    lines = [line.rstrip("\n") for line, _ in zip(io.StringIO(text, newline=None), range(count), strict=False)]
    delimiter = given.get("delimiter") or _delimiter(lines)
    return _form(path, [_split(line, delimiter or ",") for line in lines], found, tuple(notes), delimiter, lines)


def _form(
    path: Path, rows: list[list[str]], found: dict[str, Any], notes: tuple[str, ...], delimiter: str | None = None,
    lines: Sequence[str] = ()
) -> Form:  # fmt: skip
    """Form of a table whose beginning is `rows`; `lines` is their text, where it is a text."""
    width = _width(rows)
    numeric = _numeric_columns(rows, width)
    begin = found.get("header", 0)
    data = next((k for k, row in enumerate(rows) if k >= begin and _is_data(row, width, numeric)), None)
    if data is None or not numeric:
        if not any(any(cell.strip() for cell in row) for row in rows):
            raise InputError(f"{path} holds no text. Give a log with a header and rows.")
        return Form(
            Layout(**found), notes=notes, given=found
        )  # nothing looks like numbers; the reader's own message serves
    above = [k for k in range(data) if _is_heads(rows[k], width)]
    if "header" in found:
        head = found["header"] - 1 if found["header"] else None
    else:
        head = max(
            above, key=lambda k: (sum(read_head(cell).meaning is not None for cell in rows[k]), -k), default=None
        )
    between = [k for k in above if head is not None and k > head]
    units = max(between, key=lambda k: sum(bool(units_of(cell.strip("[]() "))) for cell in rows[k]), default=None)
    texts = tuple(cell.strip("[]() ") for cell in rows[units]) if units is not None else ()
    heads = tuple(cell.strip() for cell in rows[head]) if head is not None else ()
    if head is None or (delimiter == BLANKS and " ".join(heads).split() != list(heads)) or len(heads) < width - 1:
        found |= {"header": 0, "skip": data} | ({"delimiter": delimiter} if delimiter else {})
        return Form(Layout(**found), heads[-width:], texts, notes, found)
    found |= {"header": head + 1} if head else {}
    found |= {"skip": data - head - 1} if data > head + 1 else {}
    if delimiter is not None and max(DELIMITERS[:-1], key=lines[head].count) != delimiter:
        found["delimiter"] = delimiter
    return Form(Layout(**found), (), texts, notes, found)


def _split(line: str, delimiter: str) -> list[str]:
    if delimiter == BLANKS:
        wide = re.split(r"\s{2,}|\t", line.strip())
        single = line.split()
        return wide if any(not _DATUM.fullmatch(cell) for cell in single) and len(wide) > 1 else single
    return next(csv.reader([line], delimiter=delimiter), [])


def _delimiter(lines: list[str]) -> str | None:
    """Mark that divides the lower half of the lines into most cells that are numbers or times."""
    body = [line for line in lines[len(lines) // 2 :] if line.strip()]
    best, most = None, (0.0, 0.0)
    for mark in DELIMITERS:
        rows = [line.split() if mark == BLANKS else _split(line, mark) for line in body]
        width = Counter(map(len, rows)).most_common(1)[0][0] if rows else 0
        if width < 2:
            continue
        good = [
            sum(bool(_DATUM.fullmatch(cell) or _NONE.fullmatch(cell)) for cell in row)
            for row in rows
            if len(row) == width
        ]
        share = sum(good) / (width * len(rows))
        if (round(share, 1), sum(good) / len(rows)) > most:
            best, most = mark, (round(share, 1), sum(good) / len(rows))
    return best


def _width(rows: list[list[str]]) -> int:
    body = [len(row) for row in rows[len(rows) // 2 :] if any(cell.strip() for cell in row)]
    return Counter(body).most_common(1)[0][0] if body else 0


def _numeric_columns(rows: list[list[str]], width: int) -> list[int]:
    """Columns that hold numbers or times in most rows of the lower half."""
    body = [row for row in rows[len(rows) // 2 :] if len(row) == width]
    return [j for j in range(width) if 2 * sum(bool(_DATUM.fullmatch(row[j])) for row in body) >= len(body) > 0]


def _is_data(row: list[str], width: int, numeric: list[int]) -> bool:
    if abs(len(row) - width) > 1:
        return False
    cells = [row[j] for j in numeric if j < len(row)]
    good, empty = sum(bool(_DATUM.fullmatch(c)) for c in cells), sum(bool(_NONE.fullmatch(c)) for c in cells)
    return good > 0 and 2 * good >= len(cells) - empty


def _is_heads(row: list[str], width: int) -> bool:
    names = [cell for cell in row if cell.strip() and not _DATUM.fullmatch(cell)]
    return abs(len(row) - width) <= 1 and 2 * len(names) >= max(len(row), 1) and len(row) > 0
