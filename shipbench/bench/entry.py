"""Schema of one entry of summary.json and of the columns of rows.parquet and windows.parquet: types and values."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..errors import InputError
from ..metrics.base import METRICS
from ..metrics.trial_indices import COLUMNS as TRIAL_COLUMNS
from ..names import LONGEST_LABEL, check_label, check_name, check_run, shown
from ..storage import Frame
from .regimes import COLUMNS as FEATURES
from .results import STATUSES
from .scoring import BAND, DIVERGED_DISTANCE, HORIZONS_S, columns
from .task import MEASURED, make_task

Refuse = Callable[[str], InputError]
"""Function that makes the error from its message; it adds the folder."""
Status = Literal["ok", "diverged", "failed", "skipped"]
LARGEST = 1e100
"""Largest size of any number: squares of larger ones, and their sums, are not finite."""
Seconds = Annotated[float, Field(ge=0, le=LARGEST)]
Size = Annotated[float, Field(gt=0, le=LARGEST)]

TEXTS = ("dataset", "fingerprint", "task", "model", "run", "parent", "kind", "status", "reason")
WHOLE = ("protocol", "fold", "seed", "fit_shared_by")
TIMES = ("fit_s", "predict_s")
_TASK_KEYS = ("dataset", "models", "horizon_s", "history_s", "folds", "split", "seeds", "metrics")
_SIGNED = frozenset(c.name for c in TRIAL_COLUMNS)
"""Metrics that may be negative. They and cVDM are undefined in some windows."""
_UNDEFINED = _SIGNED | {"cvdm"}
_MOST_STEPS = 10**8
"""Most time steps of a window; with more, dt is no sample time."""


class _Part(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow", allow_inf_nan=False, frozen=True)


class _Column(_Part):
    name: str
    label: str
    unit: str


class _Code(_Part):
    shipbench: str
    source: str
    git: str


class _Machine(_Part):
    cpus: int
    python: str
    torch: str


class _Runs(_Part):
    train: list[str]
    valid: list[str]
    test: list[str] = Field(min_length=1)


class _Twin(_Part):
    fingerprint: str


class Entry(_Part):
    """Cell of summary.json: the keys that pages and checks read. Other keys are kept but not shown."""

    protocol: int
    dataset: str
    fingerprint: str
    task_key: str
    task: dict[str, Any]
    model: str
    fold: int = Field(ge=0)
    seed: int
    ship: str
    ship_L: Size
    ship_B: Size
    dt: Size
    inputs: list[str]
    columns: list[_Column]
    notes: list[str]
    source: str
    licence: str
    command: str
    finished: str
    runs: _Runs
    status: Status
    reason: str
    run_status: list[Status]
    fit_s: Seconds
    fit_shared_by: int = Field(ge=1)
    predict_s: Seconds
    parameters: int | None = Field(None, ge=0)
    train_on: str = MEASURED
    simulated: _Twin | None = None
    code: _Code
    machine: _Machine


def check_entry(summary: Any, refuse: Refuse) -> None:
    """Check an entry: no key is missing, every value has its type and lies in its range.

    Raises:
        InputError: it does not.
    """
    try:
        entry = Entry.model_validate(summary)
    except ValidationError as error:
        missing = [".".join(map(str, e["loc"])) for e in error.errors() if e["type"] == "missing"]
        if missing:
            raise refuse(f"an entry of summary.json lacks {', '.join(missing)}") from None
        first = error.errors()[0]
        key = ".".join(map(str, first["loc"])) or "an entry"
        raise refuse(
            f"summary.json: {key} = {shown(repr(first['input']))[:60]}; accepted: {_accepted(first['msg'])}"
        ) from None
    try:
        check_name(entry.dataset, "dataset")
        check_label(entry.model, "model", LONGEST_LABEL)
        for run in (*entry.runs.train, *entry.runs.valid, *entry.runs.test):
            check_run(run, "run")
    except InputError as error:
        raise refuse(f"summary.json: {error}") from None
    if len(entry.run_status) != len(entry.runs.test):
        raise refuse(
            f"summary.json: {len(entry.run_status)} statuses in run_status for {len(entry.runs.test)} scored runs"
        )


def _accepted(message: str) -> str:
    """Accepted value in pydantic's "Input should be a valid string": "a valid string"."""
    return message.removeprefix("Input should be ")


def check_task_of(summary: dict[str, Any], refuse: Refuse) -> None:
    """Check the task of an entry: no key is missing, and the columns are those of its metrics.

    Raises:
        InputError: it does not pass.
    """
    if missing := [key for key in _TASK_KEYS if key not in summary["task"]]:
        raise refuse(f"summary.json: task lacks {', '.join(missing)}")
    task = make_task(summary["task"])
    dt = summary["dt"]
    if not 0.5 <= task.horizon_s / dt <= _MOST_STEPS:
        raise refuse(
            f"summary.json: dt = {dt:g} s for a horizon of {task.horizon_s:g} s; accepted: the sample time of the data"
        )
    expected = [asdict(c) for c in columns(task.metrics, task.horizon_s, dt, task.bands)]
    if [dict(c) for c in summary["columns"]] != expected:
        raise refuse("summary.json: columns are not those of task.metrics: " + ", ".join(c["name"] for c in expected))


def check_columns(
    rows: Frame, refuse: Refuse, texts: Iterable[str], whole: Iterable[str], numbers: Iterable[str]
) -> None:
    """Check that a table has each of these columns once, with its type.

    Raises:
        InputError: it has not.
    """
    from pandas.api import types

    kinds: list[tuple[Iterable[str], Callable[[Any], bool], str]] = [
        (texts, lambda values: types.infer_dtype(values, skipna=False) == "string", "text in every row"),
        (whole, types.is_integer_dtype, "whole numbers"),
        (numbers, lambda values: types.is_numeric_dtype(values) and not types.is_bool_dtype(values), "numbers"),
    ]
    names = list(rows.columns)
    kinds = [(tuple(group), is_kind, accepted) for group, is_kind, accepted in kinds]
    if missing := [name for group, _, _ in kinds for name in group if name not in names]:
        raise refuse(f"lacks the columns {', '.join(missing)}")
    if twice := sorted({str(name) for name in names if names.count(name) > 1}):
        raise refuse(f"has the column '{twice[0]}' twice")
    for group, is_kind, accepted in kinds:
        for name in group:
            if len(rows) and not is_kind(rows[name]):
                raise refuse(f"column '{name}' is of type {rows[name].dtype}; accepted: {accepted}")


def check_labels(rows: Frame, refuse: Refuse) -> None:
    """Check that names may stand in a table (see `names`).

    Raises:
        InputError: one may not.
    """
    try:
        for name in ("run", "parent", "kind", *(["group"] if "group" in rows else [])):
            for value in rows[name].dropna().unique():
                check_run(value, name)
    except InputError as error:
        raise refuse(f"rows.parquet: {error}") from None


def check_scores(rows: Frame, metrics: Iterable[str], scores: Iterable[str], refuse: Refuse) -> None:
    """Check scores: finite, not negative, present in every scored row and in no other.

    Args:
        rows: of one folder.
        metrics: the names of the metrics behind the columns `scores`.

    Raises:
        InputError: a score does not pass.
    """
    unknown = sorted(set(rows["status"]) - set(STATUSES))
    if unknown:
        raise refuse(f"unknown status '{shown(unknown[0])[:40]}'; accepted: {', '.join(STATUSES)}")
    scored = (rows["status"] == "ok").to_numpy()
    own = {c.name for name in metrics if name in METRICS.built_in() for c in METRICS.get(name).columns} | {
        f"ed_at_{h:g}s" for h in HORIZONS_S
    }
    for name in scores:
        values = rows[name].to_numpy(float, na_value=np.nan)
        label, known = "ED" if name == "ed" else name, np.isfinite(values)
        bad = (np.abs(values) > LARGEST) | (~scored & ~np.isnan(values))
        if (name in own and name not in _SIGNED) or name.startswith(BAND):
            bad |= scored & (values < 0)
        if name in own and name not in _UNDEFINED:
            bad |= scored & ~known
        if name == "ed":
            bad |= scored & ~(values <= DIVERGED_DISTANCE)
        if bad.any():
            first = rows.iloc[int(np.argmax(bad))]
            where = f"{first['model']} on {first['dataset']}, fold {first['fold']}, run {first['run']}"
            raise refuse(
                f"{where}: status '{first['status']}' with {label} = {first[name]}; a finite score goes with 'ok', "
                "at least 0 if it is an error, "
                "and none with all others"
            )
    for name in TIMES:
        values = rows[name].to_numpy(float, na_value=np.nan)
        good = (values >= 0) & (values <= LARGEST)
        if not good.all():
            raise refuse(f"rows.parquet: {name} = {values[int(np.argmin(good))]}; accepted: seconds, at least 0")


def check_windows(windows: Frame, refuse: Refuse) -> None:
    """Check the columns and values of a table of windows.

    Raises:
        InputError: it does not pass.
    """
    check_columns(windows, refuse, ("dataset", "fingerprint", "task", "run"), ("fold",), FEATURES)
    values = windows[list(FEATURES)].to_numpy(float, na_value=np.nan)
    if not (values[:, :5] >= 0).all() or (np.abs(values) > LARGEST).any():
        raise refuse(
            "holds values that no window has; accepted: finite numbers, at least 0 for speed, drift, rudder, astern "
            "and thrusters"
        )
