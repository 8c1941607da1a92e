"""Data set on disk: trajectories, dataset.toml and ship.toml in one folder (docs/formats.md)."""

from __future__ import annotations

import difflib
import os
from collections.abc import Sequence
from pathlib import Path, PurePosixPath, PureWindowsPath
from typing import Any, Literal

import numpy as np
import pandas as pd
import tomli_w
from pydantic import ConfigDict, Field, ValidationError

from ..errors import InputError, unknown_name
from ..frames import (
    KNOWN,
    MOTION_STATES,
    SIGNALS,
    Columns,
    blocks,
    check_columns,
    complete_columns,
    long_table,
    samples,
)
from ..names import check_name
from ..records import Dataset, Run
from ..run_meta import RunMeta
from ..ship import Ship
from ..signals import COMMANDS, STATES, wrap_angle
from ..storage import in_one_step, write_text
from ..toml_files import Number, fault, read_toml
from ..units import sign_factor, unit_factor
from .corrections import Corrections, check_names, continuous, correct_run, split_meta, to_ned
from .trajectories import read_trajectories

TABLES = ("trajectories.parquet", "trajectories.csv.gz", "trajectories.csv")
BEFORE_CHECK = "dataset.toml.before-check"
"""Beginning of the names under which `data check --apply` keeps the old dataset.toml."""
_SHOWN = 60
"""Most columns that a message lists."""


class Description(Corrections):
    """Content of dataset.toml; an unknown key is an error, never ignored."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    name: str
    ship: str = "ship.toml"
    dt: Number = Field(gt=0)
    actuators: Literal["measured", "commanded"]
    source: str = ""
    licence: str = ""
    simulation: str | None = None
    notes: list[str] = Field(default_factory=list)
    derived: list[Literal["u", "v", "r"]] = Field(default_factory=list)
    from_course: list[Literal["u", "v"]] = Field(default_factory=list)
    units: dict[str, str] = Field(default_factory=dict)
    signs: dict[str, str] = Field(default_factory=dict)
    columns: dict[str, str] = Field(default_factory=dict)
    runs: dict[str, dict[str, Any]] = Field(default_factory=dict)


def read_dataset(folder: str | Path) -> Dataset:
    """Read a folder of the contract's format into SI and standard signs.

    A unit or sign given for an actuator also holds for its command, unless the command has its own entry. Columns that
    are not signals are ignored.

    Raises:
        InputError: a file or column is missing, a value is not a finite number, time is not uniform, or a key, unit or
            sign is unknown.
    """
    folder = Path(folder)
    description = read_description(folder / "dataset.toml")
    ship = Ship.load(ship_file(folder, description))
    table, where = read_table(folder, description)
    notes = list(description.notes)
    check_columns(table, where)
    convert_table(
        table, description
    )  # before columns are filled in: what is copied from another column is in our units already
    inputs = complete_columns(table, notes)
    names = table["trajectory"].unique()
    unknown = set(description.runs) - set(names)
    if unknown:
        raise unknown_name(f"run in [runs] of {folder / 'dataset.toml'}", sorted(unknown)[0], names)
    runs = tuple(run for name, rows in blocks(table) for run in _runs(name, rows, inputs, description, where))
    return Dataset(
        name=description.name, ship=ship, dt=description.dt, runs=runs, actuators=description.actuators,
        source=description.source,
        licence=description.licence, simulation=description.simulation, notes=tuple(dict.fromkeys(notes)),
        derived=tuple(description.derived),
    )  # fmt: skip


def read_description(path: Path) -> Description:
    """Validated content of dataset.toml.

    Raises:
        InputError: the file is missing, is not TOML, or has a missing, unknown or impossible entry.
    """
    return parse_description(read_toml(path), path)


def parse_description(data: dict[str, Any], path: Path) -> Description:
    """Validated content of a dataset.toml; `path` is named in messages.

    Raises:
        InputError: an entry is missing, unknown or impossible.
    """
    try:
        description = Description.model_validate(data)
    except ValidationError as error:
        place, _, wrong = fault(error)
        raise InputError(
            f"{path}: {'.'.join(place)}: {wrong}. Accepted keys: {', '.join(Description.model_fields)}."
        ) from None
    check_name(description.name, f"{path}: name")
    check_names(description, description.runs, path.name)
    return description


def ship_file(folder: Path, description: Description) -> Path:
    """Path of the ship's file, which lies in the folder of the data set.

    Raises:
        InputError: the description names a file elsewhere.
    """
    given = description.ship
    if any(
        pure(given).is_absolute() or pure(given).drive or ".." in pure(given).parts
        for pure in (PurePosixPath, PureWindowsPath)
    ):
        raise InputError(
            f"{folder / 'dataset.toml'}: ship = {given!r} lies outside the folder of the data set; accepted: a file "
            'in it, such as "ship.toml". '
            "Copy the ship's file there."
        )
    return folder / given


def read_table(folder: Path, description: Description) -> tuple[pd.DataFrame, Path]:
    """Known columns of the table, under their standard names, and the table's path.

    Raises:
        InputError: no table or several, a required column is missing, two columns are one signal, or as
            `read_trajectories`.
    """
    found = [folder / name for name in TABLES if os.path.lexists(folder / name)]
    if not found:
        raise InputError(f"folder {folder} has no trajectories; accepted: {', '.join(TABLES)}.")
    if len(found) > 1:
        raise InputError(
            f"folder {folder} has {' and '.join(p.name for p in found)}; accepted: one table. Remove the others."
        )
    path, ours = found[0], description.columns
    ids = next((theirs for theirs, signal in ours.items() if signal == "trajectory"), "trajectory")
    table = read_trajectories(path, ids, lambda names: _needed(list(names), ours, path))
    return table.rename(columns=ours), path


def _needed(names: list[str], columns: dict[str, str], where: Path) -> list[str]:
    """Columns of the table that are known, or become so by [columns]."""
    for theirs, ours in columns.items():
        if theirs not in names:
            raise unknown_name(f"column of {where.name} in [columns] of dataset.toml:", theirs, names)
        if ours not in KNOWN:
            raise unknown_name(f"signal for '{theirs}' in [columns] of dataset.toml:", ours, KNOWN)
    renamed = [columns.get(name, name) for name in names]
    for name in KNOWN:
        if renamed.count(name) > 1 or (
            name in renamed and f"{name}.1" in renamed
        ):  # pandas calls a header's second "x" "x.1"
            raise InputError(
                f"{where}: two columns are '{name}'; accepted: one. Remove one, or correct [columns] in dataset.toml."
            )
    for column in ("trajectory", "t", *MOTION_STATES):
        if column not in renamed:
            near = difflib.get_close_matches(column.lower(), renamed, n=1, cutoff=0.5)
            hint = (
                f" Did you mean '{near[0]}'? Then write [columns] {near[0]} = \"{column}\" in dataset.toml."
                if near
                else ""
            )
            shown = renamed if len(renamed) <= _SHOWN else [*renamed[:_SHOWN], f"and {len(renamed) - _SHOWN} more"]
            raise InputError(f"{where}: column '{column}' is missing.{hint} Found: {', '.join(shown)}.")
    return [name for name, signal in zip(names, renamed, strict=True) if signal in KNOWN]


def convert_table(table: pd.DataFrame, description: Description) -> None:
    """Convert units, signs and frame of all columns to the standard ones, in place.

    Raises:
        InputError: an entry names no signal, or a unit or sign that is not known.
    """
    from_is_to = description.signs.get("wind_from") == "to"
    signs = {signal: word for signal, word in description.signs.items() if not (signal == "wind_from" and from_is_to)}
    for entries, factor in ((description.units, unit_factor), (signs, sign_factor)):
        for signal, word in entries.items():
            if signal not in SIGNALS:
                raise unknown_name("signal in [units] or [signs]", signal, SIGNALS)
            command = signal + "_c"
            targets = [signal, *([command] if command in COMMANDS and command not in entries else [])]
            for target in targets:
                if target in table:
                    table[target] *= factor(signal, word)
    if from_is_to and "wind_from" in table:
        table["wind_from"] = wrap_angle(table["wind_from"] + np.pi)
    to_ned(table, description)


def _runs(name: str, rows: Columns, inputs: tuple[str, ...], description: Description, where: Path) -> list[Run]:
    """Run, or the pieces that its cuts and gaps leave: these share a group, so that no fold parts them."""
    if len(rows["t"]) < 2:
        raise InputError(f"{where}: run '{name}' has {len(rows['t'])} sample; at least 2 are needed.")
    own, meta = split_meta(name, description.runs.get(name, {}), str(where))
    parts: Sequence[Columns]
    if description.changes_samples or own.model_fields_set:
        corrected = correct_run(pd.DataFrame(rows), description, own, description.dt, f"{where}: run '{name}'")
        parts = [{str(column): part[column].to_numpy() for column in part} for part in corrected]
    else:
        parts = [rows | {"psi": continuous(rows["psi"])}]
    if not parts:
        raise InputError(f"{where}: run '{name}': its cuts, gaps and delays leave no two samples. Remove the run.")
    known = RunMeta.of(meta, f"{where.with_name('dataset.toml')}: [runs.{name}]")
    if len(parts) == 1:
        return [_run(name, parts[0], inputs, description, where, known)]
    shared = known.in_group(name)
    return [_run(f"{name}#{i}", part, inputs, description, where, shared) for i, part in enumerate(parts, 1)]


def _run(
    name: str, rows: Columns, inputs: tuple[str, ...], description: Description, where: Path, meta: RunMeta
) -> Run:
    t = rows["t"]
    steps = np.diff(t)
    wrong = np.flatnonzero(~(np.abs(steps - description.dt) <= 1e-3 * description.dt))
    if len(wrong):
        k = int(wrong[0])
        raise InputError(
            f"{where}: run '{name}': t goes from {t[k]:g} s to {t[k + 1]:g} s, dt in dataset.toml is "
            f"{description.dt:g} s ({len(wrong)} such steps). "
            'Time must be uniform inside a run and its rows in order: resample, or write gaps = "split" into '
            "dataset.toml."
        )
    return Run(name, t.copy(), samples(rows, STATES), samples(rows, inputs), inputs, meta)


def write_dataset(dataset: Dataset, folder: str | Path, format: Literal["csv.gz", "csv", "parquet"] = "csv.gz") -> None:
    """Write the three files; `read_dataset` reads the same samples back, bit for bit.

    Raises:
        InputError: the folder cannot be written, or metadata cannot be expressed in TOML.
    """
    if (name := f"trajectories.{format}") not in TABLES:
        raise InputError(f"format = '{format}'; accepted: csv.gz, csv or parquet.")
    folder = Path(folder)
    table = long_table(dataset.runs)
    description = {
        "name": dataset.name, "ship": "ship.toml", "dt": dataset.dt, "actuators": dataset.actuators,
        "source": dataset.source,
        "licence": dataset.licence, **({"simulation": dataset.simulation} if dataset.simulation else {}),
        "notes": list(dataset.notes),
        **({"derived": list(dataset.derived)} if dataset.derived else {}),
        "runs": {run.id: known for run in dataset.runs if (known := run.meta.as_dict())},
    }  # fmt: skip
    try:
        texts = {"dataset.toml": tomli_w.dumps(description), "ship.toml": dataset.ship.to_toml()}
    except TypeError as error:
        accepted = "Metadata may hold text, numbers, booleans, lists and tables."
        raise InputError(f"data set '{dataset.name}' cannot be written: {error}. {accepted}") from None
    try:
        with in_one_step(folder / name, suffix=f".{format}") as fresh:
            if format == "parquet":
                table.to_parquet(fresh, index=False)
            else:
                table.to_csv(fresh, index=False)
        for file, text in texts.items():
            write_text(folder / file, text)
        for other in set(TABLES) - {name}:  # an earlier table in another format would contradict this one
            (folder / other).unlink(missing_ok=True)
    except OSError as error:
        raise InputError(
            f"cannot write the data set to {folder}: {error.strerror}. Give a folder that can be written."
        ) from None
