"""Any log as a stream of record batches: CSV and its kin, Parquet; MATLAB and Excel in files of their own. Never the whole file in memory."""

from __future__ import annotations

import bz2
import codecs
import csv
import gzip
import io
import lzma
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet

from ..errors import InputError, unknown_name
from .blanks import Collapsed
from .mapping import Layout

BLANKS = " "
"""The delimiter that stands for runs of blanks and tabs."""
DELIMITERS = (",", ";", "\t", "|", BLANKS)
MOST_COLUMNS = 10_000
TEXT_BLOCK = 1 << 22
"""Bytes in which the header must stand, and the size of the blocks in which text is read."""
_ROWS = 50_000
_UNREADABLE = (ValueError, OSError, EOFError, zlib.error, lzma.LZMAError, pa.ArrowException, MemoryError)
KINDS = "CSV or other delimited text (.csv, .txt, .dat, .tsv, also .gz, .bz2, .xz), Parquet, MATLAB .mat, Excel .xlsx"


@dataclass(frozen=True)
class Table:
    """A log that was opened: its columns, what was found of its form, and a function that streams some columns as Arrow batches.

    `first_row` is the number of the first data row in the file, for messages.
    """

    path: Path
    columns: tuple[str, ...]
    stream: Callable[[Sequence[str]], Iterator[pa.RecordBatch]]
    first_row: int = 1
    form: str = ""

    def batches(self, columns: Sequence[str]) -> Iterator[pa.RecordBatch]:
        """The columns, block by block, in their order in the argument.

        Raises:
            InputError: a column is missing or stands twice in the file, or the file turns out to be damaged.
        """
        check_columns(self, columns)
        with reading(self.path):
            yield from self.stream(list(dict.fromkeys(columns)))


def open_table(path: Path, layout: Layout) -> Table:
    """Recognise the format by content and suffix, and read the names of the columns.

    Raises:
        InputError: missing, empty, binary, damaged or unknown.
    """
    kind = kind_of(path)
    with reading(path):
        if kind == "Parquet":
            return _open_parquet(path)
        if kind == "MATLAB":
            from .matlab import open_matlab

            return open_matlab(path)
        if kind == "Excel":
            from .excel import open_excel

            return open_excel(path, layout)
        return _open_text(path, layout)


def kind_of(path: Path) -> Literal["Parquet", "MATLAB", "Excel", "text"]:
    """The kind of a file by its first bytes and its suffix.

    Raises:
        InputError: it is missing, empty or a folder, or of a kind that is not read.
    """
    if path.is_dir():
        raise InputError(f"{path} is a folder; give the log files themselves, such as {path}/*.csv.")
    try:
        with path.open("rb") as file:
            magic = file.read(8)
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror}. Give the path of an existing log.") from None
    if not magic:
        raise InputError(f"{path} is empty (0 bytes). Give a log with a header and rows.")
    if magic.startswith(b"PAR1") or path.suffix == ".parquet":
        return "Parquet"
    if path.suffix.lower() == ".mat" or magic.startswith(b"MATLAB"):
        return "MATLAB"
    if path.suffix.lower() in (".xlsx", ".xlsm") or magic.startswith(b"PK\x03\x04"):
        return "Excel"
    if magic.startswith(b"\xd0\xcf\x11\xe0"):
        raise InputError(f"{path} is in Excel's old format (.xls). Save it as .xlsx or .csv.")
    return "text"


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turns what the libraries raise on damaged files into one message."""
    try:
        yield
    except _UNREADABLE as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(f"{path} cannot be read: {reason}. It may be cut short or of another format; accepted: {KINDS}.") from None


def check_columns(table: Table, wanted: Sequence[str]) -> None:
    """Every wanted column is there once.

    Raises:
        InputError: it is missing (the message lists what there is) or stands twice.
    """
    for name in wanted:
        count = table.columns.count(name)
        if count > 1:
            raise InputError(f"{table.path}: {count} columns are named '{name}'; accepted: one. Rename all but one in the file.")
        if count == 0:
            found = table.columns if len(table.columns) <= 60 else (*table.columns[:60], f"and {len(table.columns) - 60} more")
            if len(table.columns) == 1 and (other := [d for d in DELIMITERS if d in table.columns[0].strip()]):
                hint = f" Its header reads as one column; is the delimiter {other[0]!r}? Set [file] delimiter in the mapping."
                raise InputError(f"{table.path}: no column '{name}'.{hint} Header: {table.columns[0][:200]}")
            raise unknown_name(f"column of {table.path}:", name, found)


def _open_parquet(path: Path) -> Table:
    with pa.parquet.ParquetFile(path) as file:
        columns, rows = tuple(file.schema_arrow.names), file.metadata.num_rows
    if rows == 0:
        raise InputError(f"{path} has no rows. Give a log with one row per sample.")

    def stream(wanted: Sequence[str]) -> Iterator[pa.RecordBatch]:
        with pa.parquet.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
            for batch in file.iter_batches(_ROWS, columns=list(wanted), use_threads=False):
                yield batch.select(list(wanted))

    _check_number(path, len(columns))
    return Table(path, columns, stream, 1, "Parquet")


def _check_number(path: Path, columns: int) -> None:
    if columns > MOST_COLUMNS:
        raise InputError(f"{path} has {columns} columns; accepted: up to {MOST_COLUMNS}. Save the columns that you need as a file of their own.")


def uncompressed(path: Path) -> Any:
    """A binary file, unpacked while it is read where it is a .gz, .bz2 or .xz."""
    with path.open("rb") as file:
        magic = file.read(8)
    if magic.startswith(b"\x1f\x8b"):
        return gzip.open(path, "rb")
    if magic.startswith(b"BZh"):
        return bz2.open(path, "rb")
    if magic.startswith(b"\xfd7zXZ"):
        return lzma.open(path, "rb")
    return path.open("rb")


def _encoding(path: Path, head: bytes, layout: Layout) -> str:
    for mark, name in ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16")):
        if head.startswith(mark):
            return name
    if b"\0" in head:
        raise InputError(f"{path} is binary (it holds zero bytes), and of no known kind. Accepted: {KINDS}.")
    try:
        codecs.lookup(layout.encoding)
    except LookupError:
        raise InputError(f"[file] encoding = '{layout.encoding}' is unknown; accepted: Python's names, such as 'utf-8' or 'latin-1'.") from None
    return layout.encoding


def _open_text(path: Path, layout: Layout) -> Table:
    with uncompressed(path) as file:
        head = file.read(TEXT_BLOCK)
    if not head.strip():
        raise InputError(f"{path} holds no text. Give a log with a header and rows.")
    encoding = _encoding(path, head, layout)
    header, first = _first_lines(path, head, encoding, layout)
    delimiter = layout.delimiter or max(DELIMITERS[:-1], key=header.count)
    if delimiter == BLANKS:
        header = " ".join(header.split())
        if encoding not in ("utf-8", "utf-8-sig", "ascii") and codecs.lookup(encoding).name.startswith("utf-"):
            raise InputError(f"{path} is {encoding} text with blanks between the columns; accepted with blanks: UTF-8 or Latin-1. Save it as UTF-8.")
    columns = tuple(name.strip() for name in next(csv.reader([header], delimiter=delimiter)))
    if not layout.header:
        columns = tuple(str(k + 1) for k in range(len(columns)))
    elif first.rstrip().endswith(delimiter) and len(next(csv.reader([first], delimiter=delimiter))) == len(columns) + 1:
        columns += ("",)  # every row ends with a delimiter that the header lacks
    if any(ord(c) < 32 and c != "\t" for c in header):
        raise InputError(f"{path}: its header (row {layout.header}) holds control characters: the file is binary. Accepted: {KINDS}.")
    _check_number(path, len(columns))
    places = {name: str(i) for i, name in enumerate(columns)}

    def stream(wanted: Sequence[str]) -> Iterator[pa.RecordBatch]:
        # All as text: numbers are read by channels.py, which can name the row and the cell that is none.
        read = pa.csv.ReadOptions(
            use_threads=False, block_size=TEXT_BLOCK, skip_rows=layout.header + layout.skip, column_names=[str(i) for i in range(len(columns))],
            encoding="utf-8" if encoding == "utf-8-sig" else encoding,
        )  # fmt: skip
        at = [places[name] for name in wanted]
        convert = pa.csv.ConvertOptions(include_columns=at, column_types={i: pa.string() for i in at}, strings_can_be_null=False)
        with uncompressed(path) as raw:
            try:
                reader = pa.csv.open_csv(Collapsed(raw) if delimiter == BLANKS else raw, read, pa.csv.ParseOptions(delimiter=delimiter), convert)
            except pa.ArrowInvalid as error:
                if "Empty CSV" in str(error) or "Could not skip" in str(error):
                    raise InputError(f"{path} has a header and no rows. Give a log with one row per sample.") from None
                raise
            for batch in reader:
                yield batch.rename_columns(list(wanted))

    form = f"text, delimiter {delimiter!r}, {encoding}"
    return Table(path, columns, stream, layout.header + layout.skip + 1, form)


def _first_lines(path: Path, head: bytes, encoding: str, layout: Layout) -> tuple[str, str]:
    """The header and the first row of data (empty where there is none); of a table without a header, the first row twice."""
    number = layout.header or layout.skip + 1
    text = codecs.getincrementaldecoder(encoding)
    try:
        decoded = text().decode(head, final=False)
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not {encoding} text (byte {error.start}); if it is text, set [file] encoding = 'latin-1' (or what it is) in the mapping."
        ) from None
    lines = io.StringIO(decoded, newline=None)
    first = [line.rstrip("\n") for line, _ in zip(lines, range(layout.header + layout.skip + 1), strict=False)]
    if not layout.header and (len(first) < number or not first[number - 1].strip()):
        raise InputError(f"{path}: row {number} is empty; accepted with [file] header = 0: the first row of data after `skip` rows. Correct `skip`.")
    if len(first) < number or not first[number - 1].strip():
        raise InputError(f"{path}: row {number} holds no header ([file] header = {number}). Set the number of the row with the columns' names.")
    if len(decoded) == len(first[0]) and len(head) >= TEXT_BLOCK:
        raise InputError(f"{path}: its first line is longer than {TEXT_BLOCK >> 20} MB. Accepted: {KINDS}.")
    return first[number - 1], first[layout.header + layout.skip] if len(first) > layout.header + layout.skip else ""


def as_batch(columns: dict[str, Any]) -> pa.RecordBatch:
    """Cells of any kind as one batch: numbers stay numbers, a column with other things becomes text."""
    arrays = []
    for values in columns.values():
        try:
            arrays.append(pa.array(values, from_pandas=True))
        except (pa.ArrowException, TypeError, OverflowError):
            arrays.append(pa.array([None if v is None else str(v) for v in values], pa.string()))
    return pa.RecordBatch.from_arrays(arrays, names=list(columns))
