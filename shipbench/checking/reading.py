"""Tolerant reading of a data set's folder: errors at which the loader stops become findings here, all at once."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from ..data.base import load_dataset
from ..data.corrections import SIGNALS, correct_run, split_meta
from ..data.files import Description, convert_table, read_description, read_table, ship_file
from ..errors import InputError
from ..frames import complete_columns
from ..records import Dataset, Run
from ..run_meta import RunMeta
from ..ship import Ship
from ..signals import STATES
from ..toml_files import read_toml
from .finding import Curve, Finding, Picture, toml_line
from .recording import Recording
from .statistics import some
from .thresholds import THRESHOLDS

_SPLIT = toml_line({"gaps": "split"})


def read_recording(spec: str) -> tuple[Recording, list[Finding]]:
    """Recording of a registered data set, or of a folder read tolerantly, with the errors of its table.

    Raises:
        InputError: neither a known name nor a folder; its TOML files or its table cannot be read, or nothing usable is
            left of it.
    """
    folder = Path(spec)
    if not (folder / "dataset.toml").is_file():
        dataset = load_dataset(spec)
        return Recording(dataset, recorded=frozenset((*STATES, *dataset.inputs))), []
    description = read_description(folder / "dataset.toml")
    ship = Ship.load(ship_file(folder, description))
    table, where = read_table(folder, description)
    found: list[Finding] = []
    table = _clean(table, description, found)
    _possible(table, str(where))
    recorded = frozenset(c for c in SIGNALS if c in table)
    convert_table(table, description)
    notes = list(description.notes)
    inputs = complete_columns(table, notes)
    frames = {
        str(name): rows.drop(columns="trajectory").reset_index(drop=True)
        for name, rows in table.groupby("trajectory", sort=False)
    }
    ordered = {name: _ordered(name, rows, found) for name, rows in frames.items()}
    frames = {_part(name, number): part for name, parts in ordered.items() for number, part in enumerate(parts, 1)}
    owner = {_part(name, number): name for name, parts in ordered.items() for number in range(1, len(parts) + 1)}
    dt = _sample_time(frames, description, found)
    _missing_values(frames, description, recorded, found)
    _time_steps(frames, description, dt, found)
    turn = _turn(frames)
    wrapped = tuple(name for name, rows in frames.items() if np.any(np.abs(_heading_steps(rows)) > 0.5 * turn))
    runs, parent = _runs(frames, owner, description, inputs, dt, turn, str(where), found)
    if not runs:
        empty = [c for c in ("t", *SIGNALS) if c in table and not np.isfinite(table[c]).any()]
        without = f" Without a single number: {', '.join(empty)}." if empty else ""
        raise InputError(f"{where}: no run has two samples with all values; there is nothing to check.{without}")
    dataset = Dataset(
        name=description.name, ship=ship, dt=dt, runs=tuple(runs), actuators=description.actuators,
        source=description.source,
        licence=description.licence, simulation=description.simulation, notes=tuple(dict.fromkeys(notes)),
        derived=tuple(description.derived),
    )  # fmt: skip
    turned = description.velocities.startswith("earth") or bool(description.from_course)
    return Recording(dataset, read_toml(folder / "dataset.toml"), recorded, wrapped, parent, turned, turn), found


def _error(
    kind: str,
    text: str,
    line: str = "",
    todo: str = "",
    runs: tuple[str, ...] = (),
    channels: tuple[str, ...] = (),
    **figures: float,
) -> Finding:
    return Finding("reading", "error", kind, text, line, todo, channels, runs, dict(figures))


def _clean(table: pd.DataFrame, description: Description, found: list[Finding]) -> pd.DataFrame:
    """Rows with a name, and numbers or NaN in every signal."""
    nameless = (table["trajectory"].isna() | (table["trajectory"].astype(str).str.strip() == "")).to_numpy()
    if nameless.any():
        row = int(np.argmax(nameless)) + 2
        found.append(
            _error(
                "nameless rows",
                f"{nameless.sum()} rows have no run name, the first is row {row}.",
                todo="Name them or remove them.",
            )
        )
        table = table[~nameless]
    table = table.assign(trajectory=table["trajectory"].astype(str))
    for column in ("t", *(c for c in SIGNALS if c in table)):
        if not pd.api.types.is_numeric_dtype(table[column]):
            numbers = pd.to_numeric(table[column], errors="coerce")
            text = numbers.isna() & table[column].notna()
            if text.any():
                where, value = int(np.argmax(text.to_numpy())), table[column][text].iloc[0]
                message = (
                    f"{column} is text in {int(text.sum())} rows, the first is row {where + 2}: '{str(value)[:40]}'."
                )
                found.append(
                    _error(
                        "text",
                        message,
                        todo="Write decimal numbers with a point.",
                        channels=(column,),
                        rows=int(text.sum()),
                    )
                )
            table[column] = numbers
        table[column] = table[column].astype(float)
    unknown = sorted(set(description.runs) - set(table["trajectory"]))
    if unknown:
        found.append(
            _error(
                "unknown run",
                f"[runs] names {some(unknown)}, which the table does not hold.",
                todo="Remove it or correct the name.",
            )
        )
    block = (table["trajectory"] != table["trajectory"].shift()).cumsum()
    starts = table["trajectory"].groupby(block).first()
    twice = tuple(dict.fromkeys(starts[starts.duplicated()]))
    if twice:
        message = f"rows of {len(twice)} runs stand in several places: {some(twice)}."
        found.append(
            _error(
                "scattered rows",
                message,
                todo="Sort the rows by trajectory and t, or give each run its own name.",
                runs=twice,
            )
        )
    return table


def _possible(table: pd.DataFrame, where: str) -> None:
    """Refuse numbers that no sensor reads, at which arithmetic overflows."""
    accepted = THRESHOLDS.value("greatest_value")
    for column in ("t", *(c for c in SIGNALS if c in table)):
        values = table[column].to_numpy()
        most = float(np.max(np.abs(values[np.isfinite(values)]), initial=0.0))
        if most > accepted:
            message = f"{where}: {column} holds values up to {most:.3g}; accepted: up to {accepted:g}."
            raise InputError(f"{message} Leave the cell empty where the sensor gave nothing.")


def _part(name: str, number: int) -> str:
    return name if number == 1 else f"{name} (part {number})"


def _ordered(name: str, rows: pd.DataFrame, found: list[Finding]) -> list[pd.DataFrame]:
    """Rows in order of time, one per time; in parts where sorting would mix two recordings, because the clock was set
    back between them."""
    t = rows["t"].to_numpy()
    known = np.isfinite(t)
    steps = np.diff(t[known])
    back = np.flatnonzero(steps <= 0.0)
    if not len(back):
        return [rows.reset_index(drop=True)]
    k = int(back[0])
    message = (
        f"run '{name}': t does not grow in {len(back)} steps, the first from {t[known][k]:g} s to "
        f"{t[known][k + 1]:g} s."
    )
    todo = "Sort the rows, remove those that stand twice, or name two runs."
    parts = [rows.sort_values("t", kind="stable").drop_duplicates("t")]
    if np.min(np.diff(rows[known].drop_duplicates()["t"].sort_values().to_numpy()), initial=np.inf) < 0.5 * float(
        np.median(steps)
    ):
        parts = [
            part.drop_duplicates("t") for _, part in rows[known].groupby(np.cumsum(np.concatenate([[0], steps < 0.0])))
        ]
        message += (
            f" The clock was set back by {float(np.median(steps)) - steps[k]:.3g} s there: the same times "
            "stand with other values."
        )
        todo = "Give the rows after it a run name of their own."
    found.append(_error("time runs back", message, todo=todo, runs=(name,), steps=len(back)))
    return [part.reset_index(drop=True) for part in parts]


def _sample_time(frames: dict[str, pd.DataFrame], description: Description, found: list[Finding]) -> float:
    steps = np.concatenate([np.diff(rows["t"].dropna().to_numpy()) for rows in frames.values()])
    if not len(steps):
        return description.dt
    typical = float(np.median(steps))
    alike = float(np.mean(np.abs(steps - typical) < 1e-3 * typical))
    if abs(typical - description.dt) <= (1e-3 if alike > 0.5 else 0.1) * description.dt:
        return description.dt
    message = f"dt in dataset.toml is {description.dt:g} s; {alike:.1%} of the steps are {typical:.6g} s."
    found.append(_error("dt", message, toml_line({"dt": typical}), dt=typical))
    return float(f"{typical:.6g}")


def _missing_values(
    frames: dict[str, pd.DataFrame], description: Description, recorded: frozenset[str], found: list[Finding]
) -> None:
    """Report rows without all values: at the end of a run (a tail), or elsewhere."""
    if description.gaps == "split":
        return
    columns = ["t", *(c for c in SIGNALS if c in recorded)]
    for name, rows in frames.items():
        lacking = ~np.isfinite(rows[columns].to_numpy())
        bad = lacking.any(axis=1)
        if not bad.any():
            continue
        whole = int(bad[::-1].cumprod().sum())
        what = tuple(c for c, any_ in zip(columns, lacking.any(axis=0), strict=True) if any_)
        curve = Curve("values missing in the row", np.arange(len(rows), dtype=float), lacking.sum(axis=1).astype(float))
        picture = Picture(f"Missing values, run {name}", "row of the run", "missing values", (curve,))
        every = " (every column)" if lacking[bad].all() else f" ({some(what)})"
        if whole:
            last = rows["t"].to_numpy()[: len(rows) - whole]
            end = f" after t = {last[np.isfinite(last)][-1]:g} s" if np.isfinite(last).any() else ": the whole run"
            message = f"run '{name}' ends in {whole} of {len(rows)} rows without values{every}{end}."
            found.append(
                Finding("reading", "error", "NaN tail", message, _SPLIT, "", what, (name,), {"rows": whole}, picture)
            )
        inside = int(bad.sum()) - whole
        if inside:
            message = (
                f"run '{name}' lacks values in {inside} of {len(rows)} rows before its end{every}, the first "
                f"is its row {int(np.argmax(bad)) + 1}."
            )
            found.append(
                Finding(
                    "reading", "error", "missing values", message, _SPLIT, "", what, (name,), {"rows": inside}, picture
                )
            )


def _time_steps(frames: dict[str, pd.DataFrame], description: Description, dt: float, found: list[Finding]) -> None:
    """Report gaps, uneven steps, and runs whose time does not begin at 0."""
    late = {}
    for name, rows in frames.items():
        t = rows["t"].to_numpy()
        t, steps = t[1:], np.diff(t)  # a row without a time is reported with the missing values
        t, steps = t[np.isfinite(steps)], steps[np.isfinite(steps)]
        gaps = np.flatnonzero(steps > 1.5 * dt)
        if len(gaps) and description.gaps == "refuse":
            k = int(gaps[np.argmax(steps[gaps])])
            message = (
                f"run '{name}' has {len(gaps)} gaps in time, the longest from {t[k] - steps[k]:g} s to "
                f"{t[k]:g} s (dt = {dt:g} s)."
            )
            picture = Picture(f"Steps of time, run {name}", "time [s]", "step [s]", (Curve("step", t, steps),))
            found.append(
                Finding(
                    "reading",
                    "error",
                    "gap",
                    message,
                    _SPLIT,
                    "",
                    ("t",),
                    (name,),
                    {"gaps": len(gaps), "longest_s": steps[k]},
                    picture,
                )
            )
        uneven = np.abs(steps - dt) > 1e-3 * dt
        uneven[gaps] = False
        if uneven.any():
            most = float(np.max(np.abs(steps - dt)[uneven]))
            message = (
                f"run '{name}': {int(uneven.sum())} of {len(steps)} steps of t differ from {dt:g} s, by up to "
                f"{most:.2g} s."
            )
            found.append(
                _error(
                    "uneven time",
                    message,
                    todo="Resample the run to a uniform t.",
                    runs=(name,),
                    steps=int(uneven.sum()),
                )
            )
            start = rows["t"].to_numpy()[0]
            rows["t"] = (
                start + np.round((rows["t"].to_numpy() - start) / dt) * dt
            )  # near enough for the checks that follow
        first = rows["t"].to_numpy()[:1]
        if len(first) and abs(first[0]) > 0.5 * dt:
            late[name] = float(first[0])
    if late:
        message = (
            f"t does not begin at 0 in {len(late)} of {len(frames)} runs: "
            f"{some([f'{k} at {v:g} s' for k, v in late.items()])}."
        )
        found.append(
            Finding(
                "reading",
                "note",
                "late start",
                message,
                todo="Nothing: time is counted inside each run.",
                runs=tuple(late),
                channels=("t",),
            )
        )


def _turn(frames: dict[str, pd.DataFrame]) -> float:
    """Full turn in the unit of the recorded headings: 2 pi, or 360 where they jump by more than two turns (undeclared
    degrees)."""
    most = max((np.max(np.abs(_heading_steps(rows)), initial=0.0) for rows in frames.values()), default=0.0)
    return 360.0 if most > 4.0 * np.pi else 2.0 * np.pi


def _heading_steps(rows: pd.DataFrame) -> np.ndarray:
    return np.asarray(np.diff(rows["psi"].dropna().to_numpy()))


def _runs(
    frames: dict[str, pd.DataFrame], owner: dict[str, str], description: Description, inputs: tuple[str, ...],
    dt: float, turn: float, where: str,
    found: list[Finding],
) -> tuple[list[Run], dict[str, str]]:  # fmt: skip
    """Whole pieces of every run, and the run of each piece; owner: name of a frame -> the run's."""
    runs, parent = [], {}
    tolerant = description.model_copy(update={"gaps": "split"})
    for name, rows in frames.items():
        own, meta = split_meta(owner[name], description.runs.get(owner[name], {}), where)
        pieces = correct_run(rows, tolerant, own, dt, f"{where}: run '{name}'", turn)
        if not pieces:
            message = f"run '{name}' has no two samples in a row with all values ({len(rows)} rows)."
            found.append(_error("empty run", message, todo="Remove the run from the table.", runs=(name,)))
        for i, part in enumerate(pieces, 1):
            run = name if len(pieces) == 1 else f"{name}#{i}"
            runs.append(
                Run(
                    run,
                    part["t"].to_numpy(),
                    part[list(STATES)].to_numpy(),
                    part[list(inputs)].to_numpy(),
                    inputs,
                    RunMeta.of(meta, f"run '{run}'").in_group(owner[name]),
                )
            )
            parent[run] = owner[name]
    return runs, parent
