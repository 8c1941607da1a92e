"""A data set on disk: trajectories, dataset.toml and ship.toml in one folder (contract, section 3)."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pandas as pd
import tomli_w
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..errors import InputError, unknown_name
from ..records import Dataset, Run
from ..ship import Ship, read_toml
from ..signals import ACTUATORS, COMMANDS, ENVIRONMENT, STATES
from .units import sign_factor, unit_factor

_TABLES = ("trajectories.parquet", "trajectories.csv.gz", "trajectories.csv")
_ACTUATORS = STATES[ACTUATORS]
_MOTION = STATES[: ACTUATORS.start]


class _Description(BaseModel):
    """dataset.toml; an unknown key is an error, never ignored."""

    model_config = ConfigDict(extra="forbid")
    name: str
    ship: str = "ship.toml"
    dt: float = Field(gt=0)
    actuators: Literal["measured", "commanded"]
    source: str = ""
    licence: str = ""
    simulation: str | None = None
    notes: list[str] = []
    units: dict[str, str] = {}
    signs: dict[str, str] = {}
    columns: dict[str, str] = {}
    runs: dict[str, dict[str, Any]] = {}


def read_dataset(folder: str | Path) -> Dataset:
    """Read a folder of the contract's format into SI and our signs.

    Raises:
        InputError: a file or column is missing, a value is not a finite number, time is not uniform, or a key, unit or sign is unknown.
    """
    folder = Path(folder)
    description = _describe(folder / "dataset.toml")
    ship = Ship.load(folder / description.ship)
    table, where = _read_table(folder)
    table = table.rename(columns=description.columns)
    notes = list(description.notes)
    inputs = _complete_columns(table, where, notes)
    _convert(table, description)
    unknown = set(description.runs) - set(table["trajectory"])
    if unknown:
        raise unknown_name(f"run in [runs] of {folder / 'dataset.toml'}", sorted(unknown)[0], table["trajectory"].unique())
    runs = tuple(_run(str(name), group, inputs, description, where) for name, group in table.groupby("trajectory", sort=False))
    return Dataset(
        name=description.name, ship=ship, dt=description.dt, runs=runs, actuators=description.actuators, source=description.source,
        licence=description.licence, simulation=description.simulation, notes=tuple(dict.fromkeys(notes)),
    )  # fmt: skip


def _describe(path: Path) -> _Description:
    data = read_toml(path)
    try:
        return _Description.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(k) for k in first["loc"])
        value = "" if first["type"] == "missing" else f" (value: {str(first['input'])[:80]})"
        raise InputError(f"{path}: {key}: {first['msg']}{value}. Accepted keys: {', '.join(_Description.model_fields)}.") from None


def _read_table(folder: Path) -> tuple[pd.DataFrame, Path]:
    path = next((folder / name for name in _TABLES if (folder / name).is_file()), None)
    if path is None:
        raise InputError(f"folder {folder} has no trajectories; accepted: {', '.join(_TABLES)}.")
    try:
        table = pd.read_parquet(path) if path.suffix == ".parquet" else pd.read_csv(path, dtype={"trajectory": str}, float_precision="round_trip")
    except (ValueError, OSError, pd.errors.ParserError, EOFError) as error:
        reason = " ".join(str(error).split())[:160]
        raise InputError(f"{path} cannot be read: {reason}. It must be a table with the columns trajectory, t and the states.") from None
    if table.empty:
        raise InputError(f"{path} has no rows; it needs one row per sample.")
    return table, path


def _complete_columns(table: pd.DataFrame, where: Path, notes: list[str]) -> tuple[str, ...]:
    """Check names and types, add what may be missing (with a note), and return the names of the inputs."""
    for column in ("trajectory", "t", *_MOTION):
        if column not in table:
            raise unknown_name(f"column '{column}' is required in {where.name} but it has: {', '.join(map(str, table.columns))}; column", column, table.columns)
    table["trajectory"] = table["trajectory"].astype(str)
    for actuator, command in zip(_ACTUATORS, COMMANDS, strict=True):
        if actuator not in table and command not in table:
            table[actuator] = 0.0
            notes.append(f"{actuator} is not recorded: taken as zero")
        if actuator not in table:
            table[actuator] = table.groupby("trajectory")[command].shift(1).fillna(table[command])
            notes.append(f"{actuator} is not recorded: taken as the command of the sample before")
        if command not in table:
            table[command] = table[actuator]
            notes.append(f"{command} is not recorded: taken as {actuator}")
    for column in ("t", *STATES, *COMMANDS, *(c for c in ENVIRONMENT if c in table)):
        if not pd.api.types.is_numeric_dtype(table[column]):
            bad = pd.to_numeric(table[column], errors="coerce").isna()
            row = int(np.argmax(bad.to_numpy()))
            raise InputError(f"{where}, row {row + 2}: {column} is '{table[column].iloc[row]}', not a number. Accepted: decimal numbers with a point.")
        table[column] = table[column].astype(float)
    return (*COMMANDS, *(c for c in ENVIRONMENT if c in table))


def _convert(table: pd.DataFrame, description: _Description) -> None:
    known = (*STATES, *COMMANDS, *ENVIRONMENT)
    for entries, factor in ((description.units, unit_factor), (description.signs, sign_factor)):
        for signal, word in entries.items():
            if signal not in known:
                raise unknown_name("signal in [units] or [signs]", signal, known)
            command = signal + "_c"
            targets = [signal, *([command] if command in COMMANDS and command not in entries else [])]
            for target in targets:
                if target in table:
                    table[target] *= factor(signal, word)


def _run(name: str, group: pd.DataFrame, inputs: tuple[str, ...], description: _Description, where: Path) -> Run:
    t = group["t"].to_numpy()
    if len(t) < 2:
        raise InputError(f"{where}: run '{name}' has {len(t)} sample; at least 2 are needed.")
    steps = np.diff(t)
    wrong = np.flatnonzero(~(np.abs(steps - description.dt) <= 1e-3 * description.dt))
    if len(wrong):
        k = int(wrong[0])
        raise InputError(
            f"{where}: run '{name}': t goes from {t[k]:g} s to {t[k + 1]:g} s, dt in dataset.toml is {description.dt:g} s ({len(wrong)} such steps). "
            "Time must be uniform inside a run and its rows in order: resample, or split the run at the gap."
        )
    states = group[list(STATES)].to_numpy()
    if np.isfinite(states[:, 2]).all():
        states[:, 2] = np.unwrap(states[:, 2])
    return Run(name, t, states, group[list(inputs)].to_numpy(), inputs, dict(description.runs.get(name, {})))


def write_dataset(dataset: Dataset, folder: str | Path, format: Literal["csv.gz", "csv", "parquet"] = "csv.gz") -> None:
    """Write the three files; `read_dataset` gives back the same samples, bit for bit.

    Raises:
        InputError: the folder cannot be written.
    """
    folder = Path(folder)
    frames = []
    for run in dataset.runs:
        frame = pd.DataFrame(np.column_stack([run.t, run.states, run.inputs]), columns=["t", *STATES, *dataset.inputs])
        frame.insert(0, "trajectory", run.id)
        frames.append(frame)
    table = pd.concat(frames, ignore_index=True)
    description = {
        "name": dataset.name, "ship": "ship.toml", "dt": dataset.dt, "actuators": dataset.actuators, "source": dataset.source,
        "licence": dataset.licence, **({"simulation": dataset.simulation} if dataset.simulation else {}), "notes": list(dataset.notes),
        "runs": {run.id: run.meta for run in dataset.runs if run.meta},
    }  # fmt: skip
    try:
        folder.mkdir(parents=True, exist_ok=True)
        fresh = folder / f".trajectories.tmp.{format}"
        if format == "parquet":
            table.to_parquet(fresh, index=False)
        else:
            table.to_csv(fresh, index=False)
        os.replace(fresh, folder / f"trajectories.{format}")
        for name, text in (("dataset.toml", tomli_w.dumps(description)), ("ship.toml", dataset.ship.to_toml())):
            (folder / f".{name}.tmp").write_text(text)
            os.replace(folder / f".{name}.tmp", folder / name)
    except OSError as error:
        raise InputError(f"cannot write the data set to {folder}: {error.strerror}. Give a folder that can be written.") from None
