"""MATLAB tables, timetables, datetimes and strings, read with mat-io; needs the extra `shipbench[matlab]`."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from ..extras import needed_by
from .thresholds import THRESHOLDS


def object_vectors(path: Path, names: Sequence[str] | None = None) -> dict[str, Any]:
    """Columns of the objects in a .mat file under names such as `T.heading`; of timetables the row times, too. They are
    read whole.

    Args:
        path: a .mat file of any version, of a size that was checked.
        names: variables to read (default: all).

    Raises:
        InputError: mat-io is not installed.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with needed_by(f"{path} holds objects such as a table. Reading them", how_to_save(names)):
            import matio
        try:
            content = matio.load_from_mat(str(path), variable_names=None if names is None else list(names))
        except Exception:  # whatever a stranger's file does to a stranger's reader: it is not read
            return {}
    vectors: dict[str, Any] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _collect(name, value, vectors, 0)
    return vectors


def not_read(path: Path, names: Sequence[str]) -> str:
    """Error for objects that mat-io does not read."""
    return f"{path} holds objects of MATLAB ({', '.join(names)}) that are not read. {how_to_save(names)}."


def how_to_save(names: Sequence[str] | None) -> str:
    """Advice for MATLAB where an object cannot be read."""
    name = names[0] if names else "T"
    return f"Save it in MATLAB with writetable({name}, 'log.csv'), a timetable with writetimetable"


def _collect(name: str, value: Any, vectors: dict[str, Any], depth: int) -> None:
    if isinstance(value, pd.DataFrame):
        if not isinstance(value.index, pd.RangeIndex):
            vectors[f"{name}.{value.index.name or 'Time'}"] = value.index.to_numpy()
        for column in value.columns:
            _collect(f"{name}.{column}", value[column].to_numpy(), vectors, depth)
    elif isinstance(value, np.ndarray) and value.dtype.names is not None:  # a struct
        if value.size == 1 and depth < THRESHOLDS.count("structure_depth"):
            for field in value.dtype.names:
                _collect(f"{name}.{field}", value[field].item(), vectors, depth + 1)
    elif isinstance(value, np.ndarray) and value.size > 1:
        column = np.squeeze(value)
        if column.ndim != 1:
            return
        if column.dtype.kind in "fiubMm":
            vectors[name] = column
        elif column.dtype.kind in "US" or all(isinstance(v, str) for v in column):
            vectors[name] = [str(v) for v in column]
