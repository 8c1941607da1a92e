"""Validation of a result folder before it is ranked beside others: types and values (see `entry`), and agreement of
rows and summaries."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..names import brief, shown
from ..regular_files import read_json
from ..storage import Frame, write_json, write_rows
from .entry import (
    TEXTS,
    TIMES,
    WHOLE,
    check_columns,
    check_entry,
    check_labels,
    check_scores,
    check_task_of,
    check_windows,
)
from .results import PROTOCOL, Cell, read_frame, truth_path, whole_status, window_table
from .task import make_task

_CELL = ["dataset", "model", "fold", "seed"]
_WINDOW = ["dataset", "fingerprint", "task", "fold", "run"]
_SHIP = ("ship", "ship_L", "ship_B", "dt", "inputs")
_GIVE = "Give the folder as `shipbench run` wrote it."


def check_submission(folder: Path, rows: Frame, summaries: Any) -> Frame:
    """Check rows and summaries for contradictions; return the rows without columns that no entry names.

    Raises:
        InputError: a column or key is missing or of another type, a row stands twice, the protocol or the task is not
            known here, rows and summaries do not belong together, a status is unknown, or a score is none.
    """

    def refuse(what: str, help_: str = _GIVE) -> InputError:
        return InputError(f"{folder}: {what.rstrip('.')}. {help_}")

    if not isinstance(summaries, list):
        raise refuse("summary.json is no list of entries")
    keys: dict[str, str] = {}  # of tasks that were looked at already: cells share them
    for summary in summaries:
        if isinstance(summary, dict) and isinstance(summary.get("protocol"), int) and summary["protocol"] != PROTOCOL:
            label = " ".join(shown(summary.get(key))[:80] for key in ("dataset", "model"))
            raise refuse(
                f"{label} is of protocol {summary['protocol']}, this version ranks protocol {PROTOCOL}",
                "Run the models again with this version.",
            )
        check_entry(summary, refuse)
        _check_task(summary, keys, refuse)
    if rows.empty and not summaries:
        return rows
    scores = list(dict.fromkeys(c["name"] for s in summaries for c in s["columns"]))
    check_columns(rows, lambda what: refuse(f"rows.parquet {what}"), TEXTS, WHOLE, (*scores, *TIMES))
    rows = rows[[name for name in rows.columns if name in {*TEXTS, *WHOLE, *scores, *TIMES, "group"}]]
    check_labels(rows, refuse)
    twice = rows[rows.duplicated([*_CELL, "run"])]
    if len(twice):
        first = twice.iloc[0]
        raise refuse(
            f"the row of {first['model']} on {first['dataset']}, fold {first['fold']}, seed {first['seed']}, run "
            f"{first['run']} stands twice"
        )
    cells = _cells(rows, summaries, refuse)
    check_scores(rows, dict.fromkeys(name for s in summaries for name in s["task"]["metrics"]), scores, refuse)
    for summary, part in cells:
        _check_cell(summary, part, scores, refuse)
    return rows


def _check_task(summary: dict[str, Any], keys: dict[str, str], refuse: Any) -> None:
    label = Cell(summary["dataset"], summary["model"], summary["fold"], summary["seed"]).label
    twin = (summary.get("simulated") or {}).get("fingerprint", "")
    known = [summary["task"], summary["fingerprint"], twin, summary["columns"], summary["dt"]]
    text = json.dumps(known, sort_keys=True)
    first = text not in keys
    try:
        if first:
            keys[text] = make_task(summary["task"]).key(summary["fingerprint"], twin)
    except InputError as error:
        raise refuse(
            f"{label}: this version does not know the task ({error})", "Update shipbench, or run the models again."
        ) from None
    if keys[text] != summary["task_key"]:
        raise refuse(
            f"{label}: unknown task '{shown(summary['task_key'])[:40]}'; the task that is written beside it has the "
            f"key '{keys[text]}'"
        )
    if first:
        check_task_of(summary, refuse)


def _cells(rows: Frame, summaries: Sequence[dict[str, Any]], refuse: Any) -> list[tuple[dict[str, Any], Frame]]:
    """Entries with their rows, in the order of their scored runs."""
    cells = {(s["dataset"], s["model"], s["fold"], s["seed"]): s for s in summaries}
    if len(cells) < len(summaries):
        raise refuse("two entries of summary.json are of the same data set, model, fold and seed")
    groups = {key: part for key, part in rows.groupby(_CELL, sort=False)}
    for key in sorted(groups.keys() - cells.keys()):
        raise refuse(f"rows of {Cell(*key).label} have no entry in summary.json")
    found = []
    for key, summary in cells.items():
        label, test = Cell(*key).label, summary["runs"]["test"]
        if key not in groups:
            raise refuse(f"{label} has an entry in summary.json and no rows")
        part = groups[key]
        for column, name in (("protocol", "protocol"), ("fingerprint", "fingerprint"), ("task", "task_key")):
            different = set(part[column]) - {summary[name]}
            if different:
                raise refuse(
                    f"{label}: {column} is {shown(sorted(different)[0])} in the rows and {shown(summary[name])} in "
                    "summary.json"
                )
        if sorted(part["run"]) != sorted(test):
            raise refuse(
                f"{label}: the runs of the rows are not the scored runs of summary.json ({len(part)} and {len(test)})"
            )
        found.append((summary, part.set_index("run").loc[test]))
    return found


def _check_cell(summary: dict[str, Any], part: Frame, scores: Iterable[str], refuse: Any) -> None:
    """Check that rows and entry agree, and that no column is filled that the entry does not name."""
    label = Cell(summary["dataset"], summary["model"], summary["fold"], summary["seed"]).label
    statuses = part["status"].tolist()
    if statuses != summary["run_status"]:
        raise refuse(f"{label}: the statuses of the rows are not those of run_status in summary.json")
    whole = whole_status(statuses)
    if whole != summary["status"] or ("failed" in statuses and whole != "failed"):
        raise refuse(f"{label}: status is '{summary['status']}' in summary.json; its rows make it '{whole}'")
    for name in (*TIMES, "fit_shared_by"):
        if (part[name] != summary[name]).any():
            raise refuse(f"{label}: {name} is {part[name].iloc[0]} in the rows and {summary[name]} in summary.json")
    named = {c["name"] for c in summary["columns"]}
    filled = [name for name in scores if name not in named and part[name].notna().any()]
    if filled:
        raise refuse(f"{label}: the rows hold {filled[0]}, which is not among its columns in summary.json")


def check_together(rows: Frame, summaries: Sequence[dict[str, Any]], sources: Sequence[Path]) -> None:
    """Check that studies agree on the same data: on the ship, the runs of a fold, and the origin of a window.

    Raises:
        InputError: they do not, or the same cell stands twice.
    """
    seen: dict[tuple[Any, ...], Path] = {}
    facts: dict[tuple[Any, ...], tuple[Any, Path]] = {}
    for summary, source in zip(summaries, sources, strict=True):
        data = (summary["dataset"], summary["fingerprint"])
        cell = (*data, summary["model"], summary["fold"], summary["seed"])
        if cell in seen:
            raise InputError(
                f"'{summary['model']}' on '{summary['dataset']}', fold {summary['fold']}, seed {summary['seed']} "
                f"stands in {seen[cell]} "
                f"and in {source}; leave one of them out."
            )
        seen[cell] = source
        for key in _SHIP:
            _agree(facts, (*data, key), summary[key], source)
        for side, runs in summary["runs"].items():
            _agree(facts, (*data, f"runs.{side} of fold {summary['fold']}", summary["task_key"]), runs, source)
    for name in ("parent", "kind", *(["group"] if "group" in rows else [])):
        told = rows[[*_WINDOW, name]].dropna().drop_duplicates()
        twice = told[told.duplicated(_WINDOW)]
        if len(twice):
            first = twice.iloc[0]
            raise InputError(
                f"{', '.join(map(str, dict.fromkeys(sources)))}: rows of run {first['run']} of "
                f"'{first['dataset']}', fold {first['fold']}, "
                f"differ in {name}. {_GIVE}"
            )


def _agree(facts: dict[tuple[Any, ...], tuple[Any, Path]], key: tuple[Any, ...], value: Any, source: Path) -> None:
    other, where = facts.setdefault(key, (value, source))
    if other != value:
        raise InputError(
            f"{source}: {key[2]} of '{key[0]}' is {shown(value)[:60]}; another entry, of {where}, says "
            f"{shown(other)[:60]} for the same data. {_GIVE}"
        )


def check_windows_of(folder: Path, windows: Frame, summaries: Sequence[dict[str, Any]]) -> None:
    """Check that windows.parquet is whole and has scored windows only: slices are cut by them.

    Raises:
        InputError: it is not, or has others.
    """

    def refuse(what: str) -> InputError:
        return InputError(f"{folder}: windows.parquet {what}. {_GIVE}")

    check_windows(windows, refuse)
    scored = {
        (s["dataset"], s["fingerprint"], s["task_key"], s["fold"], run) for s in summaries for run in s["runs"]["test"]
    }
    there = list(zip(*(windows[name] for name in _WINDOW), strict=True))
    if len(set(there)) < len(there):
        raise refuse("holds a window twice")
    if others := [key for key in there if key not in scored]:
        raise refuse(
            f"holds a window that was not scored: run {shown(others[0][-1])[:80]} of '{shown(others[0][0])[:80]}', "
            f"fold {others[0][3]}"
        )


@dataclass(frozen=True)
class Results:
    """Rows and summaries of one or more studies; `sources` are their folders, one per summary."""

    rows: Frame
    summaries: list[dict[str, Any]]
    sources: list[Path]

    def __repr__(self) -> str:
        models, sets = ({s[key]: None for s in self.summaries} for key in ("model", "dataset"))
        return brief(
            f"<Results: {len(self.rows)} rows, {len(self.summaries)} fits of {', '.join(models)} on {', '.join(sets)}>"
        )

    @cached_property
    def windows(self) -> Frame | None:
        """Motion of the true ship in every scored window, from all folders that hold it; None where none does."""
        import pandas as pd

        folders = {
            source: [s for s, at in zip(self.summaries, self.sources, strict=True) if at == source]
            for source in dict.fromkeys(self.sources)
        }
        found = [frame for folder, own in folders.items() if (frame := _read_windows(folder, own)) is not None]
        keys = ["dataset", "fingerprint", "task", "fold", "run"]
        return pd.concat(found, ignore_index=True).drop_duplicates(keys, ignore_index=True) if found else None


def read_results(folders: str | Path | Sequence[str | Path]) -> Results:
    """Read one or several result folders of `shipbench run`.

    Raises:
        InputError: a folder holds no results, they contradict themselves or one another (see `submissions`), or the
            same cell stands in two of them.
    """
    import pandas as pd

    frames, summaries, sources = [], [], []
    folders = [folders] if isinstance(folders, str | Path) else folders
    for folder in map(Path, folders):
        if missing := [name for name in ("rows.parquet", "summary.json") if not (folder / name).exists()]:
            raise InputError(
                f"{folder} holds no results: it has no {' and no '.join(missing)}. Give a folder that `shipbench "
                "run --out` wrote."
            )
        try:
            rows, found = read_frame(folder / "rows.parquet"), read_json(folder / "summary.json")
        except InputError as error:
            raise InputError(f"{folder} holds no results: {error}") from None
        frames.append(check_submission(folder, rows, found))
        summaries += found
        sources += [folder] * len(found)
    if not summaries:
        raise InputError(
            f"no finished cell in {', '.join(map(str, folders))}; run `shipbench run` (again, with --resume) first."
        )
    rows = pd.concat(frames, ignore_index=True)
    check_together(rows, summaries, sources)
    return Results(rows, summaries, sources)


def check_target(results: Results, folder: Path) -> None:
    """Refuse a folder for a submission whose own results it would replace.

    Raises:
        InputError: it is one of the folders that were read, or holds a study.
    """
    same = folder.resolve() in {source.resolve() for source in results.sources}
    if same or (folder / "study.json").exists() or (folder / "cells").exists():
        what = "is one of the result folders" if same else "holds the results of a study"
        raise InputError(f"--submission {folder} {what}, which it would replace. Give another folder.")


def write_submission(results: Results, folder: Path) -> None:
    """Write `rows.parquet`, `summary.json` and, where the windows are known, `windows.parquet`: the files from which a
    leaderboard is rendered.

    Raises:
        InputError: the folder cannot be written.
    """
    try:
        if results.windows is not None:
            write_rows(folder / "windows.parquet", results.windows)
        write_rows(folder / "rows.parquet", results.rows)
        write_json(folder / "summary.json", results.summaries)
    except OSError as error:
        raise InputError(
            f"cannot write to {folder}: {error.strerror}. Give a folder that can be written with --submission."
        ) from None


def _read_windows(folder: Path, summaries: list[dict[str, Any]]) -> Frame | None:
    """Windows table of a study (`windows.parquet`), made from the saved truth where it is missing; None without
    both."""
    path = folder / "windows.parquet"
    if path.exists():
        windows = read_frame(path)
    elif all(truth_path(folder, s["dataset"], s["fold"]).exists() for s in summaries):
        windows = window_table(folder, summaries)
    else:
        return None
    check_windows_of(folder, windows, summaries)
    return windows
