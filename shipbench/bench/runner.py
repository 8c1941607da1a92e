"""Run of a study: for every data set, model, fold and seed fit, roll out, score and save; one failure never stops the
others."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ..data.base import load_dataset
from ..errors import InputError
from ..names import brief
from ..predictors._saved import check_origin
from ..records import Dataset
from ..replay.bind import bound
from ..replay.frame import prediction_notes
from ..specs import Spec, parse_spec
from ..steps import listening
from ..storage import Frame, write_json
from .executors import Execution, Workers, answers_of, open_workers
from .folds import make_folds, select_runs
from .lock import claimed, refuse_other_study
from .models import facts_of
from .patience import Patience
from .progress import Progress, Silent
from .provenance import code_version, machine
from .results import PROTOCOL, Cell, assemble, scored_before, whole_status, write_cell, write_truth
from .scoring import columns, divergence, measure
from .study import Part, Study
from .submissions import Results
from .task import Task
from .twins import check_twins, training_notes
from .work import Answer, digests


@dataclass(frozen=True)
class Memory:
    """Data sets and models in memory, by their names in tasks."""

    data: Mapping[str, Dataset] = field(default_factory=dict)
    models: Mapping[str, Spec] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Outcome:
    """Result of a study: its folder, the rows, the summaries of its cells, and the cells that failed with their
    reasons."""

    out: Path
    rows: Frame
    summaries: list[dict[str, Any]]
    failed: list[str]

    def __repr__(self) -> str:
        return brief(f"<Outcome in {self.out}: {len(self.summaries)} fits, {len(self.failed)} failed>")

    @property
    def equations(self) -> dict[tuple[str, str], Path]:
        """First file of fitted equations by data set and model of this study, of models that learn from the runs."""
        found: dict[tuple[str, str], Path] = {}
        for s in self.summaries:
            path = self.out / Cell(s["dataset"], s["model"], s["fold"], s["seed"]).folder / "equations.txt"
            if path.is_file() and s.get("learns", True):
                found.setdefault((s["dataset"], s["model"]), path)
        return found

    @property
    def results(self) -> Results:
        """Results as `read_results` would read them back."""
        return Results(self.rows, self.summaries, [self.out] * len(self.summaries))


def run_tasks(
    tasks: Sequence[Task],
    out: str | Path,
    *,
    resume: bool = False,
    execution: Execution | None = None,
    progress: Progress | None = None,
    command: str = "",
    memory: Memory | None = None,
) -> Outcome:
    """Run every task and write the results below `out` (see `results`).

    Args:
        tasks: one per data set.
        out: folder of the study; run again, the same tasks replace what they made there.
        resume: keep the scored cells that the same code, data and task made; failed and skipped ones are tried again.
            The results of another study in `out` are replaced only then.
        execution: where the cells run and what each may use; it changes no number (a GPU rounds otherwise than a CPU).
        progress: told of every cell.
        command: the command line, kept in the results.
        memory: data sets and models that are no files, by the names that the tasks give them.

    Raises:
        InputError: a task, data set, model, folder or executor cannot be used, or `out` holds another study. Nothing
            has been fitted then.
        WorkError: the study had to stop (disk full, workers lost). What is finished is kept.
    """
    out, progress, execution = Path(out), progress or Silent(), execution or Execution()
    studies = [_prepare(task, memory or Memory()) for task in tasks]
    _refuse_elsewhere(studies, execution)
    _refuse_same_names([study.data.name for study in studies])
    parts = [part for study in studies for part in study.parts()]
    began = datetime.now(UTC)
    about = {"command": command, "code": code_version(), "began": began.isoformat(timespec="seconds")}
    with open_workers(execution) as workers, listening(progress.step), claimed(out):
        if not resume:
            refuse_other_study(out, tasks)
        for study in studies:
            for fold, batch in zip(study.folds, study.batches, strict=True):
                write_truth(out, study.data.name, fold.index, batch)
        progress.start(
            sum(len(part.cells) for part in parts), Counter(_kind(cell) for part in parts for cell in part.cells)
        )
        finished: set[Cell] = set()
        try:
            todo = [part for part in parts if not (resume and _kept(part, out, progress, finished))]
            for part, answers in _answers(todo, workers, progress, execution):
                for cell, key, answer in zip(part.cells, part.keys, answers, strict=True):
                    record = _score(part.study, part.spec, cell, answer)
                    summary = record.summary | about | _identity(part, key, answer)
                    write_cell(out, cell, record.rows, summary, answer.S, answer.files, answer.W)
                    finished.add(cell)
                    progress.done(cell.label, _outcome_text(summary), _kind(cell), answer.fit_s + answer.predict_s)
        finally:
            progress.finish()
            if finished:  # also of a study that stops early; one that finished nothing leaves an older table as it is
                rows, summaries = assemble(out, [cell for part in parts for cell in part.cells if cell in finished])
                seconds = round((datetime.now(UTC) - began).total_seconds(), 1)
                facts = {"machine": machine(), "execution": asdict(execution), "seconds": seconds}
                write_json(
                    out / "study.json", about | facts | {"tasks": [task.model_dump(mode="json") for task in tasks]}
                )
    failed = [
        f"{s['dataset']} {s['model']} fold {s['fold']} seed {s['seed']}: {s['reason']}"
        for s in summaries
        if s["status"] == "failed"
    ]
    return Outcome(out, rows, summaries, failed)


def check_task(task: Task) -> None:
    """Raise the errors that `run_tasks` would raise before it fits anything."""
    _prepare(task, Memory())


def _prepare(task: Task, memory: Memory) -> Study:
    specs = [memory.models[text] if text in memory.models else parse_spec(text) for text in task.models]
    facts = [
        facts_of(spec) for spec in specs
    ]  # an unknown model or parameter is told before anything is loaded or fitted
    whole = memory.data.get(task.dataset) or load_dataset(task.dataset)
    specs = [bound(spec, whole) for spec in specs]
    data, notes = select_runs(whole, task)
    notes += tuple(
        note for spec, known in zip(specs, facts, strict=True) for note in check_origin(spec.text, known.origin, data)
    )
    simulated = None
    if task.simulated is not None:
        simulated = memory.data.get(task.simulated) or load_dataset(task.simulated)
        check_twins(simulated, data)
        notes += training_notes(task, specs, facts, simulated)
    folds = make_folds(data, task)
    batches = [fold.test.batch(task.history(data.dt)) for fold in folds]
    found = [asdict(c) for c in columns(task.metrics, task.horizon_s, data.dt, task.bands)]
    return Study(task, data, folds, batches, specs, facts, (*data.notes, *notes), found, simulated)


def _refuse_elsewhere(studies: Sequence[Study], execution: Execution) -> None:
    """Refuse models in memory where the jobs run in other processes."""
    here = [spec.text for study in studies for spec in study.specs if spec.given is not None]
    if here and (execution.executor != "local" or execution.limits):
        how = f"executor '{execution.executor}'" if execution.executor != "local" else "a limit of time or memory"
        raise InputError(
            f"model '{here[0]}' is an object in memory and runs in this process only; {how} needs a class that can "
            "be imported. "
            "Save it in a file and give 'my_model.py:MyNet'."
        )


def _refuse_same_names(names: list[str]) -> None:
    twice = sorted({n for n in names if names.count(n) > 1})
    if twice:
        raise InputError(
            f"two data sets of this study are named '{twice[0]}'; rename one in its dataset.toml, or run them apart."
        )


def _kept(part: Part, out: Path, progress: Progress, finished: set[Cell]) -> bool:
    """Whether every cell of the part was scored before; they are then counted as finished."""
    statuses = [scored_before(out, cell, key) for cell, key in zip(part.cells, part.keys, strict=True)]
    if not all(statuses):
        return False
    for cell, status in zip(part.cells, statuses, strict=True):
        finished.add(cell)
        progress.done(cell.label, f"{status} (kept)", _kind(cell), 0.0)
    return True


def _kind(cell: Cell) -> str:
    """Kind of a cell: cells of one model on one data set cost about the same."""
    return f"{cell.dataset} {cell.model}"


def _answers(
    parts: Sequence[Part], workers: Workers, progress: Progress, how: Execution
) -> Iterator[tuple[Part, list[Answer]]]:
    """Parts with the answers for their cells, as they come."""
    if workers.room is None and parts:
        progress.working(f"{len(parts)} jobs sent to {workers.about}")
    waiting, running, patience = (
        deque(parts),
        dict[Future[list[Answer]], Part](),
        Patience(workers, progress, how.wait_s),
    )
    while waiting or running:
        while waiting and (workers.room is None or len(running) < workers.room):
            part = waiting.popleft()
            if workers.room is not None:
                progress.working(part.label)
            running[workers.submit(part.job(workers.sends_files, how.device), part.fold_data)] = part
        for future in patience.first_done(running):
            part = running.pop(future)
            answers = answers_of(future, len(part.cells))
            yield part, answers


def _identity(part: Part, key: str, answer: Answer) -> dict[str, Any]:
    """Key of the cell, its training runs and digests of the user's code behind it; no key where the model loaded code
    or read files that the key does not cover."""
    twin = part.study.simulated
    identity: dict[str, Any] = {
        "key": key,
        "train_on": part.train_on,
        **({} if twin is None else {"simulated": {"name": twin.name, "fingerprint": twin.fingerprint}}),
        "model_code": {name: digest[:16] for name, digest in digests(part.facts.files).items()},
    }
    if part.spec.given is not None:
        return identity | {"key": "", "key_note": "the model was an object in memory; --resume runs this cell again"}
    if unknown := part.uncovered(answer):
        more = (
            f"the model loaded or read {', '.join(unknown[:3])} while it ran; --resume cannot tell whether that "
            "changes, and runs this cell again"
        )
        identity |= {"key": "", "key_note": more}
    return identity


_KNOWS = (
    "it was fitted to these runs, so that its errors are smaller than on other runs. Its diagnosis states those on "
    "held-out runs"
)
"""Note on a model that knows the scored runs."""


@dataclass(frozen=True, eq=False)
class _Record:
    rows: Frame
    summary: dict[str, Any]


def _score(study: Study, spec: Spec, cell: Cell, answer: Answer) -> _Record:
    """Rows of the fold, one per scored window, from the prediction of the model or the reason why there is none."""
    batch, data, task, S = study.batches[cell.fold], study.data, study.task, answer.S
    notes = dict(answer.notes)
    status, reason = answer.status, answer.reason
    if S is None:
        statuses, reasons = [status] * len(batch.ids), [reason] * len(batch.ids)
        values = {c["name"]: np.full(len(batch.ids), np.nan) for c in study.columns}
    else:
        left_out = answer.skipped or ("",) * len(batch.ids)
        diverged = divergence(batch.truth, S, data.dt)
        reasons = [skipped or far for skipped, far in zip(left_out, diverged, strict=True)]
        statuses = [
            "skipped" if skipped else "diverged" if far else "ok"
            for skipped, far in zip(left_out, diverged, strict=True)
        ]
        ok = np.array([s == "ok" for s in statuses])
        values = measure(task.metrics, batch, S, L=data.ship.L, dt=data.dt, ok=ok, W=answer.W)
        status = whole_status(statuses)
        first = next((i for i, s in enumerate(statuses) if s == status != "ok"), None)
        reason = "" if first is None else f"run {batch.ids[first]}: {reasons[first]}"
        if notes.get("learns") is False and "replay_report" not in notes:
            notes["simulation_notes"] = prediction_notes(S, study.folds[cell.fold].test.runs, data.ship, data.dt)
            if notes.get("fitted_to") == data.fingerprint:
                notes["simulation_notes"].append(_KNOWS)
    times = {"fit_s": answer.fit_s, "fit_shared_by": answer.shared_by, "predict_s": answer.predict_s}
    rows = _rows(study, cell, statuses, reasons, values, times)
    outcome = {"status": status, "reason": reason, "run_status": statuses, "machine": answer.machine, **notes}
    return _Record(rows, _summary(study, spec, cell, answer, times) | outcome)


def _rows(
    study: Study,
    cell: Cell,
    statuses: list[str],
    reasons: list[str],
    values: dict[str, np.ndarray],
    times: dict[str, float],
) -> Frame:
    import pandas as pd

    runs = study.folds[cell.fold].test.runs
    identity = {
        "protocol": PROTOCOL, "dataset": cell.dataset, "fingerprint": study.data.fingerprint,
        "task": study.key, "model": cell.model, "fold": cell.fold, "seed": cell.seed,
    }  # fmt: skip
    per_run = {
        "run": [r.id for r in runs],
        "parent": [r.parent for r in runs],
        "group": [r.group for r in runs],
        "kind": [r.kind for r in runs],
        "status": statuses,
        "reason": reasons,
    }
    rows = pd.DataFrame({**per_run, **values}).assign(**times)
    for place, (name, value) in enumerate(identity.items()):
        rows.insert(place, name, value)
    return rows


def _summary(study: Study, spec: Spec, cell: Cell, answer: Answer, times: dict[str, float]) -> dict[str, Any]:
    """Summary that identifies the cell's experiment on its own."""
    data, fold = study.data, study.folds[cell.fold]
    return {
        "protocol": PROTOCOL, "dataset": data.name, "fingerprint": data.fingerprint,
        "task_key": study.key,
        "task": study.task.model_dump(mode="json"), "model": cell.model, "name": spec.name,
        "params": spec.params if answer.params is None else answer.params,
        "parameters": answer.parameters,
        "fold": cell.fold, "seed": cell.seed, "ship": data.ship.name, "ship_L": data.ship.L, "ship_B": data.ship.B,
        "dt": data.dt,
        "inputs": list(data.inputs), "columns": study.columns, "notes": list(study.notes), "source": data.source,
        "licence": data.licence,
        "runs": {side: [r.id for r in part.runs] if part else [] for side, part in
                 (("train", fold.train), ("valid", fold.valid), ("test", fold.test))},
        "finished": datetime.now(UTC).isoformat(timespec="seconds"), **times,
    }  # fmt: skip


def _outcome_text(summary: dict[str, Any]) -> str:
    """Line on a finished cell, for the progress."""
    statuses = summary["run_status"]
    shared = f" (its share of {summary['fit_shared_by']} fits together)" if summary["fit_shared_by"] > 1 else ""
    if summary["status"] == "ok":
        skipped = statuses.count("skipped")
        runs = f"{len(statuses) - skipped} of {len(statuses)} runs" if skipped else f"{len(statuses)} runs"
        return f"ok, {runs}, fit {summary['fit_s']:.2f} s{shared}"
    count = sum(s == summary["status"] for s in statuses)
    return f"{summary['status']}, {count} of {len(statuses)} runs: {summary['reason']}"
