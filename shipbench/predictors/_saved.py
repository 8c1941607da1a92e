"""Saved models: their training data, their two files, and checks that these are complete."""

from __future__ import annotations

import functools
import hashlib
import json
import logging
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..records import Dataset
from ..regular_files import MOST_ARRAYS, read_bytes, read_json, read_npz
from ..storage import in_one_step, write_text

_log = logging.getLogger(__name__)
SAVED_FILES = ("model.json", "arrays.npz")
"""Names of the files of a saved model."""
_LARGEST_JSON = 16_000_000
"""Most bytes of a model.json; fitted arrays are stored in arrays.npz."""
_SHIP_DIFFERS = 0.01
"""Relative difference of a main dimension that is more than rounding in a ship file."""
_SAMPLE = 16
"""Digits of the fingerprint of a sample."""


@dataclass(frozen=True)
class Origin:
    """Training data of a model: sample time [s], inputs, actuators ("measured" or "commanded"), the ship's name, L, B,
    T [m] and displacement [m^3], fingerprint of the training runs, and one of the ends of each (empty where an older
    saved model does not state them)."""

    dt: float
    inputs: tuple[str, ...]
    actuators: str = ""
    ship: str = ""
    size: tuple[float, ...] = ()
    fingerprint: str = ""
    runs: tuple[str, ...] = ()

    @classmethod
    def of(cls, data: Dataset) -> Origin:
        ship = data.ship
        volume = ship.displacement if ship.displacement is not None else float(ship.mass or 0.0) / ship.rho
        size = (ship.L, ship.B, ship.T, volume)
        ends = tuple(_sample(run.states[0]) + _sample(run.states[-1]) for run in data.runs)
        return cls(data.dt, data.inputs, data.actuators, ship.name, size, data.fingerprint, ends)


def _sample(state: np.ndarray) -> str:
    """Fingerprint of one sample of a run."""
    return hashlib.sha256(np.ascontiguousarray(state, dtype=np.float64).tobytes()).hexdigest()[:_SAMPLE]


def runs_of_training(origin: Origin, data: Dataset) -> int:
    """Number of the runs of `data` on which a model was fitted, or on a window of which: they hold both ends of it."""
    ends: dict[str, set[str]] = {}
    for run in origin.runs:
        ends.setdefault(run[:_SAMPLE], set()).add(run[_SAMPLE:])
    count = 0
    for samples in ({_sample(state) for state in run.states} for run in data.runs if ends):
        count += any(ends[first] & samples for first in samples & ends.keys())
    return count


def remembers_origin(fit: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate `fit` so that the model's `origin` is that of its training data; a band of an earlier fit is dropped."""

    @functools.wraps(fit)
    def fitted(self: Any, train: Dataset, *args: Any, **options: Any) -> Any:
        model = fit(self, train, *args, **options)
        self.origin, self.band = Origin.of(train), None
        return model

    return fitted


def remembers_origins(fit_group: Callable[..., Any]) -> Callable[..., Any]:
    """Decorate the class method that fits many models in the same way."""

    @functools.wraps(fit_group)
    def fitted(cls: Any, models: Any, trains: Any, *args: Any, **options: Any) -> Any:
        found = fit_group(cls, models, trains, *args, **options)
        for model, train in zip(models, trains, strict=True):
            model.origin, model.band = Origin.of(train), None
        return found

    return fitted


def check_origin(name: str, origin: Origin | None, data: Dataset) -> list[str]:
    """Warnings for a saved model `name` that is used on `data`: another ship, other actuators, or runs of its own
    training. Each is one line of the log.

    Raises:
        InputError: the data have another sample time or other channels than the model was made for.
    """
    if origin is None:
        return []
    if abs(origin.dt - data.dt) > 1e-3 * origin.dt:
        raise InputError(
            f"the saved model {name} steps {origin.dt:g} s; data set '{data.name}' is sampled at {data.dt:g} s. "
            f"Accepted: data at {origin.dt:g} s. "
            f"Import the log again with dt = {origin.dt:g} in its mapping, or fit the model on these data."
        )
    if origin.inputs != data.inputs:
        raise InputError(
            f"the model uses the inputs {', '.join(origin.inputs)}; data set '{data.name}' has "
            f"{', '.join(data.inputs)}. "
            "Give data with the same channels."
        )
    notes, here = [], Origin.of(data)
    words = zip(("L", "B", "T", "displacement"), origin.size, here.size, ("m", "m", "m", "m^3"), strict=False)
    differs = [
        f"{key} = {now:.4g} {unit} (model: {then:.4g})"
        for key, then, now, unit in words
        if abs(now - then) > _SHIP_DIFFERS * then
    ]
    if differs:
        notes.append(
            f"the saved model {name} was fitted on ship '{origin.ship}'; these data are of another: "
            f"{', '.join(differs)}"
        )
    if origin.actuators and origin.actuators != data.actuators:
        notes.append(
            f"the saved model {name} was fitted on {origin.actuators} actuators; these data have {data.actuators} ones"
        )
    if known := runs_of_training(origin, data):
        notes.append(
            f"the saved model {name} was fitted on {known} of the {len(data)} runs: there its errors are not those of "
            "a prediction"
        )
    for note in notes:
        _log.warning("warning: %s", note)
    return notes


def write_saved(folder: Path, meta: Mapping[str, Any], arrays: Mapping[str, np.ndarray]) -> None:
    """Write `meta` as model.json and `arrays` as arrays.npz, each atomically, with a digest by which damage is
    found."""
    with in_one_step(folder / "arrays.npz", suffix=".npz") as part:
        np.savez(part, allow_pickle=False, **arrays)
        digest = _digest(meta, part.read_bytes())
    write_text(folder / "model.json", json.dumps({**meta, "digest": digest}, indent=1))


def read_meta(folder: Path) -> dict[str, Any]:
    """Read the content of model.json.

    Raises:
        InputError: it is missing, damaged, or not a file of `write_saved`.
    """
    try:
        meta = read_json(folder / "model.json", most=_LARGEST_JSON)
        for key, kind in (("predictor", str), ("params", dict), ("inputs", list), ("meta", dict)):
            if not isinstance(meta, dict) or not isinstance(meta.get(key), kind):
                raise ValueError(f"model.json has no '{key}' that is a {kind.__name__}")
        if not all(isinstance(name, str) for name in meta["inputs"]):
            raise ValueError("model.json: the inputs are not names")
    except (InputError, ValueError) as error:
        raise damaged(folder, error) from None
    return meta


def read_arrays(folder: Path, meta: dict[str, Any]) -> dict[str, np.ndarray]:
    """Read the arrays that belong to `meta`, complete.

    Raises:
        InputError: they are missing, damaged, or of another model.
    """
    path = folder / "arrays.npz"
    try:
        arrays = read_npz(path)
        with zipfile.ZipFile(path) as archive:
            if (broken := archive.testzip()) is not None:
                raise ValueError(f"arrays.npz is damaged at {broken}")
        signed = "digest" in meta or "made_for" in meta  # only the oldest have neither
        if signed and meta.get("digest") != _digest(
            {k: v for k, v in meta.items() if k != "digest"}, read_bytes(path, most=MOST_ARRAYS)
        ):
            raise ValueError("its files were changed after it was saved, or are damaged")
        for name, array in arrays.items():
            if array.dtype.kind not in "fiub":
                raise ValueError(f"array '{name}' holds no numbers")
    except Exception as error:  # zipfile, zlib and numpy raise anything on a damaged file
        raise damaged(folder, error) from None
    return arrays


def damaged(folder: Path, error: Exception) -> InputError:
    """Error for a folder that holds no saved model, or a damaged one."""
    why = (str(error) or type(error).__name__).rstrip(".")
    return InputError(
        f"{folder} is not a saved model, or it is damaged: {why}. Give a folder that save() wrote, whole, or fit "
        "the model again."
    )


def check_shapes(arrays: Mapping[str, np.ndarray], shapes: Mapping[str, tuple[int, ...]]) -> None:
    """Raise ValueError where an array is missing or has another shape."""
    for name, shape in shapes.items():
        found = arrays[name].shape if name in arrays else "none"
        if found != shape:
            raise ValueError(f"array '{name}' has shape {found}; accepted: {shape}")


def sample_time(meta: Mapping[str, Any]) -> float:
    """Sample time dt [s] of a saved model. Raises ValueError where it is none."""
    dt = float(meta["dt"])
    if not 0.0 < dt < np.inf:
        raise ValueError(f"dt = {dt}; accepted: a positive number of seconds")
    return dt


def origin_of(meta: dict[str, Any]) -> Origin | None:
    """Training data of a saved model; of one saved by an older version, its dt and inputs only. None where it does not
    state them."""
    if isinstance(made := meta.get("made_for"), dict):
        return Origin(
            sample_time(made),
            tuple(made["inputs"]),
            str(made["actuators"]),
            str(made["ship"]),
            tuple(map(float, made["size"])),
            str(made.get("fingerprint", "")),
            tuple(map(str, made.get("runs", ()))),
        )
    inner = meta["meta"].get("physics", meta["meta"])
    return Origin(sample_time(inner), tuple(meta["inputs"])) if "dt" in inner else None


def _digest(meta: Mapping[str, Any], arrays: bytes) -> str:
    text = json.dumps(meta, sort_keys=True).encode()
    return hashlib.sha256(text + b"\0" + arrays).hexdigest()[:32]


def described(origin: Origin | None) -> dict[str, Any]:
    """Training data as values of model.json."""
    return {} if origin is None else {"made_for": asdict(origin)}
