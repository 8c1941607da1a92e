"""Band of a fitted model, and its file beside the saved model: checked, without pickles, for these weights only."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..names import brief, shown
from ..regular_files import MOST_ARRAYS, read_bytes, read_json
from ..signals import MOTION, STATES
from ..storage import write_text

BAND_FILE = "band.json"
"""Name of the file in the folder of a saved model."""
_SCHEMA = 1
_CHANNELS = STATES[MOTION]
_LARGEST = 10**9
"""Largest count, and longest sample time [s], that a file may state."""


@dataclass(frozen=True, eq=False)
class Band:
    """Band of a model about its predictions, from its errors on runs that it was not fitted to (see `fit_band`).

    Args:
        factor: half-widths (K, 6) of x, y, psi, u, v, r [m, m, rad, m/s, m/s, rad/s] at each predicted time step; with
            `of_samples` multiples of half the range of the middle 90 % of the model's own `predict_samples`.
        dt: sample time [s].
        coverage: share of the measurements that it holds, on average over runs like those fitted.
        groups: number of groups of runs behind it.
        history: number of samples before the start that the predictions were given.
        of_samples: see `factor`.
    """

    factor: np.ndarray
    dt: float
    coverage: float
    groups: int
    history: int = 0
    of_samples: bool = False

    def __repr__(self) -> str:
        return brief(f"<Band of {100 * self.coverage:g} % over {self.seconds:g} s, from {self.groups} groups of runs>")

    @property
    def seconds(self) -> float:
        """Time after the start over which it is known [s]."""
        return len(self.factor) * self.dt

    def misfit(self, model: Any, history: int = 0, dt: float | None = None) -> str:
        """Reason why it does not hold for predictions of `model` with `history` samples before the start, at the sample
        time `dt` [s]; "" where it does."""
        if dt is not None and abs(dt - self.dt) > 1e-3 * self.dt:
            return f"the band is for time steps of {self.dt:g} s, the data have {dt:g} s"
        if history != self.history:
            return f"the band is for predictions with {self.history} samples of history, these have {history}"
        if self.of_samples != callable(getattr(model, "predict_samples", None)):
            return f"the band is for a model {'with' if self.of_samples else 'without'} predict_samples"
        return ""


def band_text(band: Band, files: Mapping[str, bytes]) -> str:
    """Content of the file of a band, for the saved model of these files (content by name)."""
    content: dict[str, Any] = {
        "schema": _SCHEMA, "dt": band.dt, "coverage": band.coverage, "groups": band.groups, "history": band.history,
        "of_samples": band.of_samples,
        "factor": {name: column.tolist() for name, column in zip(_CHANNELS, band.factor.T, strict=True)},
        "files": {name: hashlib.sha256(found).hexdigest() for name, found in files.items()},
    }  # fmt: skip
    return json.dumps(content | {"digest": _digest(content)}) + "\n"


def write_band(folder: Path, band: Band | None, names: tuple[str, ...]) -> None:
    """Write the band of the model that is saved in `folder` as the files `names`, atomically; None removes that of an
    earlier one."""
    if band is None:
        (folder / BAND_FILE).unlink(missing_ok=True)
    else:
        write_text(folder / BAND_FILE, band_text(band, {name: (folder / name).read_bytes() for name in names}))


def read_band(folder: Path) -> Band | None:
    """Band of the model that is saved in `folder`, or None where it has none.

    Raises:
        InputError: the file is damaged, or belongs to other weights.
    """
    path = folder / BAND_FILE
    if not os.path.lexists(path):
        return None
    try:
        found = read_json(path, "band")
        band = _checked(found)
        _check_files(folder, found["files"])
    except (InputError, ValueError) as error:
        raise InputError(
            f"{path} is no band of this model, or it is damaged: {str(error).rstrip('.')}. Delete it to predict "
            "without limits, or save model and band again: shipbench run --bands."
        ) from None
    return band


def own_band(model: Any) -> Band | None:
    """Band that a fitted model holds as its attribute `band`, or None."""
    band = getattr(model, "band", None)
    return band if isinstance(band, Band) else None


def _digest(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()[:32]


def _is_whole(value: Any, least: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and least <= value <= _LARGEST


def _is_between(value: Any, most: float) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and 0.0 < value < most


_KEYS: dict[str, tuple[str, Callable[[Any], bool]]] = {
    "schema": (f"{_SCHEMA}", lambda value: value == _SCHEMA),
    "dt": ("a positive number of seconds", lambda value: _is_between(value, _LARGEST)),
    "coverage": ("a number between 0 and 1", lambda value: _is_between(value, 1.0)),
    "groups": ("a whole number from 1", lambda value: _is_whole(value, 1)),
    "history": ("a whole number from 0", lambda value: _is_whole(value, 0)),
    "of_samples": ("true or false", lambda value: isinstance(value, bool)),
    "factor": ("numbers by channel", lambda value: isinstance(value, dict)),
    "files": (
        "digests by name of the model's files",
        lambda value: isinstance(value, dict) and len(value) > 0 and all(isinstance(v, str) for v in value.values()),
    ),
}
"""Keys of the file: accepted values in words, and their check."""


def _checked(found: Any) -> Band:
    """Band of the content of a file. Raises ValueError where it is none."""
    if not isinstance(found, dict):
        raise ValueError(f"it holds a {type(found).__name__}; accepted: an object with {', '.join(_KEYS)}")
    for key, (accepted, good) in _KEYS.items():
        if not good(found.get(key)):
            raise ValueError(f"{key} = {shown(repr(found.get(key)))[:60]}; accepted: {accepted}")
    if found.get("digest") != _digest({key: value for key, value in found.items() if key != "digest"}):
        raise ValueError("its numbers were changed after it was saved")
    lengths = {len(column) if isinstance(column, list) else 0 for column in found["factor"].values()}
    if set(found["factor"]) != set(_CHANNELS) or len(lengths) != 1 or 0 in lengths:
        raise ValueError(
            f"factor has the channels {shown(', '.join(found['factor']))[:60]} of {sorted(lengths)} time steps; "
            f"accepted: {', '.join(_CHANNELS)}, all of one number of time steps"
        )
    try:
        factor = np.array([found["factor"][name] for name in _CHANNELS]).T
    except ValueError:  # lists in lists
        factor = np.array(None)
    if factor.ndim != 2 or factor.dtype.kind not in "if" or not (np.isfinite(factor) & (factor >= 0)).all():
        raise ValueError("factor holds other values than finite numbers from 0")
    return Band(
        factor.astype(float), float(found["dt"]), float(found["coverage"]), found["groups"], found["history"],
        found["of_samples"],
    )  # fmt: skip


def _check_files(folder: Path, files: Mapping[str, str]) -> None:
    """Raise ValueError where the model in `folder` is not the one of these files; no path is made of their names."""
    there = {path.relative_to(folder).as_posix(): path for path in folder.rglob("*")}
    for name, digest in files.items():
        if name not in there:
            raise ValueError(f"it belongs to a model with the file '{shown(name)[:80]}', which is not here")
        if hashlib.sha256(read_bytes(there[name], most=MOST_ARRAYS)).hexdigest() != digest:
            raise ValueError(f"it belongs to other weights: {shown(name)[:80]} is not the file that it was saved with")
