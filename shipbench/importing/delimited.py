"""Logs as text: CSV and similar, in any encoding, streamed; rows that do not fit the header are refused, except a cut
last line or a footer."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.csv

from ..errors import InputError, option
from .blanks import Collapsed
from .mapping import Layout
from .table import BLANKS, DELIMITERS, KINDS, TEXT_BLOCK, Table, check_number, uncompressed
from .thresholds import THRESHOLDS

_NO_TEXT = ("idna", "punycode", "undefined", "unicode_escape", "raw_unicode_escape")
"""Codecs of Python that convert text to text, not a file's bytes."""
_WIDE = ("utf-16", "utf-32")
_MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF32_LE, "utf-32"), (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)  # fmt: skip
_BEGINS_DATA = re.compile(r"\s*[\"']?[-+\u2212]?[.,]?\d")


def open_text(path: Path, layout: Layout) -> Table:
    """Open a text log with the columns of the header, or their numbers where [file] header = 0.

    Raises:
        InputError: no text, or no header where it should stand; while it is streamed: rows with more or fewer fields
            than the header.
    """
    with uncompressed(path) as file:
        head = file.read(TEXT_BLOCK)
    if not head.strip():
        raise InputError(f"{path} holds no text. Give a log with a header and rows.")
    encoding, notes = find_encoding(path, head, layout)
    header, first = _first_lines(path, head, encoding, layout)
    delimiter = layout.delimiter or max(DELIMITERS[:-1], key=header.count)
    if delimiter == BLANKS:
        header = " ".join(header.split())
        if encoding not in ("utf-8", "utf-8-sig", "ascii") and codecs.lookup(encoding).name.startswith("utf-"):
            raise InputError(
                f"{path} is {encoding} text with blanks between the columns; accepted with blanks: UTF-8 or "
                "Latin-1. Save it as UTF-8."
            )
    columns = tuple(name.strip() for name in next(csv.reader([header], delimiter=delimiter)))
    if not layout.header:
        columns = tuple(str(k + 1) for k in range(len(columns)))
    elif first.rstrip().endswith(delimiter) and len(next(csv.reader([first], delimiter=delimiter))) == len(columns) + 1:
        columns += ("",)  # every row ends with a delimiter that the header lacks
    if any(ord(c) < 32 and c != "\t" for c in header):
        raise InputError(
            f"{path}: its header (row {layout.header}) holds control characters: the file is binary. Accepted: {KINDS}."
        )
    check_number(path, len(columns))
    first_row = layout.header + layout.skip + 1
    form = f"text, delimiter {delimiter!r}, {encoding}"

    def stream(wanted: Sequence[str]) -> Iterator[pa.RecordBatch]:
        # All as text: numbers are read by cells.py, which can name the row and the cell that is none.
        read = pa.csv.ReadOptions(
            use_threads=False, block_size=TEXT_BLOCK, skip_rows=first_row - 1,
            column_names=[str(i) for i in range(len(columns))],
            encoding="utf-8" if encoding == "utf-8-sig" else encoding,
        )  # fmt: skip
        at = [str(columns.index(name)) for name in wanted]
        convert = pa.csv.ConvertOptions(
            include_columns=at, column_types={i: pa.string() for i in at}, strings_can_be_null=False
        )
        odd = _OddRows(path, first_row)
        parse = pa.csv.ParseOptions(delimiter=delimiter, invalid_row_handler=odd.met)
        with uncompressed(path) as raw:
            try:
                for batch in pa.csv.open_csv(Collapsed(raw) if delimiter == BLANKS else raw, read, parse, convert):
                    odd.check(batch.num_rows)
                    yield batch.rename_columns(list(wanted))
            except pa.ArrowInvalid as error:
                odd.refuse()
                raise _explained(path, error) from None
        notes.extend(note for note in odd.left_out() if note not in notes)

    return Table(path, columns, stream, first_row, form, notes, path.stat().st_size / TEXT_BLOCK)


def _explained(path: Path, error: pa.ArrowInvalid) -> Exception:
    if "Empty CSV" in str(error) or "Could not skip" in str(error):
        return InputError(f"{path} has a header and no rows. Give a log with one row per sample.")
    if "UTF8" in str(error):
        return InputError(
            f'{path} is not UTF-8 after its beginning. Set [file] encoding in the mapping, such as encoding = "cp1252".'
        )
    return error


class _OddRows:
    """Rows with more or fewer fields than the header; `first` is the number of the first row of data."""

    def __init__(self, path: Path, first: int) -> None:
        self.path, self.first, self.good, self.blank = path, first, 0, 0
        self.rows: list[pa.csv.InvalidRow] = []
        self._blank_before: list[int] = []

    def met(self, row: pa.csv.InvalidRow) -> str:
        """Set a row aside; one of delimiters alone is an empty line. Reading ends at too many: an exception would be
        lost in pyarrow."""
        if not row.text.strip(" \t,;|"):
            self.blank += 1
            return "skip"
        self.rows.append(row)
        self._blank_before.append(self.blank)
        return "error" if len(self.rows) > THRESHOLDS.count("odd_rows") else "skip"

    def refuse(self) -> None:
        """Raise the error for a file whose reading ended early.

        Raises:
            InputError: reading ended since too many rows do not fit.
        """
        if len(self.rows) > THRESHOLDS.count("odd_rows"):
            raise self._refused(self.rows[0])

    def check(self, good: int) -> None:
        """Count whole rows.

        Raises:
            InputError: whole rows follow one that is not.
        """
        self.good += good
        for k, row in enumerate(self.rows):
            if self.good > row.number - self.first - k - self._blank_before[k]:
                raise self._refused(row)

    def left_out(self) -> list[str]:
        """Text on the rows left out at the end of the file.

        Raises:
            InputError: they are more than a cut last line or a footer.
        """
        for k, row in enumerate(self.rows):
            cut = k == len(self.rows) - 1
            if (
                row.actual_columns > row.expected_columns
                or not (cut or not _BEGINS_DATA.match(row.text))
                or not self.good
            ):
                raise self._refused(row)
        return [
            f"{self.path.name}, row {row.number}, left out: {row.actual_columns} of {row.expected_columns} fields "
            "at the end of the file: "
            f"'{row.text[:40]}'" for row in self.rows
        ]  # fmt: skip

    def _refused(self, row: pa.csv.InvalidRow) -> InputError:
        grouped = (
            ' A number with a thousands separator needs quotes: "1,090".'
            if row.actual_columns > row.expected_columns
            else ""
        )
        return InputError(
            f"{self.path}, row {row.number} has {row.actual_columns} fields; accepted: {row.expected_columns}, as "
            "the header has columns. "
            f"It reads '{row.text[:80]}'.{grouped} Correct or remove the row."
        )


def find_encoding(path: Path, head: bytes, layout: Layout) -> tuple[str, list[str]]:
    """Encoding of a text by its byte order mark, by the mapping, or by trial; with a note in the last case.

    Raises:
        InputError: the text is binary, or the mapping names no encoding of text.
    """
    for mark, name in _MARKS:
        if head.startswith(mark):
            return name, []
    given = check_encoding(layout.encoding)
    if b"\0" in head and not given.startswith(_WIDE):
        raise InputError(
            f"{path} is binary (it holds zero bytes), and of no known kind. Accepted: {KINDS}. "
            'If it is text of two bytes a letter: [file] encoding = "utf-16-le".'
        )
    if "encoding" in layout.model_fields_set or _decodes(head, given):
        return layout.encoding, []
    given_by = option("--encoding NAME with --propose", "propose_mapping(..., encoding=NAME)")
    name = "cp1252" if _decodes(head, "cp1252") else "latin-1"
    return name, [
        f"{path.name} is not UTF-8; read as Latin-1 ({name}). To choose another: {given_by}, or [file] encoding"
    ]


def check_encoding(name: str) -> str:
    """Python's name of a text encoding.

    Raises:
        InputError: it is none, or a codec that does not convert a file's bytes to text.
    """
    try:
        found = codecs.lookup(name)
        text = getattr(found, "_is_text_encoding", True) and found.incrementaldecoder is not None
    except (LookupError, ValueError):
        text = False
    if not text or found.name.replace("-", "_") in _NO_TEXT:
        raise InputError(
            f"[file] encoding = '{name}' is no text encoding; accepted: Python's names of encodings, such as "
            "'utf-8' or 'latin-1'."
        )
    return found.name


def _decodes(head: bytes, encoding: str) -> bool:
    try:
        codecs.getincrementaldecoder(encoding)().decode(head, final=False)
    except UnicodeError:
        return False
    return True


def _first_lines(path: Path, head: bytes, encoding: str, layout: Layout) -> tuple[str, str]:
    """Header and first row of data (empty where there is none); of a table without a header, the first row twice."""
    number = layout.header or layout.skip + 1
    text = codecs.getincrementaldecoder(encoding)
    try:
        decoded = text().decode(head, final=False)
    except UnicodeError as error:
        place = f" (byte {error.start})" if isinstance(error, UnicodeDecodeError) else ""
        raise InputError(
            f"{path} is not {encoding} text{place}; if it is text, set [file] encoding = 'latin-1' (or what it is) "
            "in the mapping, "
            f"or {option('--encoding with --propose', 'propose_mapping(..., encoding=NAME)')}."
        ) from None
    lines = io.StringIO(decoded, newline=None)
    first = [line.rstrip("\n") for line, _ in zip(lines, range(layout.header + layout.skip + 1), strict=False)]
    if not layout.header and (len(first) < number or not first[number - 1].strip()):
        raise InputError(
            f"{path}: row {number} is empty; accepted with [file] header = 0: the first row of data after `skip` "
            "rows. Correct `skip`."
        )
    if len(first) < number or not first[number - 1].strip():
        raise InputError(
            f"{path}: row {number} holds no header ([file] header = {number}). Set the number of the row with the "
            "columns' names."
        )
    if len(decoded) == len(first[0]) and len(head) >= TEXT_BLOCK:
        raise InputError(f"{path}: its first line is longer than {TEXT_BLOCK >> 20} MB. Accepted: {KINDS}.")
    return first[number - 1], first[layout.header + layout.skip] if len(first) > layout.header + layout.skip else ""
