"""Runs a study: for every data set, model, fold and seed fit, roll out, score and save; one failure never stops the others."""

from __future__ import annotations

import hashlib
import json
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, is_dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..data.base import load_dataset
from ..effects.base import EFFECTS
from ..errors import InputError, ShipbenchError
from ..predictors.base import PREDICTORS, fit_models, make_predictor
from ..records import Batch, Dataset
from ..specs import Spec, parse_spec
from .folds import Fold, make_folds, select_runs
from .progress import Progress, Silent
from .provenance import code_version, machine
from .results import PROTOCOL, Cell, Frame, Results, assemble, read_summary, write_cell, write_json, write_truth
from .scoring import columns, divergence, measure
from .task import Task


@dataclass(frozen=True, eq=False)
class Outcome:
    """What a study left: its folder, the rows, the summaries of its cells, and the cells that failed with their reasons."""

    out: Path
    rows: Frame
    summaries: list[dict[str, Any]]
    failed: list[str]

    @property
    def results(self) -> Results:
        """As `read_results` would read them back."""
        return Results(self.rows, self.summaries, [self.out] * len(self.summaries))


@dataclass(frozen=True, eq=False)
class _Study:
    """A task with its data, folds and parsed models."""

    task: Task
    data: Dataset
    folds: list[Fold]
    batches: list[Batch]
    specs: list[Spec]
    notes: tuple[str, ...]
    columns: list[dict[str, str]] = field(default_factory=list)

    def cells(self, spec: Spec) -> list[Cell]:
        """Folds x seeds; a model that says `seeded = False` runs with one seed only."""
        seeds = spec.seeds or list(self.task.seeds)
        if not getattr(_new_model(spec), "seeded", True):
            seeds = seeds[:1]
        return [Cell(self.data.name, spec.text, fold.index, seed) for fold in self.folds for seed in seeds]

    def key(self, cell: Cell, spec: Spec) -> str:
        """Digest of everything that decides a cell's content; `--resume` skips a finished cell only where it agrees."""
        parts = [
            PROTOCOL, self.task.key(self.data.fingerprint), self.task.metrics, cell.model, cell.fold, cell.seed,
            _file_digest(spec), code_version()["source"],
        ]  # fmt: skip
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()[:16]


def run_tasks(tasks: Sequence[Task], out: str | Path, *, resume: bool = False, progress: Progress | None = None, command: str = "") -> Outcome:
    """Run every task and write the results below `out` (see `results`).

    Args:
        tasks: one per data set.
        out: folder of the study; cells of an earlier study there are replaced when they are run again.
        resume: keep the finished cells that the same code, data and task made.
        progress: told of every cell.
        command: the command line, kept in the results.

    Raises:
        InputError: a task, data set or model cannot be used. Nothing has been fitted then.
    """
    out, progress = Path(out), progress or Silent()
    studies = [_prepare(task) for task in tasks]
    _refuse_same_names([study.data.name for study in studies])
    plan = [(study, spec, study.cells(spec)) for study in studies for spec in study.specs]
    began = datetime.now(UTC)
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror}. Give another folder with --out.") from None
    for study in studies:
        for fold, batch in zip(study.folds, study.batches, strict=True):
            write_truth(out, study.data.name, fold.index, batch)
    about = {"command": command, "code": code_version(), "machine": machine(), "began": began.isoformat(timespec="seconds")}
    progress.start(sum(len(cells) for _, _, cells in plan))
    try:
        for study, spec, cells in plan:
            _run_model(study, spec, cells, out, about, progress, resume)
    finally:
        progress.finish()
        rows, summaries = assemble(out, [cell for _, _, cells in plan for cell in cells])
        seconds = (datetime.now(UTC) - began).total_seconds()
        write_json(out / "study.json", about | {"tasks": [task.model_dump(mode="json") for task in tasks], "seconds": round(seconds, 1)})
    failed = [f"{s['dataset']} {s['model']} fold {s['fold']} seed {s['seed']}: {s['reason']}" for s in summaries if s["status"] == "failed"]
    return Outcome(out, rows, summaries, failed)


def _prepare(task: Task) -> _Study:
    specs = [parse_spec(text) for text in task.models]
    for spec in specs:
        _new_model(spec)  # an unknown model or parameter is told before anything is loaded or fitted
    data, notes = select_runs(load_dataset(task.dataset), task)
    folds = make_folds(data, task)
    batches = [fold.test.batch(task.history(data.dt)) for fold in folds]
    found = [asdict(c) for c in columns(task.metrics, task.horizon_s, data.dt)]
    return _Study(task, data, folds, batches, specs, (*data.notes, *notes), found)


def _refuse_same_names(names: list[str]) -> None:
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(f"two data sets of this study are named '{twice[0]}'; rename one in its dataset.toml, or run them apart.")


def _new_model(spec: Spec) -> Any:
    """`make_predictor`, with anything that a user's own file raises turned into one message."""
    try:
        return make_predictor(spec)
    except ShipbenchError:
        raise
    except Exception as error:  # a user's own module is imported here
        raise InputError(f"model '{spec.text}' cannot be made: {type(error).__name__}: {error}. Mend its file.") from error


def _file_digest(spec: Spec) -> str:
    """Digest of the user's file, saved folder or plug-ins behind a spec; "" where all of it is shipbench's own."""
    if spec.path is None:
        return "".join([PREDICTORS.digest(spec.name.partition(":")[0]), *(EFFECTS.digest(effect.name) for effect in spec.effects)])
    files = sorted(p for p in spec.path.rglob("*") if p.is_file()) if spec.path.is_dir() else [spec.path]
    return hashlib.sha256(b"".join(p.read_bytes() for p in files)).hexdigest()[:12]


def _run_model(study: _Study, spec: Spec, cells: list[Cell], out: Path, about: dict[str, Any], progress: Progress, resume: bool) -> None:
    """All folds and seeds of one model: together where its class can, else one by one."""
    todo = []
    for cell in cells:
        before = read_summary(out, cell) if resume else None
        if before is not None and before["key"] == study.key(cell, spec):
            progress.done(cell.label, f"{before['status']} (kept)")
        else:
            todo.append(cell)
    if not todo:
        return
    together = hasattr(type(_new_model(spec)), "fit_group")
    for part in [todo] if together else [[cell] for cell in todo]:
        progress.working(part[0].label if len(part) == 1 else f"{study.data.name} {spec.text}: {len(part)} fits together")
        for cell, fitted in zip(part, _fit(study, spec, part), strict=True):
            record = _score(study, spec, cell, fitted)
            summary = record.summary | about | {"key": study.key(cell, spec)}
            write_cell(out, cell, record.rows, summary, record.S, fitted.model if record.S is not None else None)
            progress.done(cell.label, _outcome_text(summary))


@dataclass(frozen=True, eq=False)
class _Fitted:
    """A model after its fit: `status` "" or "failed"/"skipped" with the reason; seconds of the fit (shared equally if fitted together)."""

    model: Any
    status: str = ""
    reason: str = ""
    seconds: float = 0.0
    shared_by: int = 1


def _fit(study: _Study, spec: Spec, cells: list[Cell]) -> list[_Fitted]:
    models = [_new_model(spec) for _ in cells]
    refusal = getattr(models[0], "skip", None)
    reason = refusal(study.data) if callable(refusal) else None
    if reason:
        return [_Fitted(model, "skipped", str(reason)) for model in models]
    if spec.path is not None and spec.class_name is None:
        return [_Fitted(model) for model in models]  # a saved model comes fitted
    folds = [study.folds[cell.fold] for cell in cells]
    began = time.perf_counter()
    errors = fit_models(models, [f.train for f in folds], [f.valid for f in folds], [cell.seed for cell in cells])
    seconds = (time.perf_counter() - began) / len(cells)
    return [
        _Fitted(model, "failed" if error else "", f"fit: {_one_line(error)}" if error else "", seconds, len(cells))
        for model, error in zip(models, errors, strict=True)
    ]


def _one_line(error: Exception) -> str:
    text = f"{type(error).__name__}: {error}" if not isinstance(error, ShipbenchError) else str(error)
    return " ".join(text.split())[:400]


@dataclass(frozen=True, eq=False)
class _Record:
    rows: Frame
    summary: dict[str, Any]
    S: np.ndarray | None


def _predict(model: Any, batch: Batch) -> np.ndarray:
    """The model's prediction of copies of what it may see: writing into them, or looking behind them, never reaches the truth."""
    history = None if batch.history is None else (batch.history[0].copy(), batch.history[1].copy())
    S = np.array(model.predict(batch.s0.copy(), batch.U.copy(), history), dtype=float)
    if S.shape != batch.truth.shape:
        raise ValueError(f"the prediction has shape {S.shape}; accepted: {batch.truth.shape} (batch, K, 10), without s0")
    return S


def _score(study: _Study, spec: Spec, cell: Cell, fitted: _Fitted) -> _Record:
    """Predict the fold's scored windows and make one row per window."""
    batch, data, task = study.batches[cell.fold], study.data, study.task
    S, status, reason, predict_s = None, fitted.status, fitted.reason, 0.0
    if not status:
        began = time.perf_counter()
        try:
            S = _predict(fitted.model, batch)
        except Exception as error:  # a user's own model may raise anything; its rows say what
            status, reason = "failed", f"predict: {_one_line(error)}"
        predict_s = (time.perf_counter() - began) / len(batch.ids)
    if S is None:
        statuses, reasons = [status] * len(batch.ids), [reason] * len(batch.ids)
        values = {c["name"]: np.full(len(batch.ids), np.nan) for c in study.columns}
    else:
        reasons = divergence(batch.truth, S, data.dt)
        statuses = ["diverged" if r else "ok" for r in reasons]
        values = measure(task.metrics, batch, S, L=data.ship.L, dt=data.dt, ok=np.array([not r for r in reasons]))
        status = "diverged" if any(reasons) else "ok"
        reason = next((f"run {i}: {r}" for i, r in zip(batch.ids, reasons, strict=True) if r), "")
    times = {"fit_s": fitted.seconds, "fit_shared_by": fitted.shared_by, "predict_s": predict_s}
    rows = _rows(study, cell, statuses, reasons, values, times)
    return _Record(rows, _summary(study, spec, cell, fitted, times) | {"status": status, "reason": reason, "run_status": statuses}, S)


def _rows(study: _Study, cell: Cell, statuses: list[str], reasons: list[str], values: dict[str, np.ndarray], times: dict[str, float]) -> Frame:
    import pandas as pd

    runs = study.folds[cell.fold].test.runs
    identity = {
        "protocol": PROTOCOL, "dataset": cell.dataset, "fingerprint": study.data.fingerprint,
        "task": study.task.key(study.data.fingerprint), "model": cell.model, "fold": cell.fold, "seed": cell.seed,
    }  # fmt: skip
    per_run = {
        "run": [r.id for r in runs],
        "parent": [str(r.meta.get("parent", r.id)) for r in runs],
        "kind": [str(r.meta.get("manoeuvre", "")) for r in runs],
        "status": statuses,
        "reason": reasons,
    }
    rows = pd.DataFrame({**per_run, **values}).assign(**times)
    for place, (name, value) in enumerate(identity.items()):
        rows.insert(place, name, value)
    return rows


def _summary(study: _Study, spec: Spec, cell: Cell, fitted: _Fitted, times: dict[str, float]) -> dict[str, Any]:
    """What alone identifies the cell's experiment."""
    data, fold = study.data, study.folds[cell.fold]
    return {
        "protocol": PROTOCOL, "dataset": data.name, "fingerprint": data.fingerprint, "task_key": study.task.key(data.fingerprint),
        "task": study.task.model_dump(mode="json"), "model": cell.model, "name": spec.name,
        "params": asdict(fitted.model) if is_dataclass(fitted.model) and not isinstance(fitted.model, type) else spec.params,
        "fold": cell.fold, "seed": cell.seed, "ship": data.ship.name, "ship_L": data.ship.L, "ship_B": data.ship.B, "dt": data.dt,
        "inputs": list(data.inputs), "columns": study.columns, "notes": list(study.notes), "source": data.source, "licence": data.licence,
        "runs": {side: [r.id for r in part.runs] if part else [] for side, part in
                 (("train", fold.train), ("valid", fold.valid), ("test", fold.test))},
        "finished": datetime.now(UTC).isoformat(timespec="seconds"), **times,
    }  # fmt: skip


def _outcome_text(summary: dict[str, Any]) -> str:
    """One line on a finished cell, for the progress."""
    statuses = summary["run_status"]
    shared = f" ({summary['fit_shared_by']} fits together)" if summary["fit_shared_by"] > 1 else ""
    if summary["status"] == "ok":
        return f"ok, {len(statuses)} runs, fit {summary['fit_s']:.2f} s{shared}"
    count = sum(s == summary["status"] for s in statuses)
    return f"{summary['status']}, {count} of {len(statuses)} runs: {summary['reason']}"
