"""Files of predicted trajectories: a data set, tables with the standard columns, or anything else with a mapping."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd

from ..data.base import LOG_SUFFIXES
from ..data.files import TABLES, read_dataset, read_description, read_table
from ..data.mat import is_export, read_mat
from ..data.trajectories import read_trajectories
from ..errors import InputError
from ..frames import ACTUATOR_STATES, MOTION_STATES, blocks, check_columns, samples
from ..importing.constants import GRAVITY
from ..importing.importer import import_logs
from ..importing.mapping import Layout, Mapping, Origin, load_mapping
from ..importing.position import to_body
from ..importing.speeds import derivative
from ..importing.tables import open_table
from ..records import Dataset
from ..signals import PSI, STATES, VELOCITY, R, U, V, X, Y

_SUFFIXES = (".csv", ".csv.gz", ".parquet", ".mat")
_NEEDED = ("t", "x", "y", "psi")
_COLUMNS = f"trajectory, {', '.join(_NEEDED)}, and u, v, r, {', '.join(ACTUATOR_STATES)} where they are known"
_SHOWN = 40
"""Most columns that a message lists."""


@dataclass(frozen=True, eq=False)
class Track:
    """Predicted trajectory as its file has it.

    Args:
        id: name in the file.
        t: (n,) [s], increasing.
        states: (n, 10), order and units of `signals.STATES`; NaN in the columns of actuators that the file lacks.
        began: date and time of t = 0, or None.
    """

    id: str
    t: np.ndarray
    states: np.ndarray
    began: datetime | None = None


@dataclass(frozen=True, eq=False)
class Tracks:
    """Trajectories of one file or folder, and notes on what was filled in."""

    tracks: tuple[Track, ...]
    notes: tuple[str, ...] = ()


def files_of(path: Path, mapping: str = "") -> list[Path]:
    """Files that `read_tracks` reads, sorted, with the mapping.

    Raises:
        InputError: there is no such file or folder, or the folder holds no table.
    """
    given = [Path(mapping)] if mapping else []
    if path.is_file():
        return [path, *given]
    if not path.is_dir():
        raise InputError(
            f"predictions {path}: no such file or folder. Accepted: a folder or file of trajectories with the columns "
            f"{_COLUMNS}."
        )
    inside = sorted(p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
    if (path / "dataset.toml").exists():
        return [p for p in inside if p.name in TABLES or p.suffix == ".toml"]
    own = [path / "mapping.toml"] if not given and (path / "mapping.toml").exists() else []
    found = [p for p in inside if p.name.lower().endswith(LOG_SUFFIXES if given or own else _SUFFIXES)]
    if not found:
        raise InputError(
            f"predictions {path}: the folder holds no trajectories. Accepted: dataset.toml with its table, or files "
            f"{', '.join(_SUFFIXES)} with the columns {_COLUMNS}."
        )
    return [*found, *own, *given]


def read_tracks(path: Path, mapping: str, data: Dataset) -> Tracks:
    """Trajectories in a data-set folder, in tables with the standard columns, or in logs with a mapping (`mapping`, or
    mapping.toml in the folder), in SI units and standard signs.

    Args:
        data: data set whose ship and sample time serve where speeds are derived and logs imported.

    Raises:
        InputError: a file cannot be read, a column is missing, or time does not increase.
    """
    files = files_of(path, mapping)
    if path.is_dir() and (path / "dataset.toml").exists() and not mapping:
        return _of_dataset(read_dataset(path), _absent(path))
    maps = [file for file in files if file.suffix == ".toml"]
    if maps:
        return _imported([file for file in files if file not in maps], maps[0], data)
    if len(files) == 1 and files[0].suffix == ".mat" and is_export(files[0]):
        return _of_dataset(read_mat(files[0]), ())
    notes: dict[str, None] = {}
    tracks = [track for file in files for track in _of_table(file, data, notes)]
    if twice := sorted({t.id for t in tracks if sum(other.id == t.id for other in tracks) > 1}):
        raise InputError(f"predictions {path}: two files hold a trajectory '{twice[0]}'. Rename one of them.")
    return Tracks(tuple(tracks), tuple(notes))


def _absent(folder: Path) -> tuple[str, ...]:
    """Actuators without a column in the table of a data set."""
    table, _ = read_table(folder, read_description(folder / "dataset.toml"))
    return tuple(name for name in ACTUATOR_STATES if name not in table)


def _of_dataset(found: Dataset, absent: Sequence[str]) -> Tracks:
    tracks = []
    for run in found.runs:
        states = run.states.copy()
        states[:, [STATES.index(name) for name in absent]] = np.nan
        tracks.append(Track(run.id, run.t, states, run.began))
    return Tracks(tuple(tracks), tuple(_filled(found.derived, absent)))


def _filled(derived: Sequence[str], absent: Sequence[str]) -> list[str]:
    notes = []
    if derived:
        notes.append(f"{', '.join(derived)} not given: derived from x, y and psi by a smoothing spline")
    if absent:
        notes.append(f"{', '.join(absent)} not given: taken as the commands")
    return notes


def _imported(logs: list[Path], path: Path, data: Dataset) -> Tracks:
    """Trajectories of logs that a mapping explains, interpolated to the sample time of the data set."""
    mapping = load_mapping(path, dt=data.dt, antialias=False, shortest=data.dt)
    mapping = _at_origin(mapping, data)
    with tempfile.TemporaryDirectory(prefix="shipbench-") as scratch:
        folder = Path(scratch, "predictions")
        summary = import_logs(logs, mapping, data.ship, folder)
        for name, step in summary.steps.items():
            if name in ("x", "y", "lat", "lon", "psi") and math.isfinite(step) and step > data.dt * (1.0 + 1e-3):
                raise coarse(str(path.parent), f"'{name}'", step, data)
        return _of_dataset(read_dataset(folder), _absent(folder))


def _at_origin(mapping: Mapping, data: Dataset) -> Mapping:
    """Mapping with the origin of the data set's plane, where it has one and the mapping none."""
    origins = {run.meta.origin for run in data.runs}
    if not mapping.has("lat") or mapping.origin is not None or len(origins) != 1 or None in origins:
        return mapping
    (origin,) = origins
    assert origin is not None
    return mapping.model_copy(update={"origin": Origin(lat=origin.lat, lon=origin.lon)})


def coarse(where: str, what: str, step: float, data: Dataset) -> InputError:
    """Error for a trajectory with fewer samples than the data set."""
    return InputError(
        f"predictions {where}: {what} is sampled every {step:.4g} s, the data set '{data.name}' every {data.dt:g} s. "
        f"Accepted: {data.dt:g} s or finer. Write the trajectories at that rate."
    )


def _of_table(path: Path, data: Dataset, notes: dict[str, None]) -> list[Track]:
    tables = _mat(path) if path.suffix == ".mat" else [_read(path)]
    tracks = []
    for table in tables:
        check_columns(table, path)
        absent = [name for name in ACTUATOR_STATES if name not in table]
        derived = [name for name in MOTION_STATES[VELOCITY] if name not in table]
        notes.update(dict.fromkeys(_filled(derived, absent)))
        table[[*absent, *derived]] = np.nan
        for name, rows in blocks(table):
            t, states = rows["t"], samples(rows, STATES)
            _check_time(t, name, path)
            states[:, PSI] = _unwrapped(states[:, PSI])
            if derived:
                _derive(t, states, derived, data)
            tracks.append(Track(name, t, states))
    return tracks


def _read(path: Path) -> pd.DataFrame:
    """Known columns of a CSV or Parquet file; a file without a column of names is one trajectory."""
    table = read_trajectories(path, "trajectory", lambda names: _known(list(names), path))
    if "trajectory" not in table:
        table.insert(0, "trajectory", path.name.removesuffix(".gz").rpartition(".")[0])
    return table


def _known(names: list[str], path: Path) -> list[str]:
    if missing := [name for name in _NEEDED if name not in names]:
        raise _unknown(names, missing, path)
    return [name for name in names if name in ("trajectory", "t", *STATES)]


def _unknown(names: Sequence[str], missing: Sequence[str], path: Path) -> InputError:
    shown = ", ".join([*names[:_SHOWN], *(["..."] if len(names) > _SHOWN else [])])
    return InputError(
        f"predictions {path}: no column {', '.join(missing)}. Found: {shown}. Accepted: the columns {_COLUMNS}; or a "
        f"mapping: shipbench data import {path} --propose {path.parent / 'mapping.toml'}, then with --mapping "
        f"{path.parent / 'mapping.toml'}"
    )


def _mat(path: Path) -> list[pd.DataFrame]:
    """Tables of a MATLAB file: its vectors t, x, y, psi and so on, or those of each struct, which names the
    trajectory."""
    opened = open_table(path, Layout())
    groups: dict[str, dict[str, str]] = {}
    for name in opened.columns:
        struct, _, signal = name.rpartition(".")
        groups.setdefault(struct, {})[signal] = name
    found = []
    for struct, names in groups.items():
        if missing := [name for name in _NEEDED if name not in names]:
            if len(groups) == 1:
                raise _unknown(list(names), missing, path)
            continue
        wanted = {signal: names[signal] for signal in ("trajectory", "t", *STATES) if signal in names}
        batches = [batch.to_pandas() for batch in opened.batches(list(wanted.values()))]
        table = pd.concat(batches, ignore_index=True).rename(columns={v: k for k, v in wanted.items()})
        if "trajectory" in table:
            ids = table["trajectory"]
            table["trajectory"] = ids.map("{:g}".format) if ids.dtype.kind in "fiu" else ids
        else:
            table.insert(0, "trajectory", struct or path.stem)
        found.append(table)
    if not found:
        raise _unknown(list(opened.columns), _NEEDED, path)
    return found


def _check_time(t: np.ndarray, name: str, path: Path) -> None:
    back = np.flatnonzero(~(np.diff(t) > 0.0))
    if len(t) < 2 or not np.isfinite(t).all() or len(back):
        k = int(back[0]) if len(back) else 0
        told = f"t goes from {t[k]:g} s to {t[k + 1]:g} s" if len(t) > 1 else f"it has {len(t)} sample"
        raise InputError(
            f"predictions {path}: trajectory '{name}': {told}. Accepted: two samples or more, in order of t."
        )


def _unwrapped(psi: np.ndarray) -> np.ndarray:
    """Continuous heading; a value that is not finite stays so, and leaves the others."""
    found, known = psi.copy(), np.isfinite(psi)
    found[known] = np.unwrap(psi[known])
    return found


def _derive(t: np.ndarray, states: np.ndarray, derived: Sequence[str], data: Dataset) -> None:
    """Fill in the speeds `derived`, in place, up to the first pose that is not finite."""
    finite = np.isfinite(states[:, [X, Y, PSI]]).all(axis=1)
    end = len(t) if finite.all() else int(np.argmin(finite))
    if end < 2:
        return
    scale, known = math.sqrt(data.ship.L / GRAVITY), slice(0, end)

    def rates(columns: list[int]) -> np.ndarray:
        return derivative(t[known], states[known][:, columns], t[known], data.dt, scale).rate

    if "r" in derived:
        states[known, R] = rates([PSI])[:, 0]
    if "u" in derived or "v" in derived:
        track = rates([X, Y])
        body = to_body(track[:, 0], track[:, 1], states[known, PSI])
        for name, column, values in zip("uv", (U, V), body, strict=True):
            if name in derived:
                states[known, column] = values
