"""MATLAB files up to version 7, read with scipy: vectors, columns of matrices and fields of structs under names such as
`log.gps.lat` or `data(3)`."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa

from ..errors import InputError
from ..matlab_files import check_matlab
from ..regular_files import open_regular
from .blocks import ROWS
from .matlab73 import open_matlab73
from .matlab_objects import not_read, object_vectors
from .table import MOST_COLUMNS, Table, as_batch
from .thresholds import THRESHOLDS

_OBJECTS = "\0objects"
"""Key under which names of objects are collected among the vectors; no variable has this name."""


def open_matlab(path: Path) -> Table:
    """Read a .mat file whole (the format cannot be streamed), which is why its size is limited; version 7.3 is another
    format, which is streamed.

    Raises:
        InputError: too large, damaged, or without numeric vectors.
    """
    from scipy.io import loadmat

    with open_regular(path, "log") as file:
        head = file.read(520)
        if b"\x89HDF" in (head[:4], head[512:516]):
            return open_matlab73(path)
        file.seek(0)
        try:
            check_matlab(file)
        except ValueError as error:
            advice = "Save it with '-v7.3', or as CSV (writetable) or Parquet (parquetwrite): these are streamed."
            raise InputError(f"{path} is not read: {error}. {advice}") from None
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # two objects go by one name in scipy; mat-io reads them
            content = loadmat(path, squeeze_me=True, struct_as_record=False)
    except NotImplementedError:
        raise InputError(
            f"{path} is of a MATLAB version that is not read. In MATLAB: save('log.mat', ..., '-v7')."
        ) from None
    except Exception as error:  # scipy raises whatever a damaged file leads it to
        raise ValueError(
            f"damaged MATLAB file ({type(error).__name__}: {error})"
        ) from None  # tables.reading makes the message
    vectors: dict[str, Any] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(name, value, vectors, 0)
    notes: list[str] = []
    if objects := vectors.pop(_OBJECTS, None):
        found = object_vectors(path)
        if not found and not vectors:
            raise InputError(not_read(path, objects))
        notes += [] if found else [not_read(path, objects)]
        vectors |= {name: value for name, value in found.items() if name not in vectors}
    if not vectors:
        raise InputError(
            f"{path} holds no vectors of two or more numbers. Accepted: vectors, matrices with a sample per row, "
            "and structs of them."
        )
    if len(vectors) > MOST_COLUMNS:
        raise InputError(f"{path} holds {len(vectors)} vectors; accepted: up to {MOST_COLUMNS}.")

    def stream(wanted: Sequence[str]) -> Iterator[pa.RecordBatch]:
        lengths = {name: len(vectors[name]) for name in wanted}
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"{name} {n}" for name, n in lengths.items())
            raise InputError(
                f"{path}: vectors of one source differ in length: {told}. Give each rate a [sources.NAME] with its "
                "own time column."
            )
        for begin in range(0, max(lengths.values()), ROWS):
            yield as_batch({name: _numbers(vectors[name][begin : begin + ROWS]) for name in wanted})

    return Table(path, tuple(vectors), stream, 1, "MATLAB", notes)


def _numbers(values: Any) -> Any:
    """Numbers as floats, block by block so that small integers stay small in memory; text as it is."""
    return values.astype(float) if isinstance(values, np.ndarray) and values.dtype.kind in "fiub" else values


def _collect(name: str, value: Any, vectors: dict[str, Any], depth: int) -> None:
    """Put possible columns into `vectors`, under their MATLAB names."""
    from scipy.io.matlab import MatlabOpaque

    if isinstance(value, MatlabOpaque):
        vectors.setdefault(_OBJECTS, []).append(value["s0"].item().decode(errors="replace") if name == "None" else name)
        return
    fields = getattr(value, "_fieldnames", None)
    if fields is not None and depth < THRESHOLDS.count("structure_depth"):
        for field in fields:
            _collect(f"{name}.{field}", getattr(value, field), vectors, depth + 1)
    elif isinstance(value, np.ndarray) and value.ndim == 1 and len(value) > 1:
        if value.dtype.kind in "fiub":
            vectors[name] = value
        elif value.dtype.kind in "US" or all(isinstance(v, str) for v in value):  # text, such as time stamps
            vectors[name] = [str(v) for v in value]
    elif (
        isinstance(value, np.ndarray)
        and value.ndim == 2
        and value.dtype.kind in "fiub"
        and value.shape[1] <= MOST_COLUMNS
    ):
        for j in range(value.shape[1]):
            vectors[f"{name}({j + 1})"] = value[:, j]
