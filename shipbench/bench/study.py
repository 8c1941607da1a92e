"""Work of a study: its cells, in parts that run together, each cell under the key by which `--resume` identifies it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import product

import numpy as np

from ..errors import WorkError
from ..metrics.base import METRICS
from ..predictors.context import Context
from ..records import Batch, Dataset, Run
from ..specs import Spec
from .folds import Fold
from .models import ModelFacts
from .results import PROTOCOL, Cell
from .task import MEASURED, Task, row_label
from .twins import trained_on, twin_windows
from .work import Answer, FoldData, Job, digests


@dataclass(frozen=True, eq=False)
class Study:
    """Task with its data, folds and parsed models, and the simulated twin of the data where the task has one."""

    task: Task
    data: Dataset
    folds: list[Fold]
    batches: list[Batch]
    specs: list[Spec]
    facts: list[ModelFacts]
    notes: tuple[str, ...]
    columns: list[dict[str, str]] = field(default_factory=list)
    simulated: Dataset | None = None

    @cached_property
    def key(self) -> str:
        """Digest of the settings that decide the scored data (`Task.key`)."""
        return self.task.key(self.data.fingerprint, "" if self.simulated is None else self.simulated.fingerprint)

    @cached_property
    def fold_data(self) -> list[FoldData]:
        """Data of each fold that models may see; a window that several folds train on is kept once."""
        kept: dict[str, Run] = {}
        return [
            FoldData(
                _column_by_column(f.train, kept),
                _column_by_column(f.valid, kept) if f.valid else None,
                b.s0,
                b.U,
                b.history,
                Context.of(f.test, self.task.history(self.data.dt)),
            )
            for f, b in zip(self.folds, self.batches, strict=True)
        ]

    @cached_property
    def twins(self) -> dict[str, Run]:
        """Windows of the simulated twin by the ids of the measured ones."""
        if self.simulated is None:
            return {}
        kept: dict[str, Run] = {}
        found = twin_windows(self.simulated, self.data, self.task)
        _column_by_column(self.data.with_runs(found.values()), kept)
        return kept

    @cached_property
    def metric_plugins(self) -> list[str]:
        """Versions of the plug-ins that scores come from ("" for a metric of shipbench's own)."""
        return [METRICS.digest(name) for name in self.task.metrics]

    def parts(self) -> list[Part]:
        """Cells of the study: the folds of a model and seed as one part where its class fits them together, else each
        cell as its own; a model that learns nothing has one row for all choices of training runs."""
        parts = []
        for spec, facts in zip(self.specs, self.facts, strict=True):
            seeds = spec.seeds or list(self.task.seeds)
            if not facts.seeded:  # it draws no random numbers: one seed is enough
                seeds = seeds[:1]
            for train_on, seed in product(self.task.train_on if facts.learns else (MEASURED,), seeds):
                label = row_label(spec.text, train_on)
                cells = [Cell(self.data.name, label, fold.index, seed) for fold in self.folds]
                parts += [
                    Part(self, spec, group, facts, train_on)
                    for group in ([cells] if facts.together else [[cell] for cell in cells])
                ]
        return parts


@dataclass(frozen=True, eq=False)
class Part:
    """Cells that are one job: run, sent and resumed together (see `work`)."""

    study: Study
    spec: Spec
    cells: list[Cell]
    facts: ModelFacts
    train_on: str = MEASURED

    @property
    def label(self) -> str:
        """Label for messages."""
        first = self.cells[0]
        return (
            first.label
            if len(self.cells) == 1
            else f"{first.dataset} {first.model} seed {first.seed}: {len(self.cells)} fits together"
        )

    @cached_property
    def keys(self) -> list[str]:
        """Digest, for each cell, of everything that decides its content; `--resume` keeps a cell only where it
        agrees."""
        task = self.study.task
        files, facts = digests(self.facts.files), self.facts
        keys = []
        for cell in self.cells:
            fold = self.study.folds[cell.fold]
            runs = [
                [(run.id, run.meta.as_dict()) for run in side.runs] if side else []
                for side in (fold.train, fold.valid, fold.test)
            ]
            parts = [
                PROTOCOL, self.study.key, task.metrics, runs, cell.model, cell.fold, cell.seed, files,
                facts.plugins, facts.code, self.study.metric_plugins, task.bands,
            ]  # fmt: skip
            keys.append(hashlib.sha256(json.dumps(parts, default=str).encode()).hexdigest()[:16])
        return keys

    @property
    def fold_data(self) -> list[FoldData]:
        """Fold data of each cell."""
        twins, warm = self.study.twins, self.facts.warm
        return [trained_on(self.train_on, self.study.fold_data[cell.fold], twins, warm) for cell in self.cells]

    def job(self, send_files: bool, device: str | None) -> Job:
        """Job for a worker, without `fold_data`."""
        facts = self.facts
        files = facts.files if send_files and self.spec.matched is None else None
        return Job(
            self.spec, self.cells[0].seed, facts.code, files, device, facts.foreign,
            self.study.task.bands,
        )  # fmt: skip

    def uncovered(self, answer: Answer) -> list[str]:
        """Names of code that the model loaded, and of files that it read, during fit and prediction, that the keys do
        not cover.

        Raises:
            WorkError: a file of its code is no longer the one that the keys were made of.
        """
        known = digests(self.facts.files)
        changed = [name for name, digest in answer.code.items() if known.get(name, digest) != digest]
        if changed:
            raise WorkError(
                f"{changed[0]} of {self.spec.path} was changed while the study ran, so that cells of two versions "
                "would stand side by side. "
                "What was finished before is kept; run the same command again with --resume."
            )
        return sorted(set(answer.code) - set(known))


def _column_by_column(data: Dataset, kept: dict[str, Run]) -> Dataset:
    """Samples in the memory layout of data read from files, which copies keep: sums over another layout round
    differently.

    `kept` holds, by name, the windows that were converted before; their names are unique in a study.
    """
    for run in data.runs:
        if run.id not in kept:
            kept[run.id] = replace(run, states=np.asfortranarray(run.states), inputs=np.asfortranarray(run.inputs))
    return data.with_runs(kept[run.id] for run in data.runs)
