"""Interface for Python, in a notebook or a script: the commands as functions that take names, paths and objects
alike."""

from __future__ import annotations

import os
import shutil
import tempfile
import weakref
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from inspect import Parameter, signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .bench.submissions import Results, read_results
from .checking.finding import SEVERITIES, Finding
from .data.base import load_dataset
from .diagnosis.result import Diagnosis
from .errors import InputError, unknown_parameter
from .names import brief
from .records import Dataset
from .scores import Scores
from .specs import Spec, spec_of

if TYPE_CHECKING:
    import pandas as pd

    from .importing.mapping import Mapping as LogMapping
    from .importing.summary import Summary
    from .ship import Ship

Place = str | os.PathLike[str]
Data = Dataset | Place


def benchmark(
    models: Any,
    data: Data | Sequence[Data],
    *,
    horizon: float = 120.0,
    folds: int = 5,
    seeds: int | Sequence[int] = 0,
    out: Place | None = None,
    resume: bool = False,
    executor: str = "local",
    workers: int | None = None,
    device: str | None = None,
    quiet: bool = False,
    **options: Any,
) -> Scores:
    """Fit, roll out and score models on held-out runs, as `shipbench run` does.

    A class in memory is made anew for every fold. An object is copied for every fold before `fit`, so give it unfitted.
    Both run in this process.

    Args:
        models: one or several: "physics+current", "my_model.py:MyNet", a folder of a saved model, a class or an object
            with `fit` and `predict`. A mapping names them: {"my net": MyNet(), "physics": "physics"}.
        data: one or several data sets: objects, registered names or folders.
        horizon: time to predict [s].
        folds: number of folds by run, from 2.
        seeds: seed or seeds of the models' random draws.
        out: folder for the results; None: they are kept until the scores are no longer used.
        resume: keep what the same code, data and task scored in `out` before; models in memory are always fitted anew.
        executor: "local", "processes" or "dask"; only "local" takes models in memory.
        workers: number of processes of the executor "processes".
        device: where networks compute: "cpu", "cuda" or "cuda:1".
        quiet: show no progress.
        options: other keys of a `Task`, such as history_s=10, split="kind", stride_s=30, max_runs=20, bands=True,
            metrics=["ed"], or simulated=simulate_like("physics", data) for models trained on simulated runs, too.

    Raises:
        InputError: a model, data set or option cannot be used, or `out` holds another study; nothing has been fitted
            then.
        WorkError: the study had to stop.
    """
    from .bench.executors import Execution
    from .bench.progress import make_progress
    from .bench.runner import Memory, run_tasks
    from .bench.task import Task, make_task

    own = [name for name, known in signature(benchmark).parameters.items() if known.kind is not Parameter.VAR_KEYWORD]
    keys = [key for key in Task.model_fields if key not in _SET_BY_ARGUMENTS]
    if unknown := [name for name in options if name not in keys]:
        raise unknown_parameter("benchmark", unknown[0], [*own, *keys])
    specs = _named(models)
    named = {d.name if isinstance(d, Dataset) else os.fspath(d): d for d in _several(data)}
    if len(named) < len(_several(data)):
        raise InputError(
            f"data: two data sets have one name ({', '.join(named)}). Accepted: different names. Rename one, or "
            "score them apart."
        )
    seeds = (seeds,) if isinstance(seeds, int) else tuple(seeds)
    twin = options.get("simulated")
    if twin is not None:
        options["simulated"] = twin.name if isinstance(twin, Dataset) else os.fspath(twin)
    common = {"models": tuple(specs), "horizon_s": horizon, "folds": folds, "seeds": seeds, **options}
    tasks = [make_task({**common, "dataset": name}, "benchmark") for name in named]
    memory = Memory(
        {name: d for name, d in named.items() if isinstance(d, Dataset)}
        | ({twin.name: twin} if isinstance(twin, Dataset) else {}),
        {text: s for text, s in specs.items() if s.given is not None},
    )
    folder = Path(out) if out is not None else Path(tempfile.mkdtemp(prefix="shipbench-"))
    try:
        outcome = run_tasks(
            tasks, folder, resume=resume, execution=Execution(executor, workers, device=device),
            progress=make_progress(quiet),
            command=_COMMAND, memory=memory,
        )  # fmt: skip
    except BaseException:
        if out is None:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    scores = Scores(outcome.results)
    if out is None:
        weakref.finalize(scores, shutil.rmtree, folder, ignore_errors=True)
    return scores


_SET_BY_ARGUMENTS = ("dataset", "models", "horizon_s", "folds", "seeds")
"""Keys of a task for which `benchmark` has arguments of its own."""
_COMMAND = "shipbench.benchmark(...) in Python"


def _several(given: Any) -> list[Any]:
    """List of one where one is given."""
    return list(given) if isinstance(given, list | tuple) else [given]


def _named(models: Any) -> dict[str, Spec]:
    """Specs by their label in tables; of objects with one label the later ones are numbered."""
    if isinstance(models, Mapping):
        found = [(str(label), spec_of(model, str(label))) for label, model in models.items()]
        if strange := [label for label, spec in found if spec.given is None and label != spec.text]:
            raise InputError(
                f"models: '{strange[0]}' names a spec, which is its own name. Accepted: names of classes and objects."
            )
    else:
        found = [(spec.text, spec) for spec in map(spec_of, _several(models))]
    specs: dict[str, Spec] = {}
    for label, spec in sorted(found, key=lambda pair: pair[1].given is not None):  # a spec in text keeps its name
        free = next(
            name
            for name in (label, *(f"{label}-{k}" for k in range(2, len(found) + 2)))
            if name not in specs or spec.given is None
        )
        specs[free] = replace(spec, text=free, name=free) if spec.given is not None else spec
    return specs


def simulate_like(model: Any, data: Data, *, out: Place | None = None, device: str | None = None) -> Dataset:
    """Simulate every run of a trial from its measured start with its inputs, as `shipbench data simulate` does.

    `benchmark(models, data, simulated=...)` trains models on such a twin.

    Args:
        model: a model that needs no fit: the folder of a saved model, "sim.py:simulate", a function
            `simulate(s0, U, dt)`, "ship.fmu", "oracle", or "physics" as the particulars of the ship give it.
        data: the measured data set, its registered name or its folder.
        out: folder to write it to, too.
        device: "cpu", "cuda" or "cuda:1", where the model has a choice.

    Returns:
        The twin `<name>-simulated`: ids, metadata, times and inputs are those of `data`, the states are simulated.

    Raises:
        InputError: the model must be fitted first or cannot take these data, or `out` holds another data set.
        WorkError: the model fails on a run, or its states are not finite.
    """
    from .bench.twins import simulate_like as simulated
    from .bench.twins import write_twin

    twin = simulated(model, _loaded(data), device)
    if out is not None:
        write_twin(twin, Path(out))
    return twin


class Verdict(Diagnosis):
    """Diagnosis that shows its verdict in words; `verdict`, `causes`, `extended_model` and `gain` are the main
    fields."""

    def __repr__(self) -> str:
        from .reports.diagnosis.text import headline

        compare = (
            f'Compare: shipbench.benchmark(["physics", "{self.extended_model}"], data)'
            if self.extended_model not in ("physics", self.simulation)
            else ""
        )
        return brief("\n".join([f"Diagnosis of {self.dataset}", headline(self), compare]).rstrip())


def diagnose(
    data: Data, model: Any = None, *, gain: bool = True, seed: int = 0, workers: int = 2, thorough: bool = False,
    quiet: bool = False,
) -> Verdict:  # fmt: skip
    """Show what the physics model gets wrong on measured runs and name the causes, as `shipbench diagnose` does.

    Args:
        data: a data set, its registered name or its folder.
        model: your own simulation, judged in place of the ship file's physics: a spec such as "sim.py:simulate", a
            folder of a saved model, predictions:FOLDER, a class, or a function simulate(s0, U, dt).
        gain: measure the gain of the causes on held-out runs, which takes most of the time.
        seed: of folds and bootstrap.
        workers: number of processes; 1: everything runs in this one.
        thorough: use up to twice as much of a long record.
        quiet: show no progress.

    Raises:
        InputError: the data set cannot be read, or the record is too short or contradicts itself.
    """
    from .bench.progress import steps_shown
    from .diagnosis.diagnose import diagnose as run
    from .replay.stand_in import stand_in

    with steps_shown(quiet):
        dataset = _loaded(data)
        judged = None if model is None else stand_in(spec_of(model), dataset)
        found = run(
            dataset, gain=gain, seed=seed, workers=workers, thorough=thorough,
            simulation=None if judged is None else judged.spec,
        )  # fmt: skip
    found = replace(found, stand_in="" if judged is None else judged.note)
    spec = "" if isinstance(data, Dataset) else os.fspath(data)
    return Verdict(**{f.name: getattr(found, f.name) for f in fields(found)} | {"spec": spec})


def _loaded(data: Data) -> Dataset:
    return data if isinstance(data, Dataset) else load_dataset(data)


class Findings(tuple[Finding, ...]):
    """Findings of a data check, errors first."""

    def table(self) -> pd.DataFrame:
        """Table with a row for each finding: severity, kind, channels, runs, text and correction."""
        import pandas as pd

        columns = ["severity", "kind", "channels", "runs", "text", "todo"]
        rows = [(f.severity, f.kind, ", ".join(f.channels), ", ".join(f.runs), f.text, f.todo) for f in self]
        return pd.DataFrame(rows, columns=columns)

    def __repr__(self) -> str:
        counts = {severity: sum(f.severity == severity for f in self) for severity in SEVERITIES}
        head = ", ".join(f"{n} {severity}{'s' * (n > 1)}" for severity, n in counts.items() if n) or "No findings"
        return brief("\n".join([head, *(f"  {f.severity}: {f.text}" for f in self)]))

    def _repr_html_(self) -> str:
        return str(self.table().to_html(index=False, max_rows=40)) if self else repr(self)


def check_data(data: Data) -> Findings:
    """Find faults of a data set from the data themselves, as `shipbench data check` does: units, signs, frames, clocks,
    samples, copies.

    Raises:
        InputError: neither a known name nor a folder, or nothing in it can be read.
    """
    from .checking.base import check_dataset, check_path

    return Findings(check_dataset(data) if isinstance(data, Dataset) else check_path(os.fspath(data))[1])


def import_log(
    logs: Place | Sequence[Place], mapping: Place | LogMapping, ship: Place | Ship, out: Place, *, force: bool = False,
    **overrides: Any
) -> Summary:  # fmt: skip
    """Make a data set of logs of a trial, as `shipbench data import` does; load it with `load_dataset(out)`.

    Args:
        logs: one or several files.
        mapping: mapping.toml, the columns of each channel.
        ship: ship.toml, or the ship's particulars.
        out: folder of the data set.
        force: replace a data set that is there.
        overrides: name, dt [s], window [s], shortest [s] or still_speed [m/s] instead of the mapping's.

    Returns:
        What was read, converted, derived and left out.

    Raises:
        InputError: a log, the mapping or the folder cannot be used; nothing is written then.
    """
    from .importing.importer import import_logs
    from .importing.mapping import load_mapping
    from .ship import Ship as Particulars

    plan = load_mapping(Path(mapping), **overrides) if isinstance(mapping, str | os.PathLike) else mapping
    vessel = Particulars.load(Path(ship)) if isinstance(ship, str | os.PathLike) else ship
    return import_logs([Path(log) for log in _several(logs)], plan, vessel, Path(out), force=force)


@dataclass(frozen=True)
class Proposal:
    """Draft of mapping.toml and remarks on its guessed, uncertain and missing entries."""

    text: str
    remarks: tuple[str, ...]

    def __repr__(self) -> str:
        return brief(
            "\n".join(
                [
                    "Draft of a mapping, in .text. Check every line marked GUESS.",
                    *(f"  {remark}" for remark in self.remarks),
                ]
            )
        )


def propose_mapping(
    logs: Place | Sequence[Place], out: Place | None = None, *, force: bool = False, partial: Place | None = None,
    **file: Any
) -> Proposal:  # fmt: skip
    """Draft the mapping of logs, as `shipbench data import --propose` does.

    Args:
        logs: one or several files.
        out: file to write, such as "mapping.toml"; None: only the text is returned.
        force: replace a file that is there.
        partial: a partial mapping, whose entries are kept.
        file: keys of [file] that are known: encoding, sheet or header.

    Raises:
        InputError: a log cannot be read, or `out` is there already.
    """
    from .importing.propose import write_proposal

    with tempfile.TemporaryDirectory(prefix="shipbench-") as scratch:
        path = Path(out) if out is not None else Path(scratch, "mapping.toml")
        remarks = write_proposal(
            [Path(log) for log in _several(logs)],
            path,
            force,
            file=file,
            partial=Path(partial) if partial is not None else None,
        )
        return Proposal(path.read_text(encoding="utf-8"), tuple(remarks if out is not None else remarks[:-2]))


def report(
    results: Results | Scores | Place | Sequence[Place],
    out: Place = "report.html",
    *,
    diagnosis: Place | Sequence[Place] = (),
) -> Path:
    """Write the page of results, as `shipbench report` does, and return its path.

    Args:
        results: what `benchmark` or `read_results` returned, or result folders.
        out: HTML file to write.
        diagnosis: folders of diagnoses to link.

    Raises:
        InputError: results of different kinds, or `out` cannot be written.
    """
    if isinstance(results, Results | Scores):
        scores = Scores(results) if isinstance(results, Results) else results
    else:
        scores = Scores(read_results([Path(folder) for folder in _several(results)]))
    return scores.report(out, diagnosis=[Path(folder) for folder in _several(diagnosis)])


def export_model(path: Place, format: str, out: Place | None = None, *, fmi: int = 2, force: bool = False) -> Path:
    """Write a saved model for other programs, as `shipbench export` does, and return the path.

    Args:
        path: folder of a saved `physics` or `calibrated`, with or without effects.
        format: "fmu", "c", "casadi", "matlab" or "json".
        out: file to write, or folder of "c"; None: named after ship and model, in the current folder.
        fmi: version of FMI of an FMU, 2 or 3.
        force: replace what is there.

    Raises:
        InputError: the folder is no saved model or one that cannot be exported, the format is unknown, `out` is there
            already or no name for this format, or an FMU is asked for and there is no C compiler.
        WorkError: the model diverges, or the compiler fails.
    """
    from .exporting.formats import export

    return export(os.fspath(path), format, None if out is None else Path(out), fmi=fmi, force=force)
