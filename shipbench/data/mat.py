"""A data set as one MATLAB file (version 5, which every MATLAB and Octave reads) and back, sample for sample.

The file holds two variables:

- `dataset`: struct with name, dt [s], actuators, source, licence, simulation, notes (cell), fingerprint and ship
(struct, SI);
- `runs`: struct array, one element per run, with id, t (samples x 1) [s], states (samples x 10), commands (samples x
  4), environment (samples x channels), names and units (structs with one cell of text per array) and meta (text, JSON).

Row k of commands and environment is held on [t_k, t_k+1). Units and signs are those of `signals`; n is in rpm.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..matlab_files import check_matlab
from ..records import Dataset, Run
from ..regular_files import open_regular
from ..run_meta import RunMeta
from ..ship import Ship
from ..signals import COMMANDS, ENVIRONMENT, STATES, UNITS
from ..storage import in_one_step

_RUN_FIELDS = ("id", "t", "states", "commands", "environment", "names", "units", "meta")


def cells(texts: Any) -> np.ndarray:
    """Column of text as a MATLAB cell array."""
    found = np.empty((len(texts), 1), dtype=object)
    found[:, 0] = list(texts)
    return found


def struct_array(rows: list[dict[str, Any]]) -> np.ndarray:
    """Dicts with the same keys as a 1 x n struct array."""
    found = np.empty((1, len(rows)), dtype=[(key, object) for key in rows[0]])
    for i, row in enumerate(rows):
        found[0, i] = tuple(row.values())
    return found


def save_mat(path: Path, variables: dict[str, Any]) -> None:
    """Write variables into a .mat file atomically.

    Raises:
        InputError: the file cannot be written, or is too large for the format (2 GB a variable).
    """
    from scipy.io import savemat
    from scipy.io.matlab import MatWriteError

    try:
        with in_one_step(path) as part, part.open("wb") as file:
            savemat(file, variables, do_compression=True, oned_as="column", long_field_names=True)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}. Give a file or folder that can be written.") from None
    except (MatWriteError, OverflowError) as error:
        raise InputError(
            f"{path}: too large for a .mat file ({error}). Take --format parquet, or export fewer runs."
        ) from None


def write_mat(dataset: Dataset, path: str | Path) -> None:
    """Write `dataset` into one .mat file; `read_mat` gives back the same samples, bit for bit.

    Raises:
        InputError: as `save_mat`.
    """
    environment = dataset.inputs[len(COMMANDS) :]
    names = {"states": cells(STATES), "commands": cells(COMMANDS), "environment": cells(environment)}
    units = {part: cells([UNITS[name] for name in texts[:, 0]]) for part, texts in names.items()}
    runs = [
        {
            "id": run.id, "t": run.t, "states": run.states, "commands": run.inputs[:, : len(COMMANDS)],
            "environment": run.inputs[:, len(COMMANDS) :], "names": names, "units": units,
            "meta": json.dumps(run.meta.as_dict(), default=str),
        }
        for run in dataset.runs
    ]  # fmt: skip
    about = {
        "name": dataset.name, "dt": float(dataset.dt), "actuators": dataset.actuators, "source": dataset.source,
        "licence": dataset.licence,
        "simulation": dataset.simulation or "", "notes": cells(dataset.notes), "derived": cells(dataset.derived),
        "fingerprint": dataset.fingerprint,
        "ship": dataset.ship.model_dump(exclude_none=True),
    }  # fmt: skip
    save_mat(Path(path), {"dataset": about, "runs": struct_array(runs)})


def is_export(path: str | Path) -> bool:
    """Whether a .mat file holds the variables of `write_mat`; also where it cannot be read, which `read_mat`
    explains."""
    from scipy.io import whosmat

    try:
        with open_regular(path, ".mat file") as file:
            check_matlab(file)
            return {"dataset", "runs"} <= {name for name, _, _ in whosmat(file)}
    except NotImplementedError:  # version 7.3, which scipy does not read, and `data import` does
        return False
    except Exception:  # the reader raises whatever a damaged file leads it to
        return True


def read_mat(path: str | Path) -> Dataset:
    """Read a file that `write_mat` wrote (or MATLAB in the same form, saved with -v7).

    Raises:
        InputError: it is no such file, or its arrays do not fit together.
    """
    from scipy.io import loadmat

    try:
        with open_regular(path, ".mat file") as file:
            check_matlab(file)
            found = loadmat(file, variable_names=["dataset", "runs"])
    except InputError:
        raise
    except NotImplementedError:
        raise InputError(
            f"{path} is a MATLAB file of version 7.3, which is not read; save it again with save(..., '-v7')."
        ) from None
    except Exception as error:  # the reader raises whatever a damaged file leads it to
        raise InputError(
            f"{path} cannot be read: {' '.join(str(error).split())[:160]}. Give a .mat file that `data export` wrote."
        ) from None
    try:
        about = _plain(found["dataset"])
        runs = tuple(_run(element, str(path)) for element in np.atleast_1d(found["runs"].squeeze()))
        given = {key: str(about[key]) for key in ("name", "actuators", "source", "licence")}
        dt, notes, simulation, ship = (
            float(about["dt"]),
            tuple(about["notes"]),
            about["simulation"] or None,
            about["ship"],
        )
        derived = tuple(str(name) for name in about.get("derived", ()))
    except (KeyError, IndexError, TypeError, ValueError, AttributeError, OverflowError, RecursionError) as error:
        fields = f"accepted: the variables dataset and runs, each run with {', '.join(_RUN_FIELDS)}"
        raise InputError(
            f"{path} does not have the form that `data export` writes ({type(error).__name__}: {error}); {fields}."
        ) from None
    return Dataset(
        ship=Ship.from_dict(ship, f"{path}: dataset.ship"), dt=dt, runs=runs, notes=notes, simulation=simulation,
        derived=derived,
        name=given["name"], actuators=given["actuators"], source=given["source"], licence=given["licence"],
    )  # fmt: skip


def _run(element: Any, where: str) -> Run:
    names = _plain(element["names"])
    environment = tuple(names["environment"])
    if (tuple(names["states"]), tuple(names["commands"])) != (STATES, COMMANDS) or not set(environment) <= set(
        ENVIRONMENT
    ):
        raise InputError(
            f"{where}: names are {names}; accepted: states {', '.join(STATES)}, commands {', '.join(COMMANDS)}, "
            "environment any of "
            f"{', '.join(ENVIRONMENT)}, in this order."
        )
    t = np.asarray(element["t"], dtype=float).ravel()
    arrays = [
        np.asarray(element[part], dtype=float).reshape(len(t), -1) for part in ("states", "commands", "environment")
    ]
    name = _plain(element["id"])
    meta = RunMeta.of(json.loads(_plain(element["meta"]) or "{}"), f"run '{name}'")
    return Run(name, t, arrays[0], np.hstack(arrays[1:]), (*COMMANDS, *environment), meta)


def _plain(value: Any) -> Any:
    """Structs as dicts, cells as lists, text as str, single numbers as float, vectors as lists."""
    if isinstance(value, np.ndarray):
        if value.dtype.names:
            return {name: _plain(value.flat[0][name]) for name in value.dtype.names}
        if value.dtype == object:
            return [_plain(v) for v in value.ravel()]
        if value.dtype.kind == "U":
            return str(value.flat[0]) if value.size else ""
        return float(value.flat[0]) if value.size == 1 else [float(v) for v in value.ravel()]
    return value
