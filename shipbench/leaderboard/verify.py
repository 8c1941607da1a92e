"""Verification of a page by recomputation: scores and windows from the saved predictions and truth, the rest from the
data set where it is available."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..bench.cost import count_parameters
from ..bench.folds import Fold, make_folds, select_runs
from ..bench.regimes import COLUMNS as FEATURES
from ..bench.regimes import window_features
from ..bench.results import Cell, read_band, read_predictions, read_truth
from ..bench.scoring import divergence, measure
from ..bench.submissions import Results
from ..bench.task import make_task
from ..data.base import load_dataset
from ..errors import InputError, ShipbenchError
from ..names import shown
from ..predictors.base import make_predictor
from ..predictors.registered import PREDICTORS
from ..records import Batch, Dataset
from ..regular_files import read_json
from ..specs import parse_spec
from ..storage import Frame

TOLERANCE = 1e-9
"""Relative difference of a figure that rounding on another processor can make."""


def verify(results: Results) -> tuple[list[str], list[str]]:
    """Compute all values of a page again.

    Scores, statuses with their reasons and the windows come from the saved predictions and truth; the numbers of
    parameters from the saved models of shipbench's own kinds; truth, ship, runs and their names from the data set,
    where it is available.

    Returns:
        One line on each figure that differs, and notes on those that could not be computed again.

    Raises:
        InputError: a folder has no saved predictions or truth, or they cannot be read.
    """
    found = _Found()
    columns = ["dataset", "model", "fold", "seed"]
    rows = {key: part.set_index("run") for key, part in results.rows.groupby(columns, sort=False)}
    for summary, source in zip(results.summaries, results.sources, strict=True):
        cell = Cell(summary["dataset"], summary["model"], summary["fold"], summary["seed"])
        own = rows[cell.dataset, cell.model, cell.fold, cell.seed].loc[summary["runs"]["test"]]
        found.data_set(summary, cell, source, own)
        S, batch, W = _saved(source, cell)
        if summary["status"] in ("failed", "skipped"):
            if S is not None:
                found.differences.append(
                    f"{cell.label}: status is '{summary['status']}' in the rows, and there are predictions."
                )
            continue
        if S is None or batch is None:
            raise InputError(
                f"{source}: no saved predictions of {cell.label}; --verify needs the whole folder that `shipbench "
                "run` wrote."
            )
        if S.shape != batch.truth.shape or list(batch.ids) != summary["runs"]["test"]:
            found.differences.append(
                f"{cell.label}: predictions of shape {S.shape} for a truth of shape {batch.truth.shape}, or of "
                "other runs."
            )
            continue
        if found.truth(summary, cell, source, batch, results.windows):  # scores against another truth say nothing
            found.differences += _compare_scores(summary, cell, own, batch, S, W)
            found.parameters(summary, cell, source)
    return found.differences, list(found.notes)


def _saved(source: Path, cell: Cell) -> tuple[np.ndarray | None, Batch | None, np.ndarray | None]:
    """Predictions, truth and band of a cell; None without predictions, or without a band."""
    try:
        S = read_predictions(source, cell)
        return S, None if S is None else read_truth(source, cell.dataset, cell.fold), read_band(source, cell)
    except InputError as error:
        raise InputError(
            f"{source}: the saved truth or predictions of {cell.label} cannot be read: {error} --verify needs them."
        ) from None


def _compare_scores(
    summary: dict[str, Any], cell: Cell, own: Frame, batch: Batch, S: np.ndarray, W: np.ndarray | None
) -> list[str]:
    reasons = divergence(batch.truth, S, summary["dt"])
    skipped = (own["status"] == "skipped").to_numpy() & np.isnan(S).all(axis=(1, 2))
    ok = np.array([not reason for reason in reasons])
    W = W if summary["task"].get("bands") else None
    again = measure(summary["task"]["metrics"], batch, S, L=summary["ship_L"], dt=summary["dt"], ok=ok, W=W)
    found = []
    if summary["task"].get("bands") and W is None:
        found.append(f"{cell.label}: the rows hold scores of a band, and no band is saved.")
    for i, run in enumerate(batch.ids):
        if skipped[i]:  # nothing was predicted, and the reason follows from no prediction
            continue
        status, said = "ok" if ok[i] else "diverged", own["status"].iloc[i]
        if said != status:
            found.append(f"{cell.label}, run {run}: status is '{said}' in the rows, '{status}' from the predictions.")
            continue
        if own["reason"].iloc[i] != reasons[i]:
            found.append(
                f"{cell.label}, run {run}: the reason is '{shown(own['reason'].iloc[i])}' in the rows, "
                f"'{reasons[i]}' from the predictions."
            )
    for name, values in again.items():
        said = own[name].to_numpy(float)
        for i in np.flatnonzero(~np.isclose(said, values, rtol=TOLERANCE, atol=1e-12, equal_nan=True)).tolist():
            if skipped[i] or own["status"].iloc[i] == ("ok" if ok[i] else "diverged"):
                found.append(
                    f"{cell.label}, run {batch.ids[i]}: {name} is {said[i]:.10g} in the rows, {values[i]:.10g} from "
                    "the predictions."
                )
    return found


@dataclass(eq=False)
class _Found:
    """Differences, and values that could not be checked; every data set, truth and fold is checked once."""

    differences: list[str] = field(default_factory=list)
    notes: dict[str, None] = field(default_factory=dict)
    _sets: dict[tuple[str, str], tuple[Dataset, list[Fold]] | None] = field(default_factory=dict)
    _told: set[tuple[Any, ...]] = field(default_factory=set)
    _truths: dict[tuple[Path, str, int], bool] = field(default_factory=dict)

    def _differs(self, what: str, said: Any, is_: Any) -> None:
        """Add one line where two values differ, once."""
        if said != is_ and (what, str(said)) not in self._told:
            self._told.add((what, str(said)))
            self.differences.append(f"{what} is {shown(said)[:80]} in summary.json, {shown(is_)[:80]} in the data set.")

    def _set(self, summary: dict[str, Any]) -> tuple[Dataset, list[Fold]] | None:
        """Data set of a task with its folds, or None and a note where it is not available or another one."""
        task, name = make_task(summary["task"]), summary["dataset"]
        key = (task.dataset, summary["task_key"])
        if key not in self._sets:
            self._sets[key] = None
            why = "the one at hand has another fingerprint"
            try:
                data, _ = select_runs(load_dataset(task.dataset), task)
                if data.fingerprint == summary["fingerprint"]:
                    self._sets[key] = data, make_folds(data, task)
            except ShipbenchError as error:
                why = f"which is not at hand ({shown(error).splitlines()[0][:120]})"
            if self._sets[key] is None:
                link = " " if why.startswith("which") else ": "
                self.notes[
                    f"the truth of '{name}' was not compared with the data set{',' if link == ' ' else ''}{link}{why}"
                ] = None
        return self._sets[key]

    def data_set(self, summary: dict[str, Any], cell: Cell, source: Path, own: Frame) -> None:
        """Compare ship, runs of the fold, and group, parent and kind of its windows with the data set."""
        found = self._set(summary)
        if found is None:
            return
        data, folds = found
        ship = {
            "dataset": data.name,
            "ship": data.ship.name,
            "ship_L": data.ship.L,
            "ship_B": data.ship.B,
            "dt": data.dt,
            "inputs": [*data.inputs],
        }
        for key, value in ship.items():
            self._differs(f"{source}: {key} of '{cell.dataset}'", summary[key], value)
        for key, value in (("source", data.source), ("licence", data.licence)):
            if summary[key] != value:
                self.notes[f"{key} of '{cell.dataset}' is other text in the results than in the data set"] = None
        if cell.fold >= len(folds):
            self._differs(f"{source}: the number of folds of '{cell.dataset}'", f"at least {cell.fold + 1}", len(folds))
            return
        fold = folds[cell.fold]
        for side, part in (("train", fold.train), ("valid", fold.valid), ("test", fold.test)):
            ids = [run.id for run in part.runs] if part else []
            self._differs(f"{source}: runs.{side} of '{cell.dataset}', fold {cell.fold},", summary["runs"][side], ids)
        for run in fold.test.runs:
            if run.id not in own.index:
                continue  # said above
            for name, value in (
                ("parent", run.parent),
                ("kind", run.kind),
                ("group", run.group),
            ):
                said = own[name].get(run.id) if name in own else None
                if not isinstance(said, str):  # rows without a group are counted by their parent
                    said = own["parent"].get(run.id)
                if said != value:
                    self.differences.append(
                        f"{cell.label}, run {run.id}: {name} is '{said}' in the rows, '{value}' in the data set."
                    )

    def truth(self, summary: dict[str, Any], cell: Cell, source: Path, batch: Batch, windows: Frame | None) -> bool:
        """Whether the saved truth is that of the data set, and windows.parquet agrees with it; once for each fold of a
        folder."""
        key = (source, cell.dataset, cell.fold)
        if key not in self._truths:
            known = self._set(summary)
            same = (
                known is None
                or cell.fold >= len(known[1])
                or _same_truth(known[1][cell.fold], make_task(summary["task"]).history(summary["dt"]), batch)
            )
            if not same:
                self.differences.append(
                    f"{cell.dataset} fold {cell.fold}: the saved truth is not that of the data set."
                )
            elif windows is not None:
                self._windows(summary, cell, batch, windows)
            self._truths[key] = same
        return self._truths[key]

    def _windows(self, summary: dict[str, Any], cell: Cell, batch: Batch, windows: Frame) -> None:
        mine = (
            windows["dataset"].eq(cell.dataset)
            & windows["fingerprint"].eq(summary["fingerprint"])
            & windows["task"].eq(summary["task_key"])
        )
        there = windows[mine & windows["fold"].eq(cell.fold)].set_index("run").reindex(list(batch.ids))
        again = window_features(batch, summary["ship_L"])
        for name in FEATURES:
            said = there[name].to_numpy(float)
            for i in np.flatnonzero(~np.isclose(said, again[name], rtol=TOLERANCE, atol=1e-12, equal_nan=True)):
                where = f"{cell.dataset} fold {cell.fold}, run {batch.ids[i]}"
                self.differences.append(
                    f"{where}: {name} is {said[i]:.10g} in windows.parquet, {again[name][i]:.10g} from the truth."
                )

    def parameters(self, summary: dict[str, Any], cell: Cell, source: Path) -> None:
        """Compare the number of parameters with the saved model, of shipbench's own kinds: no foreign code is
        imported."""
        if summary.get("parameters") is None:
            return
        folder = source / cell.folder / "model"
        try:
            if read_json(folder / "model.json").get("predictor") not in PREDICTORS.built_in():
                raise InputError("another kind")
            number = count_parameters(make_predictor(parse_spec(str(folder))))
        except (ShipbenchError, AttributeError) as error:
            self.notes[f"the number of parameters of '{cell.model}' cannot be computed again: {error}"] = None
            return
        if number != summary["parameters"]:
            self.differences.append(
                f"{cell.label}: parameters is {summary['parameters']} in summary.json, {number} in the saved model."
            )


def _same_truth(fold: Fold, history: int, batch: Batch) -> bool:
    theirs = fold.test.batch(history)
    return theirs.ids == batch.ids and all(
        np.array_equal(getattr(theirs, n), getattr(batch, n)) for n in ("s0", "U", "truth")
    )
