"""Simulated twins of measured runs: made by a model that needs no fit, checked, and given to models as training data.

Source: Hu et al. (2026), RealPDEBench: a benchmark for complex physical systems with real-world data, ICLR,
arXiv:2601.01829.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..data.corrections import continuous
from ..data.files import read_description, write_dataset
from ..errors import InputError, ShipbenchError, WorkError, option
from ..names import LONGEST
from ..predictors._saved import check_origin
from ..predictors._user_file import on_import_path
from ..predictors.base import learns, make_predictor
from ..predictors.context import Context, predicted
from ..records import LARGEST, Dataset, Run
from ..registry import reason
from ..replay.frame import prediction_notes
from ..signals import ACTUATORS, PSI, STATES, X, Y
from ..specs import Spec, spec_of
from .models import ModelFacts
from .task import BOTH, MEASURED, SIMULATED, Task
from .work import FoldData

_SUFFIX = "-simulated"


def simulate_like(model: Any, data: Dataset, device: str | None = None) -> Dataset:
    """Simulated twin of a data set: every run from its measured start with its recorded inputs, to its end.

    Ids, metadata, times and inputs of the runs are those of `data`. The states are those of the model. Where `data`
    records commands only, the actuators repeat them in the twin, too.

    Args:
        model: a model that needs no fit: the folder of a saved model, "sim.py:simulate", a function, "ship.fmu",
            "oracle", or "physics" as the particulars of the ship give it (`Physics.of_particulars`).
        data: the measured runs.
        device: "cpu", "cuda" or "cuda:1", where the model has a choice.

    Raises:
        InputError: the model must be fitted first, or cannot take these data.
        WorkError: the model fails on a run, or its states are not finite.
    """
    spec = spec_of(model)
    with nullcontext() if spec.class_name is None or spec.path is None else on_import_path(spec.path):
        ready = _ready(spec, data, device)
        states = _rollouts(ready, spec, data)
    source = f"Simulated by {spec.text} from starts and inputs of '{data.name}' (fingerprint {data.fingerprint})."
    note = f"simulated by {spec.text}, not measured"
    return replace(
        data.with_runs(replace(run, states=own) for run, own in zip(data.runs, states, strict=True)),
        name=data.name[: LONGEST - len(_SUFFIX)] + _SUFFIX,
        source=f"{source} {data.source}".strip(), simulation=None, derived=(), notes=(*data.notes, note),
    )  # fmt: skip


def _ready(spec: Spec, data: Dataset, device: str | None) -> Any:
    """Model that can predict the runs of `data` without having been fitted on them."""
    model = make_predictor(spec, device)
    if spec.saved:
        check_origin(spec.text, getattr(model, "origin", None), data)
        return model
    if spec.name == "physics" and spec.path is None and spec.given is None and not spec.effects:
        return model.of_particulars(data)
    if learns(spec, model):
        raise InputError(
            f"model '{spec.text}' must be fitted before it can simulate. Accepted: a saved model, a simulator "
            "(sim.py:simulate, or a class with learns = False), ship.fmu, oracle, or physics. Fit it with "
            "`shipbench run` on other trials, and give cells/<dataset>/<model>/fold0-seed0/model."
        )
    refusal = getattr(model, "skip", None)
    if callable(refusal) and (why := refusal(data)):
        raise InputError(f"model '{spec.text}' cannot simulate these runs: {why}. Give another model.")
    model.fit(data, None, seed=0)  # takes ship, sample time and inputs
    return model


def _rollouts(model: Any, spec: Spec, data: Dataset) -> list[np.ndarray]:
    """States (samples, 10) of every run, the first being the measured start."""
    whole, found = Context.of(data), [run.states[:1] for run in data.runs]
    for samples in sorted({len(run) for run in data.runs} - {1}):
        rows = [i for i, run in enumerate(data.runs) if len(run) == samples]
        s0 = np.stack([data.runs[i].states[0] for i in rows])
        U = np.stack([data.runs[i].inputs[:-1] for i in rows])
        try:
            S = np.array(predicted(model, s0, U, None, whole.rows(rows)), dtype=float)
            if S.shape != (*U.shape[:2], len(STATES)):
                raise ValueError(f"the prediction has shape {S.shape}; accepted: {(*U.shape[:2], len(STATES))}")
        except ShipbenchError:
            raise
        except Exception as error:  # a simulator of the user's own may raise anything
            names = ", ".join(data.runs[i].id for i in rows[:3])
            raise WorkError(f"{spec.text} fails on {len(rows)} runs ({names}): {reason(error)}.") from error
        for i, states in zip(rows, S, strict=True):
            found[i] = _checked(np.concatenate([found[i], states]), data.runs[i], spec)
            if data.actuators == "commanded":
                found[i][:, ACTUATORS] = data.runs[i].states[:, ACTUATORS]
        if notes := prediction_notes(S, [data.runs[i] for i in rows], data.ship, data.dt):
            raise InputError(f"the states of {spec.text} are no twin of '{data.name}': {notes[0]}")
    return found


def _checked(states: np.ndarray, run: Run, spec: Spec) -> np.ndarray:
    """States with a continuous heading."""
    bad = np.argwhere(~(np.abs(states) <= LARGEST))
    if len(bad):
        k, j = bad[0]
        raise WorkError(
            f"{spec.text} diverges in run '{run.id}': {STATES[j]} is {states[k, j]} {run.t[k] - run.t[0]:g} s after "
            f"the start. Accepted: finite states, at most {LARGEST:g} in size. Give another model, or shorter runs."
        )
    states[:, PSI] = continuous(states[:, PSI])
    return states


def mean_distance(twin: Dataset, data: Dataset) -> float:
    """Mean distance between the positions of the twins and of the measured runs [m], over time and then over runs."""
    gaps = [a.states[:, [X, Y]] - b.states[:, [X, Y]] for a, b in zip(twin.runs, data.runs, strict=True)]
    return float(np.mean([np.hypot(*gap.T).mean() for gap in gaps]))


def write_twin(twin: Dataset, folder: Path) -> None:
    """Write a twin as a data set; an older one of the same name is replaced.

    Raises:
        InputError: the folder holds another data set, such as the trial itself, or cannot be written.
    """
    there = folder / "dataset.toml"
    if there.exists() and (other := read_description(there).name) != twin.name:
        raise InputError(
            f"{folder} holds the data set '{other}'; accepted: a new folder, or an older twin. Give another one with "
            f"{option('--out', 'out=FOLDER')}."
        )
    write_dataset(twin, folder)


def check_twins(twin: Dataset, data: Dataset) -> None:
    """Check that `twin` holds a simulated run for every run of `data`: same ship, sample time, inputs and starts.

    Raises:
        InputError: it does not; the first difference is named.
    """
    own = {run.id: run for run in twin.runs}
    wrong = ""
    if twin.ship != data.ship:
        wrong = f"its ship is '{twin.ship.name}' with other particulars than '{data.ship.name}'"
    elif twin.dt != data.dt:
        wrong = f"it is sampled at {twin.dt:g} s, the trial at {data.dt:g} s"
    elif twin.inputs != data.inputs:
        wrong = f"its inputs are {', '.join(twin.inputs)}, those of the trial {', '.join(data.inputs)}"
    elif twin.actuators != data.actuators:
        wrong = f"its actuators are {twin.actuators}, those of the trial {data.actuators}"
    elif missing := [run.id for run in data.runs if run.id not in own]:
        wrong = f"it lacks {len(missing)} of {len(data)} runs, such as '{missing[0]}'"
    elif different := [(run.id, what) for run in data.runs if (what := _differs(own[run.id], run))]:
        wrong = f"{len(different)} of {len(data)} runs differ: '{different[0][0]}' has {different[0][1]}"
    elif all(np.array_equal(own[run.id].states, run.states) for run in data.runs):
        wrong = "its states are the measured ones"
    if wrong:
        raise InputError(
            f"simulated = '{twin.name}' is no twin of data set '{data.name}': {wrong}. Accepted: the same runs, "
            "simulated. Make it: shipbench data simulate MODEL --like TRIAL --out FOLDER."
        )


def _differs(twin: Run, run: Run) -> str:
    """Difference that a twin must not have, or ""."""
    if not np.array_equal(twin.t, run.t):
        return f"{len(twin)} samples, {len(run)} in the trial" if len(twin) != len(run) else "other times"
    if not np.array_equal(twin.inputs, run.inputs):
        return "other inputs"
    return "" if np.array_equal(twin.states[0], run.states[0]) else "another start"


def twin_windows(twin: Dataset, data: Dataset, task: Task) -> dict[str, Run]:
    """Windows of the twins, by the ids of the training windows that `make_folds` cuts of the measured runs.

    Their metadata are those of the measured run, so that a group has its twins among its own.
    """
    own, steps = {run.id: run for run in twin.runs}, task.steps(data.dt)
    return {
        window.id: window
        for run in data.runs
        for window in replace(run, states=own[run.id].states).windows(task.history(data.dt) + steps + 1, steps)
    }


def trained_on(choice: str, fold: FoldData, twins: Mapping[str, Run], warm: bool) -> FoldData:
    """Data of a fold for a model that is trained on "measured", "simulated" or "simulated+measured" runs.

    Twins of training runs train, twins of validation runs validate. Twins of scored runs take no part. With both, a
    model with a warm start is trained on the twins first; another is fitted on both together and validated on measured
    runs.

    Args:
        choice: one of `TRAIN_ON`.
        fold: the measured data.
        twins: window of the twin by the id of the measured one.
        warm: whether the model has a warm start.
    """
    if choice == MEASURED:
        return fold
    train = _of_twins(fold.train, twins)
    valid = None if fold.valid is None else _of_twins(fold.valid, twins)
    if choice == SIMULATED:
        return replace(fold, train=train, valid=valid)
    if warm:
        return replace(fold, before=(train, valid))
    named = [replace(run, id=f"{run.id[:50]} (simulated {i})") for i, run in enumerate(train.runs)]
    return replace(fold, train=fold.train.with_runs([*fold.train.runs, *named]))


def _of_twins(data: Dataset, twins: Mapping[str, Run]) -> Dataset:
    return data.with_runs(twins[run.id] for run in data.runs)


def training_notes(task: Task, specs: Sequence[Spec], facts: Sequence[ModelFacts], twin: Dataset) -> tuple[str, ...]:
    """Notes on the twin, and on how each model learns from simulated and measured runs."""
    notes = [f"simulated runs: data set '{twin.name}' (fingerprint {twin.fingerprint}). {twin.source}".strip()]
    known = list(zip(specs, facts, strict=True))
    if BOTH in task.train_on:
        told = {
            "trained on the simulated runs, then on the measured ones": [s for s, f in known if f.learns and f.warm],
            "fitted on both together, since they have no warm start": [s for s, f in known if f.learns and not f.warm],
        }
        notes += [f"({BOTH}) {', '.join(s.text for s in some)}: {how}" for how, some in told.items() if some]
    if fixed := [s.text for s, f in known if not f.learns]:
        notes.append(f"{', '.join(fixed)}: not fitted, one row for every choice of training runs")
    return tuple(notes)
