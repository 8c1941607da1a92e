"""Log of any format as a stream of record batches: CSV and similar, Parquet; MATLAB and Excel in files of their own.
The whole file is never in memory."""

from __future__ import annotations

import zipfile
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Literal

import pyarrow as pa
import pyarrow.parquet

from ..errors import InputError
from ..names import shown
from ..regular_files import open_regular
from .blocks import ROWS
from .mapping import Layout
from .table import Table, check_number, reading
from .thresholds import THRESHOLDS


def open_table(path: Path, layout: Layout) -> Table:
    """Recognise the format by content and suffix, and read the names of the columns.

    Raises:
        InputError: missing, empty, binary, damaged or unknown.
    """
    with reading(path):
        kind = kind_of(path)
        if kind == "Parquet":
            return _open_parquet(path)
        if kind == "MATLAB":
            from .matlab import open_matlab

            return open_matlab(path)
        if kind == "Excel":
            from .excel import open_excel

            return open_excel(path, layout)
        from .delimited import open_text

        return open_text(path, layout)


def kind_of(path: Path) -> Literal["Parquet", "MATLAB", "Excel", "text"]:
    """Format of a file by its first bytes and its suffix.

    Raises:
        InputError: it is missing, empty or a folder, or of a format that is not read.
    """
    if path.is_dir():
        suffixes = Counter(file.suffix for file in path.iterdir() if file.is_file() and file.suffix)
        suffix = shown(max(suffixes, key=suffixes.__getitem__, default=".csv"))
        raise InputError(f"{path} is a folder; give the log files themselves, such as {path}/*{suffix}.")
    with open_regular(path, "log") as file:
        magic = file.read(8)
    if not magic:
        raise InputError(f"{path} is empty (0 bytes). Give a log with a header and rows.")
    if magic.startswith(b"PAR1") or path.suffix == ".parquet":
        return "Parquet"
    if path.suffix.lower() == ".mat" or magic.startswith(b"MATLAB"):
        return "MATLAB"
    if path.suffix.lower() in (".xlsx", ".xlsm") or magic.startswith(b"PK\x03\x04"):
        if not path.suffix.lower().startswith(".xls"):
            _check_packed(path)
        return "Excel"
    if magic.startswith(b"\xd0\xcf\x11\xe0"):
        raise InputError(f"{path} is in Excel's old format (.xls). Save it as .xlsx or .csv.")
    return "text"


def _check_packed(path: Path) -> None:
    """Check that a zip archive is a workbook."""
    if not zipfile.is_zipfile(path):
        return
    with zipfile.ZipFile(path) as packed:
        names = packed.namelist()
    if "content.xml" in names:
        raise InputError(f"{path} is an OpenDocument file. Save the sheet as .xlsx or .csv.")
    if "[Content_Types].xml" not in names:
        inside = f"{', '.join(names[:3])}{' and more' if len(names) > 3 else ''}"
        raise InputError(
            f"{path} is a zip archive (it holds {inside}). Unpack it, and give the logs in it: unzip {path.name}"
        )


def _open_parquet(path: Path) -> Table:
    with pa.parquet.ParquetFile(path) as file:
        columns, rows = tuple(file.schema_arrow.names), file.metadata.num_rows
    if rows == 0:
        raise InputError(f"{path} has no rows. Give a log with one row per sample.")
    ratio, always = THRESHOLDS.count("unpacked_ratio"), 10 * THRESHOLDS.count("unpacked_always")
    if 8 * rows * len(columns) > max(ratio * path.stat().st_size, always):
        raise InputError(
            f"{path} declares {rows} rows of {len(columns)} columns in {path.stat().st_size / 1e6:.3g} MB; "
            f"accepted: up to {ratio} times its size. If it is a log, save it as CSV."
        )

    def stream(wanted: Sequence[str]) -> Iterator[pa.RecordBatch]:
        with pa.parquet.ParquetFile(path, pre_buffer=False, buffer_size=1 << 20) as file:
            for batch in file.iter_batches(ROWS, columns=list(wanted), use_threads=False):
                yield batch.select(list(wanted))

    check_number(path, len(columns))
    return Table(path, columns, stream, 1, "Parquet", blocks=rows / ROWS)
