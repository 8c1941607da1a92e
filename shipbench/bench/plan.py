"""What a study has to do: its cells, in parts that run together, each cell under the key by which `--resume` knows it."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..effects.base import EFFECTS
from ..errors import InputError, ShipbenchError, WorkError
from ..metrics.base import METRICS
from ..predictors.base import PREDICTORS, make_predictor
from ..records import Batch, Dataset, Run
from ..registry import package_digest
from ..specs import Spec
from .folds import Fold
from .provenance import source_digest
from .results import PROTOCOL, Cell
from .task import Task
from .work import FoldData, Job


@dataclass(frozen=True, eq=False)
class Study:
    """A task with its data, folds and parsed models."""

    task: Task
    data: Dataset
    folds: list[Fold]
    batches: list[Batch]
    specs: list[Spec]
    notes: tuple[str, ...]
    columns: list[dict[str, str]] = field(default_factory=list)

    @cached_property
    def fold_data(self) -> list[FoldData]:
        """What models may see of each fold; a window that several folds train on is kept once."""
        kept: dict[str, Run] = {}
        return [
            FoldData(_column_by_column(f.train, kept), _column_by_column(f.valid, kept) if f.valid else None, b.s0, b.U, b.history)
            for f, b in zip(self.folds, self.batches, strict=True)
        ]

    @cached_property
    def metric_plugins(self) -> list[str]:
        """Versions of the plug-ins that scores come from ("" for a metric of shipbench's own)."""
        return [METRICS.digest(name) for name in self.task.metrics]

    def parts(self) -> list[Part]:
        """All cells: the folds of a model and seed as one part where its class fits them together, else each cell as its own."""
        parts = []
        for spec in self.specs:
            model, files = new_model(spec), _model_files(spec)
            taken = [(EFFECTS, effect.name) for effect in spec.effects]
            taken += [(PREDICTORS, spec.name.partition(":")[0])] if spec.path is None else []
            plugins = [registry.digest(name) for registry, name in taken]
            packages = sorted({package for registry, name in taken if (package := registry.package(name))})
            code = {"shipbench": source_digest(), **{package: package_digest(package) for package in packages}}
            seeds = spec.seeds or list(self.task.seeds)
            if not getattr(model, "seeded", True):  # it draws no random numbers: one seed is enough
                seeds = seeds[:1]
            together = hasattr(type(model), "fit_group")
            for seed in seeds:
                cells = [Cell(self.data.name, spec.text, fold.index, seed) for fold in self.folds]
                parts += [Part(self, spec, group, files, plugins, code) for group in ([cells] if together else [[cell] for cell in cells])]
        return parts


@dataclass(frozen=True, eq=False)
class Part:
    """Cells that are one job: run, sent and resumed together (see `work`).

    `files`: content by relative name of the user's model; `plugins`: versions of the model's and its effects' plug-ins ("" for shipbench's own);
    `code`: digests of the packages that it takes, by which a worker knows its own (`package_digest`).
    """

    study: Study
    spec: Spec
    cells: list[Cell]
    files: dict[str, bytes]
    plugins: list[str]
    code: dict[str, str]

    @property
    def label(self) -> str:
        """For messages."""
        first = self.cells[0]
        return first.label if len(self.cells) == 1 else f"{first.dataset} {first.model} seed {first.seed}: {len(self.cells)} fits together"

    @cached_property
    def keys(self) -> list[str]:
        """For each cell the digest of everything that decides its content; `--resume` keeps a cell only where it agrees."""
        task, data = self.study.task, self.study.data
        files = {name: hashlib.sha256(content).hexdigest() for name, content in self.files.items()}
        keys = []
        for cell in self.cells:
            fold = self.study.folds[cell.fold]
            runs = [[(run.id, run.meta) for run in side.runs] if side else [] for side in (fold.train, fold.valid, fold.test)]
            parts = [
                PROTOCOL, task.key(data.fingerprint), task.metrics, runs, cell.model, cell.fold, cell.seed, files,
                self.plugins, self.code, self.study.metric_plugins,
            ]  # fmt: skip
            keys.append(hashlib.sha256(json.dumps(parts, default=str).encode()).hexdigest()[:16])
        return keys

    @property
    def fold_data(self) -> list[FoldData]:
        """Of each cell."""
        return [self.study.fold_data[cell.fold] for cell in self.cells]

    def job(self, send_files: bool, device: str | None) -> Job:
        """What a worker is given beside `fold_data`."""
        return Job(self.spec, self.cells[0].seed, self.code, self.files if send_files else None, device)

    def refuse_changed_files(self) -> None:
        """To be asked after a fit whose worker read the user's model file in place.

        Raises:
            WorkError: the file is no longer the one that the keys were made of.
        """
        if self.spec.class_name is not None and _model_files(self.spec) != self.files:
            raise WorkError(
                f"{self.spec.path} was changed while the study ran, so that cells of two versions would stand side by side. "
                "What was finished before is kept; run the same command again with --resume."
            )


def _column_by_column(data: Dataset, kept: dict[str, Run]) -> Dataset:
    """Samples in the memory layout of data read from files, which copies keep: sums over another layout round differently.

    `kept` holds, by name, the windows that were converted before; their names are unique in a study.
    """
    for run in data.runs:
        if run.id not in kept:
            kept[run.id] = replace(run, states=np.asfortranarray(run.states), inputs=np.asfortranarray(run.inputs))
    return data.with_runs(kept[run.id] for run in data.runs)


def new_model(spec: Spec) -> Any:
    """`make_predictor`, with anything that a user's own file raises turned into one message."""
    try:
        return make_predictor(spec)
    except ShipbenchError:
        raise
    except Exception as error:  # a user's own module is imported here
        raise InputError(f"model '{spec.text}' cannot be made: {type(error).__name__}: {error}. Mend its file.") from error


def _model_files(spec: Spec) -> dict[str, bytes]:
    """Content by relative name of the user's file or saved folder behind a spec."""
    if spec.path is None:
        return {}
    files = sorted(p for p in spec.path.rglob("*") if p.is_file()) if spec.path.is_dir() else [spec.path]
    return {p.relative_to(spec.path.parent).as_posix(): p.read_bytes() for p in files}
