"""Table of trajectories in a file (CSV, plain or gzip; Parquet): only the columns in use, and no more than memory
holds."""

from __future__ import annotations

import gzip
import warnings
import zlib
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import IO, Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet

from ..errors import InputError
from ..regular_files import open_regular

MOST_CELLS = 40_000_000
"""Rows times columns of a data set, which is held in memory: reading takes up to 35 bytes a cell, so 1.4 GB in all."""
MOST_BYTES = 1_100_000_000
"""Most bytes of a table unpacked, as of a .mat file."""
MOST_COLUMNS = 10_000
_LONGEST_LINE = 1_000_000
_LONGEST_TEXT = 1_000
"""Most characters of one text in Parquet, where a text that stands in all rows is stored once."""
_CELLS, _ROWS = 1_000_000, 50_000
"""Size of one block: cells of CSV, rows of Parquet."""
_EMPTY = ["", "NA", "N/A", "NaN", "nan", "NAN", "null", "NULL", "None", "#N/A"]
"""Marks of a missing number; in the column of run names they are names like any other."""
_DAMAGED = (
    ValueError, OSError, EOFError, MemoryError, OverflowError, TypeError, KeyError, NotImplementedError, RuntimeError,
    zlib.error, pa.ArrowException, pd.errors.ParserError, pd.errors.ParserWarning,
)  # fmt: skip
"""Exceptions of pandas, pyarrow and gzip on damaged files."""


def read_trajectories(path: Path, ids: str, needed: Callable[[Sequence[str]], list[str]]) -> pd.DataFrame:
    """Read the needed columns of a table under its own names: numbers, or text where a column holds other things than
    numbers.

    Args:
        path: the file; its suffix gives the format.
        ids: the column of run names, which stay text ("001", "NA").
        needed: picks from the names of all columns those that are read, or raises an InputError.

    Raises:
        InputError: no regular file, damaged, not UTF-8, a row with more fields than the header, or too large for
            memory.
    """
    read = _read_parquet if path.suffix == ".parquet" else _read_csv
    try:
        with open_regular(path, "table of trajectories") as file:
            return read(file, path, ids, needed)
    except UnicodeDecodeError:
        raise InputError(
            f"{path} is not UTF-8 text. Save it again as CSV in UTF-8, or bring it in with: shipbench data import."
        ) from None
    except _DAMAGED as error:
        reason = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(
            f"{path} cannot be read: {reason}. It must be a table with the columns trajectory, t and the states."
        ) from None


def _read_csv(file: IO[bytes], path: Path, ids: str, needed: Callable[[Sequence[str]], list[str]]) -> pd.DataFrame:
    def text() -> Any:
        file.seek(0)
        return gzip.GzipFile(fileobj=file) if path.suffix == ".gz" else file

    _check_marks(text().readline(_LONGEST_LINE), path)
    rows = _count_lines(text(), path)
    _check_size(path, 1, 1, text().readline(_LONGEST_LINE).split(b"\r")[0].count(b",") + 1)
    with warnings.catch_warnings():
        warnings.simplefilter("error", pd.errors.ParserWarning)
        head = pd.read_csv(text(), nrows=1, dtype=str, index_col=False)
        names = [str(name) for name in head.columns]
        _check_size(path, 0 if head.empty else rows, 1, 1)
        columns = needed(names)
        _check_size(path, rows, len(columns), len(names))
        empty = {column: _EMPTY for column in columns if column != ids}
        # All columns are parsed, in blocks, and ours kept: with `usecols`, pandas would shift rows that have more
        # fields than the header.
        options = {
            "keep_default_na": False,
            "na_values": empty,
            "index_col": False,
            "low_memory": False,
            "chunksize": max(1, _CELLS // len(names)),
        }
        read = [_without_truth_values(block[columns]) for block in pd.read_csv(text(), dtype={ids: str}, **options)]
    _check_decimals(read[0].drop(columns=ids, errors="ignore"), path)
    return pd.concat(read)


def _check_marks(header: bytes, path: Path) -> None:
    """Check that commas stand between the columns."""
    for mark, name in ((b";", "semicolons"), (b"\t", "tabs")):
        if header.count(mark) > header.count(b","):
            raise InputError(
                f"{path} has {name} between its columns, as with decimal commas; accepted: commas there, and points "
                "in its numbers. "
                f"Save it so, or import it: shipbench data import {path} --propose mapping.toml"
            )


def _check_decimals(block: pd.DataFrame, path: Path) -> None:
    """Check that numbers have decimal points."""
    for column in block.select_dtypes(exclude="number").columns:
        commas = block[column].astype(str).str.fullmatch(r"\s*[-+\u2212]?\d[\d.]*,[\d,.]+\s*")
        if commas.any():
            row = int(np.argmax(commas.to_numpy()))
            raise InputError(
                f"{path}, row {row + 2}: '{column}' is '{block[column].iloc[row]}', with a comma; accepted: decimal "
                "points, and no mark between "
                f"thousands. Save it so, or import it: shipbench data import {path} --propose mapping.toml"
            )


def _count_lines(text: Any, path: Path) -> int:
    """Count the lines of a text piece by piece: its unpacked size is not known before."""
    size = lines = unfinished = 0
    while piece := text.read(_LONGEST_LINE):
        size += len(piece)
        piece = piece.replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        lines += piece.count(b"\n")
        longest = unfinished + (piece.find(b"\n") if b"\n" in piece else len(piece))
        unfinished = len(piece) - 1 - piece.rfind(b"\n") + (0 if b"\n" in piece else unfinished)
        if size > MOST_BYTES:
            raise InputError(
                f"{path} holds more than {MOST_BYTES / 1e6:.0f} MB of text; accepted: up to that. Make several data "
                "sets of it."
            )
        if longest > _LONGEST_LINE:
            raise InputError(
                f"{path} has a line of more than {_LONGEST_LINE / 1e6:g} MB; it is no table with a sample per row."
            )
    return lines


def _check_size(path: Path, rows: int, columns: int, all_columns: int) -> None:
    """Refuse a table of no rows, and one that memory does not hold."""
    if rows == 0:
        raise InputError(f"{path} has no rows; it needs one row per sample.")
    if all_columns > MOST_COLUMNS:
        raise InputError(
            f"{path} has {all_columns} columns; accepted: up to {MOST_COLUMNS}. Remove those that are no signals."
        )
    if rows * columns > MOST_CELLS:
        raise InputError(
            f"{path} has {rows} rows of {columns} signals; accepted: up to {MOST_CELLS // columns} such rows in one "
            "data set. "
            "Make several data sets of it, or resample the runs to a longer dt."
        )


def _without_truth_values(block: pd.DataFrame) -> pd.DataFrame:
    """Column of "True" and "False" as text, not ones and zeros."""
    truths = [column for column in block.columns if block[column].dtype == bool]
    return block.astype(dict.fromkeys(truths, object)).astype(dict.fromkeys(truths, str)) if truths else block


def _read_parquet(file: IO[bytes], path: Path, ids: str, needed: Callable[[Sequence[str]], list[str]]) -> pd.DataFrame:
    with pa.parquet.ParquetFile(file) as opened:
        schema, about = opened.schema_arrow, opened.metadata
        names = schema.names
        _check_size(path, about.num_rows, 1, about.num_columns)
        columns = needed(names)
        texts = [name for name in columns if _is_text(schema.field(name).type)]
        _check_size(path, about.num_rows, len(columns), about.num_columns)
        places = [i for i in range(about.num_columns) if about.schema.column(i).path in columns]
        size = sum(
            about.row_group(k).column(i).total_uncompressed_size for k in range(about.num_row_groups) for i in places
        )
    if size > MOST_BYTES:
        raise InputError(
            f"{path} holds {size / 1e6:.0f} MB unpacked; accepted: up to {MOST_BYTES / 1e6:.0f} MB. Make several "
            "data sets of it."
        )
    file.seek(0)
    # Texts stay dictionaries while they are read: a long one in many rows would be copied into each.
    with pa.parquet.ParquetFile(file, read_dictionary=texts) as opened:
        batches = opened.iter_batches(_ROWS, columns=columns, use_threads=False)
        blocks = [
            pd.DataFrame({name: _values(batch.column(name), name, name == ids, path) for name in columns})
            for batch in batches
        ]
    return pd.concat(blocks, ignore_index=True)


def _is_text(kind: pa.DataType) -> bool:
    return pa.types.is_string(kind) or pa.types.is_large_string(kind)


def _values(column: pa.Array, name: str, is_name: bool, path: Path) -> np.ndarray:
    """Numbers as float64 with NaN where there is none; names of runs and other texts as text, for the message that
    names the row."""
    kind = column.type
    number = (
        pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind) or pa.types.is_null(kind)
    )
    if number and not is_name:
        return column.cast(pa.float64(), safe=False).to_numpy(zero_copy_only=False)
    if pa.types.is_nested(kind) or pa.types.is_binary(kind):
        raise InputError(
            f"{path}: column '{name}' holds {kind}; accepted: {'text' if is_name else 'numbers'}. Correct or remove "
            "the column."
        )
    coded = column if pa.types.is_dictionary(kind) else column.cast(pa.string()).dictionary_encode()
    texts = coded.dictionary.cast(pa.string()).to_pylist()
    if any(len(text) > _LONGEST_TEXT for text in texts if text is not None):
        raise InputError(f"{path}: column '{name}' holds a text of more than {_LONGEST_TEXT} characters. Shorten it.")
    at = coded.indices.fill_null(len(texts)).to_numpy(zero_copy_only=False)
    return np.array([*texts, None], dtype=object)[at]
