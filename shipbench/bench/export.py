"""Predictions of a study as tables or as one MATLAB file, so that every score can be computed again elsewhere."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..data.mat import cells, save_mat, struct_array
from ..errors import InputError
from ..records import Batch
from ..render.escaping import csv_text
from ..signals import STATES, UNITS
from ..storage import Frame, in_one_step, write_rows
from .results import Cell, read_predictions, read_truth
from .submissions import read_results


@dataclass(frozen=True, eq=False)
class Predicted:
    """Cell with its summary, its scored windows, and S (batch, K, 10), NaN where nothing was predicted; ed (batch,) [m]
    is the ED of the rows, NaN where it was not scored."""

    summary: dict[str, Any]
    batch: Batch
    S: np.ndarray
    ed: np.ndarray

    @property
    def t(self) -> np.ndarray:
        """Time after the start of the window, (K,) [s]."""
        return float(self.summary["dt"]) * np.arange(1, self.S.shape[1] + 1)


def is_results(path: Path) -> bool:
    """Whether a folder holds the results of `shipbench run`."""
    return (path / "rows.parquet").is_file() and (path / "summary.json").is_file()


def predictions(folder: Path) -> Iterator[Predicted]:
    """Cells of a study, one after another.

    Raises:
        InputError: the folder holds no results, or the saved predictions are missing or damaged.
    """
    results = read_results([folder])
    for summary in results.summaries:
        cell = Cell(summary["dataset"], summary["model"], summary["fold"], summary["seed"])
        try:
            batch, S = read_truth(folder, cell.dataset, cell.fold), read_predictions(folder, cell)
        except InputError as error:
            raise InputError(
                f"{folder}: the saved predictions of {cell.label} cannot be read ({error}). Give the folder that "
                "`shipbench run` wrote, whole."
            ) from None
        rows = results.rows
        own = rows[
            (rows.dataset == cell.dataset)
            & (rows.model == cell.model)
            & (rows.fold == cell.fold)
            & (rows.seed == cell.seed)
        ]
        ed = own.set_index("run")["ed"].reindex(list(batch.ids)).to_numpy(float)
        yield Predicted(summary, batch, np.full_like(batch.truth, np.nan) if S is None else S, ed)


def export_predictions(folder: Path, out: Path, format: str) -> list[Path]:
    """Write every prediction of the study in `folder`; returns the paths written.

    csv, parquet: into the folder `out`: `predictions`, one row per cell, window and time step with the prediction (`x`
    .. `F_s`), the truth (`true_x` ..) and the inputs held on the step that ends there; `starts`, the state s0 of every
    window; `summary.json`, which identifies every cell.
    mat: one file with the struct array `predictions`, one element per cell.

    Raises:
        InputError: as `predictions`; `out` cannot be written.
    """
    found = list(predictions(folder))
    if format == "mat":
        path = out if out.suffix == ".mat" else out / "predictions.mat"
        save_mat(path, {"predictions": struct_array([_struct(p) for p in found])})
        return [path]
    tables = {"predictions": _table(found), "starts": _starts(found)}
    try:
        for name, table in tables.items():
            _write(out / f"{name}.{format}", table)
        with in_one_step(out / "summary.json") as part:
            part.write_bytes((folder / "summary.json").read_bytes())
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror}. Give a folder that can be written.") from None
    return [*(out / f"{name}.{format}" for name in tables), out / "summary.json"]


def _write(path: Path, table: Frame) -> None:
    if path.suffix == ".parquet":
        write_rows(path, table)
        return
    words = [name for name in table if table[name].dtype.kind not in "biuf"]
    table = table.assign(**{name: table[name].map(csv_text) for name in words})
    with in_one_step(path) as part:
        table.to_csv(part, index=False)  # the shortest decimals that give the same number back


def _table(found: list[Predicted]) -> Frame:
    import pandas as pd

    frames = []
    for p in found:
        runs, steps = p.S.shape[:2]
        about = {key: p.summary[key] for key in ("dataset", "model", "fold", "seed")}
        windows = {
            "run": np.repeat(p.batch.ids, steps),
            "status": np.repeat(p.summary["run_status"], steps),
            "t": np.tile(p.t, runs),
        }
        values = np.concatenate([p.S, p.batch.truth, p.batch.U], axis=2).reshape(runs * steps, -1)
        columns = [*STATES, *(f"true_{name}" for name in STATES), *p.summary["inputs"]]
        frame = pd.concat([pd.DataFrame(windows), pd.DataFrame(values, columns=columns)], axis=1)
        for place, (key, value) in enumerate(about.items()):
            frame.insert(place, key, value)
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def _starts(found: list[Predicted]) -> Frame:
    import pandas as pd

    frames = {}
    for p in found:
        frame = pd.DataFrame(p.batch.s0, columns=list(STATES))
        for place, (key, value) in enumerate(
            (("dataset", p.summary["dataset"]), ("fold", p.summary["fold"]), ("run", list(p.batch.ids)))
        ):
            frame.insert(place, key, value)
        frames[p.summary["dataset"], p.summary["fold"]] = frame  # the same for every model
    return pd.concat(frames.values(), ignore_index=True)


def _struct(p: Predicted) -> dict[str, Any]:
    """Element of the MATLAB struct array."""
    inputs = p.summary["inputs"]
    return {
        **{key: p.summary[key] for key in ("dataset", "model", "fold", "seed", "dt", "status", "reason")},
        "run": cells(p.batch.ids), "run_status": cells(p.summary["run_status"]), "t": p.t,
        "s0": p.batch.s0, "inputs": p.batch.U, "truth": p.batch.truth, "S": p.S, "ED": p.ed,
        "names": {"states": cells(STATES), "inputs": cells(inputs)},
        "units": {"states": cells([UNITS[n] for n in STATES]), "inputs": cells([UNITS[n] for n in inputs])},
        "summary": json.dumps(p.summary, default=str),
    }  # fmt: skip
