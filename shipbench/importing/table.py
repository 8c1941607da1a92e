"""Log that was opened: its columns and its stream of record batches, and common parts of all readers of logs."""

from __future__ import annotations

import bz2
import gzip
import io
import lzma
import zipfile
import zlib
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pyarrow as pa

from ..errors import InputError, unknown_name
from ..regular_files import open_regular
from ..steps import within
from .thresholds import THRESHOLDS

BLANKS = " "
"""Delimiter that stands for runs of blanks and tabs."""
DELIMITERS = (",", ";", "\t", "|", BLANKS)
MOST_COLUMNS = THRESHOLDS.count("most_columns")
TEXT_BLOCK = 1 << 22
"""Bytes in which the header must stand, and the size of the blocks in which text is read."""
_UNREADABLE = (
    zipfile.BadZipFile,
    ValueError,
    OSError,
    EOFError,
    zlib.error,
    lzma.LZMAError,
    pa.ArrowException,
    MemoryError,
)
KINDS = "CSV or other delimited text (.csv, .txt, .dat, .tsv, also .gz, .bz2, .xz), Parquet, MATLAB .mat, Excel .xlsx"


@dataclass(frozen=True)
class Table:
    """Log that was opened: its columns, its form, and a function that streams some columns as Arrow batches.

    `first_row` is the number of the first data row in the file, for messages. `notes` are on the reading of the file;
    the stream adds to them. `blocks`: approximate number of batches of the stream, for the progress.
    """

    path: Path
    columns: tuple[str, ...]
    stream: Callable[[Sequence[str]], Iterator[pa.RecordBatch]]
    first_row: int = 1
    form: str = ""
    notes: list[str] = field(default_factory=list)
    blocks: float = 1.0

    def batches(self, columns: Sequence[str]) -> Iterator[pa.RecordBatch]:
        """Columns block by block, in their order in the argument.

        Raises:
            InputError: a column is missing or stands twice in the file, or the file turns out to be damaged.
        """
        check_columns(self, columns)
        with reading(self.path):
            for number, batch in enumerate(self.stream(list(dict.fromkeys(columns)))):
                within(number / max(self.blocks, number + 1.0))
                yield batch


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Convert the errors of libraries on damaged files into one message."""
    try:
        yield
    except _UNREADABLE as error:
        reason = " ".join(str(error).split())[:200] or type(error).__name__
        raise InputError(
            f"{path} cannot be read: {reason}. It may be cut short or of another format; accepted: {KINDS}."
        ) from None


def check_columns(table: Table, wanted: Sequence[str]) -> None:
    """Check that every wanted column is there once.

    Raises:
        InputError: it is missing (the message lists what there is) or stands twice.
    """
    for name in wanted:
        count = table.columns.count(name)
        if count > 1:
            raise InputError(
                f"{table.path}: {count} columns are named '{name}'; accepted: one. Rename all but one in the file."
            )
        if count == 0:
            found = (
                table.columns
                if len(table.columns) <= 60
                else (*table.columns[:60], f"and {len(table.columns) - 60} more")
            )
            if len(table.columns) == 1 and (other := [d for d in DELIMITERS if d in table.columns[0].strip()]):
                hint = (
                    f" Its header reads as one column; is the delimiter {other[0]!r}? Set [file] delimiter in "
                    "the mapping."
                )
                raise InputError(f"{table.path}: no column '{name}'.{hint} Header: {table.columns[0][:200]}")
            raise InputError(" ".join([str(unknown_name(f"column of {table.path}:", name, found)), *table.notes]))


def check_number(path: Path, columns: int) -> None:
    """Check that the number of columns is one of a log."""
    if columns > MOST_COLUMNS:
        raise InputError(
            f"{path} has {columns} columns; accepted: up to {MOST_COLUMNS}. Save the columns that you need as a "
            "file of their own."
        )


def most_unpacked(path: Path) -> int:
    """Bytes to which a file of that size may unpack."""
    return max(THRESHOLDS.count("unpacked_ratio") * path.stat().st_size, THRESHOLDS.count("unpacked_always"))


def uncompressed(path: Path) -> Any:
    """Binary file, unpacked while it is read where it is a .gz, .bz2 or .xz."""
    with open_regular(path, "log") as file:
        magic = file.read(8)
    for mark, module in ((b"\x1f\x8b", gzip), (b"BZh", bz2), (b"\xfd7zXZ", lzma)):
        if magic.startswith(mark):
            return Bounded(path, module.open(path, "rb"))
    return open_regular(path, "log")


class Bounded(io.RawIOBase):
    """Unpacked stream that ends with an error where it is far larger than any log of its packed size."""

    def __init__(self, path: Path, raw: Any) -> None:
        super().__init__()
        self._path, self._raw, self._count = path, raw, 0
        self._most, self._ratio = most_unpacked(path), THRESHOLDS.count("unpacked_ratio")

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        block = self._raw.read(len(buffer))
        self._count += len(block)
        if self._count > self._most:
            raise InputError(
                f"{self._path} unpacks to more than {self._ratio} times its size ({self._most / 1e6:.0f} MB); "
                "logs have up to 100 times. "
                "If it is a log, unpack it first and give that file."
            )
        buffer[: len(block)] = block
        return len(block)

    def close(self) -> None:
        self._raw.close()
        super().close()


def as_batch(columns: dict[str, Any]) -> pa.RecordBatch:
    """Cells of any type as one batch: numbers stay numbers, a column with other things becomes text."""
    arrays = []
    for values in columns.values():
        try:
            arrays.append(pa.array(values, from_pandas=True))
        except (pa.ArrowException, TypeError, OverflowError):
            arrays.append(pa.array([None if v is None else str(v) for v in values], pa.string()))
    return pa.RecordBatch.from_arrays(arrays, names=list(columns))
