"""Long table of a data set: one row per sample, with the columns trajectory, t, the states, the commands and the
environment channels."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from .errors import InputError
from .signals import ACTUATORS, COMMANDS, ENVIRONMENT, STATES

SIGNALS = (*STATES, *COMMANDS, *ENVIRONMENT)
KNOWN = ("trajectory", "t", *SIGNALS)
ACTUATOR_STATES = STATES[ACTUATORS]
MOTION_STATES = STATES[: ACTUATORS.start]
Columns = dict[str, np.ndarray]
"""Rows of a table: by name the values (rows,) of a column."""


def long_table(runs: Iterable[Any]) -> pd.DataFrame:
    """Samples of runs of the same inputs, one below the other."""
    frames = []
    for run in runs:
        frame = pd.DataFrame(
            np.column_stack([run.t, run.states, run.inputs]), columns=["t", *STATES, *run.inputs_names]
        )
        frame.insert(0, "trajectory", run.id)
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def check_columns(table: pd.DataFrame, where: object, first_row: int = 2) -> None:
    """Check that run names are whole blocks of rows and every signal is numeric, and make signals float, in place.

    Args:
        where: what messages call the table.
        first_row: number of its first row in messages; in a file the header is row 1.

    Raises:
        InputError: a row without a run name, rows of a run in two places, or a value that is no number.
    """
    nameless = (table["trajectory"].isna() | (table["trajectory"].astype(str).str.strip() == "")).to_numpy()
    if nameless.any():
        row = int(np.argmax(nameless)) + first_row
        raise InputError(
            f"{where}: row {row} has no run name in 'trajectory' ({nameless.sum()} such rows); every row needs one."
        )
    table["trajectory"] = table["trajectory"].astype(str)
    block = (table["trajectory"] != table["trajectory"].shift()).cumsum()
    starts = table["trajectory"].groupby(block).first()
    twice = starts[starts.duplicated()].tolist()
    if twice:
        name = twice[0]
        raise InputError(
            f"{where}: the rows of run '{name}' are in {int((starts == name).sum())} places; accepted: each run's "
            "rows together, in order of t. "
            "Sort the rows by trajectory and t, or give the second run its own name."
        )
    for column in ("t", *(c for c in SIGNALS if c in table)):
        if not pd.api.types.is_numeric_dtype(table[column]) or pd.api.types.is_bool_dtype(table[column]):
            unread = ~np.isfinite(np.asarray(pd.to_numeric(table[column], errors="coerce"), dtype=float))
            row = int(np.argmax(unread & table[column].notna().to_numpy()))
            value = str(table[column].iloc[row])[:80]
            raise InputError(
                f"{where}, row {row + first_row}: {column} is '{value}', not a number. Accepted: decimal numbers "
                "with a point."
            )
        table[column] = table[column].astype(float)


def complete_columns(table: pd.DataFrame, notes: list[str]) -> tuple[str, ...]:
    """Add missing optional columns (with a note), and return the names of the inputs."""
    for actuator, command in zip(ACTUATOR_STATES, COMMANDS, strict=True):
        if actuator not in table and command not in table:
            table[actuator] = table[command] = 0.0
            notes.append(f"{actuator} and {command} are not recorded: taken as zero")
        if actuator not in table:
            table[actuator] = table.groupby("trajectory")[command].shift(1).fillna(table[command])
            notes.append(f"{actuator} is not recorded: taken as the command of the sample before")
        if command not in table:
            table[command] = table[actuator]
            notes.append(f"{command} is not recorded: taken as {actuator}")
    wind = [c for c in ("wind_speed", "wind_from") if c in table]
    if len(wind) == 1:
        notes.append(f"{wind[0]} is recorded alone: no wind is used without both wind_speed and wind_from")
    return (*COMMANDS, *(c for c in ENVIRONMENT if c in table))


def blocks(table: pd.DataFrame) -> Iterator[tuple[str, Columns]]:
    """Name and rows of each run of a checked table; pandas takes ten times as long to select short runs."""
    names = table["trajectory"].to_numpy(dtype=object)
    columns = {str(name): table[name].to_numpy() for name in table if name != "trajectory"}
    starts = [0, *(np.flatnonzero(names[1:] != names[:-1]) + 1), len(names)]
    for start, stop in itertools.pairwise(starts):
        yield str(names[start]), {name: values[start:stop] for name, values in columns.items()}


def samples(rows: Columns, names: Sequence[str]) -> np.ndarray:
    """Columns as an array (samples, names), column by column in memory."""
    return np.array([rows[name] for name in names]).T


def samples_of(frame: Any) -> tuple[dict[str, tuple[np.ndarray, np.ndarray, np.ndarray]], tuple[str, ...], list[str]]:
    """Samples t, states and inputs of a long table by run; the names of the inputs; notes on columns that were filled
    in.

    Raises:
        InputError: no DataFrame, a column is missing or given twice, or as `check_columns`.
    """
    if not isinstance(frame, pd.DataFrame):
        raise InputError(
            f"frame is of the type {type(frame).__name__}; accepted: a pandas DataFrame with the columns "
            f"{', '.join(KNOWN[:8])}, ..."
        )
    names = [name for name in frame.columns if name in KNOWN]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise InputError(f"frame: {names.count(twice[0])} columns are '{twice[0]}'; accepted: one. Drop the others.")
    if missing := [name for name in ("trajectory", "t", *MOTION_STATES) if name not in names]:
        add = (
            ' Name the run: frame.assign(trajectory="run1").'
            if missing == ["trajectory"]
            else " Rename: frame.rename(columns={'theirs': 'ours'})."
        )
        raise InputError(
            f"frame lacks {', '.join(missing)}; accepted: the columns "
            f"{', '.join(('trajectory', 't', *MOTION_STATES))}.{add}"
        )
    if not len(frame):
        raise InputError("frame has no rows; accepted: one row per sample.")
    table, notes = frame[names].reset_index(drop=True).infer_objects(), list[str]()
    check_columns(table, "frame", first_row=0)
    inputs = complete_columns(table, notes)
    return (
        {name: (rows["t"].copy(), samples(rows, STATES), samples(rows, inputs)) for name, rows in blocks(table)},
        inputs,
        notes,
    )
