"""Data set in memory, read as its folder would be with further entries of dataset.toml."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pandas as pd

from ..records import Dataset, Run
from ..run_meta import RunMeta
from ..signals import STATES
from .corrections import correct_run, split_meta
from .files import Description, convert_table


def reread(dataset: Dataset, entries: dict[str, Any]) -> Dataset:
    """Data set with the corrections `entries` (keys of dataset.toml, as `shipbench data check` prints them) applied to
    its samples.

    Values are in standard units before: an entry such as `[units] x = "ft"` gives the unit of the numbers in memory.
    Pieces that cuts and gaps leave share a group, so that no fold parts them.

    Raises:
        InputError: an entry names no signal, unit or sign that is known, or leaves no two samples.
    """
    where = f"data set '{dataset.name}'"
    description = Description.model_validate(
        {"name": dataset.name, "dt": dataset.dt, "actuators": dataset.actuators} | entries
    )
    runs: list[Run] = []
    for run in dataset.runs:
        frame = pd.DataFrame(
            {"t": run.t}
            | dict(zip(STATES, run.states.T, strict=True))
            | dict(zip(run.inputs_names, run.inputs.T, strict=True))
        )
        convert_table(frame, description)
        own, meta = split_meta(run.id, description.runs.get(run.id, {}), where)
        parts = correct_run(frame, description, own, dataset.dt, f"{where}: run '{run.id}'")
        known = run.meta.as_dict() | ({"group": run.group} if len(parts) > 1 else {}) | meta
        shared = RunMeta.of(known, f"run '{run.id}'")
        names = [run.id] if len(parts) == 1 else [f"{run.id}#{i}" for i in range(1, len(parts) + 1)]
        runs += [
            Run(
                name,
                part["t"].to_numpy(),
                part[list(STATES)].to_numpy(),
                part[list(run.inputs_names)].to_numpy(),
                run.inputs_names,
                shared,
            )
            for name, part in zip(names, parts, strict=True)
        ]
    return replace(dataset, runs=tuple(runs), actuators=description.actuators)
