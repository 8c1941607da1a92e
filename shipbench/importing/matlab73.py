"""MATLAB 7.3 files (HDF5), read with h5py: streamed, so that they may be larger than memory; needs the extra
`shipbench[matlab]`."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..extras import needed_by
from .blocks import ROWS
from .matlab_objects import how_to_save, not_read, object_vectors
from .table import MOST_COLUMNS, Table, as_batch
from .thresholds import THRESHOLDS


@dataclass(frozen=True)
class _Vector:
    """Location of a column: the path of its data set, and the index of all axes but that of the samples (None where the
    samples are)."""

    path: str
    at: tuple[int | None, ...]
    length: int
    text: bool = False


def open_matlab73(path: Path) -> Table:
    """Open the vectors, columns of matrices, struct fields and tables of the file under their MATLAB names. Cells are
    skipped.

    Raises:
        InputError: h5py is not installed, or the file is damaged, declares more than it holds, or has no numeric
            vectors.
    """
    vectors: dict[str, _Vector] = {}
    objects: list[str] = []
    with _opened(path) as file:
        _collect("", file, vectors, objects, set())
        size = _declared(file) if objects else 0
    whole: dict[str, Any] = {}
    notes: list[str] = []
    if objects:
        largest = THRESHOLDS.count("objects_size")
        if size > largest:
            raise InputError(f"{path} holds objects such as a table, and {size / 1e6:.0f} MB; accepted with "
                             f"objects: {largest / 1e6:.0f} MB. "
                             f"{how_to_save(objects)}.")  # fmt: skip
        whole = object_vectors(path, sorted({name.split(".")[0] for name in objects}))
        if not whole and not vectors:
            raise InputError(not_read(path, objects))
        notes += [] if whole else [not_read(path, objects)]
    if not vectors and not whole:
        raise InputError(
            f"{path} holds no vectors of two or more numbers. Accepted: vectors, matrices with a sample per row, "
            "and structs of them; "
            "a table or timetable: save it with writetable, or its variables one by one."
        )

    def stream(wanted: Sequence[str]) -> Iterator[Any]:
        lengths = {name: vectors[name].length if name in vectors else len(whole[name]) for name in wanted}
        if len(set(lengths.values())) > 1:
            told = ", ".join(f"{name} {n}" for name, n in lengths.items())
            raise InputError(
                f"{path}: vectors of one source differ in length: {told}. Give each rate a [sources.NAME] with its "
                "own time column."
            )
        for begin in range(0, max(lengths.values()), ROWS):
            with _opened(path) as file:  # opened for each block: nothing stays open where the reader stops
                block = {
                    name: _read(file[vectors[name].path], vectors[name], begin)
                    if name in vectors
                    else whole[name][begin : begin + ROWS]
                    for name in wanted
                }
            yield as_batch(block)

    return Table(path, (*vectors, *(name for name in whole if name not in vectors)), stream, 1, "MATLAB", notes)


def _declared(file: Any) -> int:
    """Unpacked bytes of all data sets of a file; those that declare more than they hold are refused."""
    import h5py

    sizes = []

    def add(name: str, item: Any) -> None:
        if isinstance(item, h5py.Dataset):
            _check_stored(name, item)
            sizes.append(item.size * item.dtype.itemsize)

    file.visititems(add)
    return sum(sizes)


def _check_stored(name: str, item: Any) -> None:
    """Check that a data set holds the samples that it declares."""
    if item.size is None or "MATLAB_empty" in item.attrs:
        return
    if item.chunks:
        pieces, stored = (
            math.prod(math.ceil(n / c) for n, c in zip(item.shape, item.chunks, strict=True)),
            item.id.get_num_chunks(),
        )
    else:
        pieces, stored = item.size * item.dtype.itemsize, item.id.get_storage_size()
    if stored < pieces:
        raise InputError(
            f"{item.file.filename}: '{name}' declares {item.size} values and holds {stored / pieces:.0%} of them: "
            "the file is damaged. Save it anew."
        )


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    with needed_by(
        f"{path} is a MATLAB 7.3 file (HDF5). Reading it", "In MATLAB use save('log.mat', ..., '-v7') or writetable"
    ):
        import h5py
    try:
        with h5py.File(path, "r") as file:
            yield file
    except (OSError, RuntimeError, KeyError, TypeError, AttributeError) as error:
        raise ValueError(
            f"damaged MATLAB 7.3 file ({type(error).__name__}: {error})"
        ) from None  # tables.reading makes the message


def _collect(name: str, group: Any, vectors: dict[str, _Vector], objects: list[str], seen: set[int]) -> None:
    """Put possible columns into `vectors`, names of objects into `objects`.

    Only hard links are followed, each group once: no other files, no circles.
    """
    import h5py

    seen.add(h5py.h5o.get_info(group.id).addr)
    for key in group:
        if key.startswith("#") or not isinstance(group.get(key, getlink=True), h5py.HardLink):
            continue
        item, full = group[key], f"{name}.{key}" if name else key
        if isinstance(item, h5py.Group):
            if h5py.h5o.get_info(item.id).addr not in seen and full.count(".") < THRESHOLDS.count("structure_depth"):
                _collect(full, item, vectors, objects, seen)
        elif (
            isinstance(item, h5py.Dataset)
            and not item.is_virtual
            and item.external is None
            and "MATLAB_empty" not in item.attrs
        ):
            if "MATLAB_object_decode" in item.attrs:
                objects.append(full)
            else:
                _add(full, item, vectors)
        if len(vectors) > MOST_COLUMNS:
            raise InputError(
                f"{group.file.filename} holds more than {MOST_COLUMNS} vectors; accepted: up to that. Save those "
                "that you need."
            )


def _add(name: str, item: Any, vectors: dict[str, _Vector]) -> None:
    """Add a vector, or each column of a matrix. MATLAB's n x m matrix is an m x n data set."""
    if item.dtype.kind not in "fiub" or item.ndim not in (1, 2) or item.size < 2:
        return
    largest = THRESHOLDS.count("chunk_size")
    if item.chunks and np.prod(item.chunks, dtype=float) * item.dtype.itemsize > largest:
        raise InputError(
            f"{item.file.filename}: '{name}' is packed in pieces above {largest / 1e6:.0f} MB; accepted: smaller ones."
        )
    _check_stored(name, item)
    if item.attrs.get("MATLAB_class", b"") == b"char":
        if (
            item.ndim == 2 and item.shape[0] <= THRESHOLDS.count("letters_of_a_sample") and item.shape[1] > 1
        ):  # a row of letters for each sample, such as time stamps
            vectors[name] = _Vector(item.name, (None,), item.shape[1], text=True)
    elif item.ndim == 1:
        vectors[name] = _Vector(item.name, (None,), item.shape[0])
    elif 1 in item.shape:
        vectors[name] = _Vector(item.name, (0, None) if item.shape[0] == 1 else (None, 0), item.size)
    elif item.shape[0] <= MOST_COLUMNS:
        for j in range(item.shape[0]):
            vectors[f"{name}({j + 1})"] = _Vector(item.name, (j, None), item.shape[1])


def _read(item: Any, vector: _Vector, begin: int) -> Any:
    """Samples from `begin` on: floats, or texts without the blanks that fill them up."""
    rows = slice(begin, begin + ROWS)
    if vector.text:
        return ["".join(map(chr, letters)).rstrip() for letters in item[:, rows].T]
    return item[tuple(rows if index is None else index for index in vector.at)].astype(float)
