"""What a result folder must be before it is ranked beside others, and its scores computed again from the saved predictions."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from ..data.base import load_dataset
from ..errors import InputError, ShipbenchError
from .folds import make_folds, select_runs
from .results import PROTOCOL, STATUSES, Cell, Frame, Results, read_predictions, read_truth
from .scoring import divergence, measure
from .task import Task, make_task

IDENTITY = ("protocol", "dataset", "fingerprint", "task", "model", "fold", "seed", "run", "parent", "kind", "status", "reason")
_TIMES = ("fit_s", "fit_shared_by", "predict_s")
_SUMMARY = ("protocol", "dataset", "fingerprint", "task_key", "task", "model", "fold", "seed", "columns", "runs", "ship_L", "dt", "code", "machine")
_CELL = ["dataset", "model", "fold", "seed"]
TOLERANCE = 1e-9
"""Relative difference of a score that another processor's rounding can make."""


def check_submission(folder: Path, rows: Frame, summaries: list[dict[str, Any]]) -> None:
    """Refuse rows and summaries that contradict themselves or cannot be ranked here.

    Raises:
        InputError: a column or key is missing, a row stands twice, the protocol or the task is not known here, rows and summaries do not belong
            together, a status is unknown, or a scored row has no score.
    """

    def refuse(what: str, help_: str = "Give the folder as `shipbench run` wrote it.") -> InputError:
        return InputError(f"{folder}: {what}. {help_}")

    keys: dict[str, str] = {}  # of tasks that were looked at already: cells share them
    for summary in summaries:
        missing = [key for key in _SUMMARY if key not in summary]
        if missing:
            raise refuse(f"an entry of summary.json lacks {', '.join(missing)}")
        cell = Cell(summary["dataset"], summary["model"], summary["fold"], summary["seed"])
        if summary["protocol"] != PROTOCOL:
            raise refuse(
                f"{cell.label} is of protocol {summary['protocol']}, this version ranks protocol {PROTOCOL}",
                "Run the models again with this version.",
            )
        _check_task(summary, cell, keys, refuse)
    if rows.empty and not summaries:
        return
    wanted = [*IDENTITY, *(c["name"] for s in summaries for c in s["columns"]), *_TIMES]
    missing = [name for name in dict.fromkeys(wanted) if name not in rows]
    if missing:
        raise refuse(f"rows.parquet lacks the columns {', '.join(missing)}")
    twice = rows[rows.duplicated([*_CELL, "run"])]
    if len(twice):
        first = twice.iloc[0]
        raise refuse(
            f"the row of {first['model']} on {first['dataset']}, fold {first['fold']}, seed {first['seed']}, run {first['run']} stands twice"
        )
    _check_cells(rows, summaries, refuse)
    unknown = sorted(set(rows["status"]) - set(STATUSES))
    if unknown:
        raise refuse(f"unknown status '{unknown[0]}'; accepted: {', '.join(STATUSES)}")
    scored = rows["status"] == "ok"
    bad = rows[(scored & ~(rows["ed"] >= 0)) | (~scored & rows["ed"].notna())]
    if len(bad):
        first = bad.iloc[0]
        where = f"{first['model']} on {first['dataset']}, fold {first['fold']}, run {first['run']}"
        raise refuse(f"{where}: status '{first['status']}' with ED = {first['ed']}; a score of at least 0 goes with 'ok', none with all others")


def _check_task(summary: dict[str, Any], cell: Cell, keys: dict[str, str], refuse: Any) -> None:
    text = json.dumps([summary["task"], summary["fingerprint"]], sort_keys=True)
    try:
        key = keys[text] if text in keys else keys.setdefault(text, make_task(summary["task"]).key(summary["fingerprint"]))
    except InputError as error:
        raise refuse(f"{cell.label}: this version does not know the task ({error})", "Update shipbench, or run the models again.") from None
    if key != summary["task_key"]:
        raise refuse(f"{cell.label}: unknown task '{summary['task_key']}'; the task that is written beside it has the key '{key}'")


def _check_cells(rows: Frame, summaries: list[dict[str, Any]], refuse: Any) -> None:
    cells = {(s["dataset"], s["model"], s["fold"], s["seed"]): s for s in summaries}
    groups = {key: part for key, part in rows.groupby(_CELL, sort=False)}
    for key in sorted(groups.keys() - cells.keys()):
        raise refuse(f"rows of {Cell(*key).label} have no entry in summary.json")
    for key, summary in cells.items():
        label = Cell(*key).label
        if key not in groups:
            raise refuse(f"{label} has an entry in summary.json and no rows")
        part = groups[key]
        for column, name in (("protocol", "protocol"), ("fingerprint", "fingerprint"), ("task", "task_key")):
            found = set(part[column]) - {summary[name]}
            if found:
                raise refuse(f"{label}: {column} is {sorted(found)[0]} in the rows and {summary[name]} in summary.json")
        if sorted(part["run"]) != sorted(summary["runs"]["test"]):
            raise refuse(f"{label}: the runs of the rows are not the scored runs of summary.json ({len(part)} and {len(summary['runs']['test'])})")


def verify(results: Results) -> tuple[list[str], list[str]]:
    """Compute every score again from the saved predictions and truth.

    Returns:
        One line on each row that differs, and notes on what could not be checked (the truth, where the data set is not at hand).

    Raises:
        InputError: a folder has no saved predictions or truth, or they cannot be read.
    """
    differences: list[str] = []
    notes: dict[str, None] = {}
    wrong: dict[tuple[Path, str, int], list[str]] = {}
    rows = results.rows.set_index([*_CELL, "run"]).sort_index()
    for summary, source in zip(results.summaries, results.sources, strict=True):
        cell = Cell(summary["dataset"], summary["model"], summary["fold"], summary["seed"])
        own = rows.loc[(cell.dataset, cell.model, cell.fold, cell.seed)]
        if set(own["status"]) <= {"failed", "skipped"}:
            continue
        try:
            batch, S = read_truth(source, cell.dataset, cell.fold), read_predictions(source, cell)
        except InputError as error:
            raise InputError(f"{source}: the saved truth or predictions of {cell.label} cannot be read ({error}); --verify needs them.") from None
        if S is None:
            raise InputError(f"{source}: no saved predictions of {cell.label}; --verify needs the whole folder that `shipbench run` wrote.")
        if S.shape != batch.truth.shape:
            differences.append(f"{cell.label}: predictions of shape {S.shape} for a truth of shape {batch.truth.shape}.")
            continue
        at = (source, cell.dataset, cell.fold)
        if at not in wrong:
            wrong[at] = _compare_truth(summary, cell, batch, notes)
            differences += wrong[at]
        if not wrong[at]:  # scores against another truth say nothing
            differences += _compare(summary, cell, own.loc[list(batch.ids)], batch, S)
    return differences, list(notes)


def _compare(summary: dict[str, Any], cell: Cell, own: Frame, batch: Any, S: np.ndarray) -> list[str]:
    reasons = divergence(batch.truth, S, summary["dt"])
    ok = np.array([not reason for reason in reasons])
    again = measure(summary["task"]["metrics"], batch, S, L=summary["ship_L"], dt=summary["dt"], ok=ok)
    found = []
    for i, run in enumerate(batch.ids):
        status = "ok" if ok[i] else "diverged"
        if own["status"].iloc[i] != status:
            found.append(f"{cell.label}, run {run}: status is '{own['status'].iloc[i]}' in the rows, '{status}' from the predictions.")
            continue
        for name, values in again.items():
            said = float(own[name].iloc[i])
            if not np.isclose(said, values[i], rtol=TOLERANCE, atol=1e-12, equal_nan=True):
                found.append(f"{cell.label}, run {run}: {name} is {said:.10g} in the rows, {values[i]:.10g} from the predictions.")
    return found


def _compare_truth(summary: dict[str, Any], cell: Cell, batch: Any, notes: dict[str, None]) -> list[str]:
    """The saved truth against the data set itself, where it is at hand and the same."""
    task: Task = make_task(summary["task"])
    try:
        data, _ = select_runs(load_dataset(task.dataset), task)
    except ShipbenchError as error:
        notes[f"the truth of '{cell.dataset}' was not compared with the data set, which is not at hand ({str(error).splitlines()[0][:120]})"] = None
        return []
    if data.fingerprint != summary["fingerprint"]:
        notes[f"the truth of '{cell.dataset}' was not compared with the data set: the one at hand has another fingerprint"] = None
        return []
    theirs = make_folds(data, task)[cell.fold].test.batch(task.history(data.dt))
    same = theirs.ids == batch.ids and all(np.array_equal(getattr(theirs, n), getattr(batch, n)) for n in ("s0", "U", "truth"))
    return [] if same else [f"{cell.dataset} fold {cell.fold}: the saved truth is not that of the data set."]
