"""shipbench's data and models for code written for the package `nonlinear_benchmarks` (needs the extra
`nonlinear-benchmarks`).

There a record is `Input_output_data(u, y, sampling_time, name, state_initialization_window_length)`; here u are the
inputs U (samples, inputs) and y states (samples, outputs), both at the same times, units and signs of `signals`. A
model may see the first n samples of a test record (`state_initialization_window_length`) and is scored on the rest:

    train, test = ship_benchmark("harbour90")
    model = InputOutputModel("physics", ship=ship_of("harbour90")).fit(train)
    for record in test:
        print(RMSE(record, model.simulate(record.u, record.y[: record.state_initialization_window_length])))

Sample n - 1 is s0, the samples before it are the history, and sample n is the first that is scored: the same figures as
in a study.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from types import SimpleNamespace
from typing import Any, Self

import numpy as np

from ..bench.folds import make_folds, select_runs
from ..bench.task import make_task
from ..data.base import load_dataset
from ..errors import InputError, unknown_name
from ..extras import needed_by
from ..predictors.base import make_predictor
from ..records import Dataset, Run
from ..ship import Ship
from ..signals import COMMANDS, ENVIRONMENT, STATES
from ..specs import parse_spec

_MOTION = STATES[:6]


def ship_of(dataset: str) -> Ship:
    """Ship of a data set, by registered name or folder."""
    return load_dataset(dataset).ship


def ship_benchmark(
    dataset: str | Dataset,
    *,
    fold: int = 0,
    folds: int = 5,
    horizon_s: float = 120.0,
    history_s: float = 0.0,
    split: str = "folds",
) -> tuple[list[Any], list[Any]]:
    """Lists (train, test) of `Input_output_data`, one per window of a data set: exactly the runs of that fold of
    `shipbench run`.

    Args:
        dataset: registered name, folder or data set.
        fold, folds, split: the fold; as in a task.
        horizon_s: scored time of each record [s].
        history_s: seconds before it that a model may use beside s0; the initialization window has one sample more.

    Raises:
        InputError: nonlinear_benchmarks is not installed, or there is no such data set or fold.
    """
    data = load_dataset(dataset) if isinstance(dataset, str) else dataset
    settings = {
        "dataset": data.name,
        "models": ["hold"],
        "folds": folds,
        "horizon_s": horizon_s,
        "history_s": history_s,
        "split": split,
    }
    task = make_task(settings, "ship_benchmark")
    parts = make_folds(select_runs(data, task)[0], task)
    if not 0 <= fold < len(parts):
        raise InputError(f"fold = {fold}; accepted: 0 to {len(parts) - 1}.")
    window = task.history(data.dt) + 1
    chosen = parts[fold]
    return to_records(chosen.train.merged(chosen.valid), window), to_records(chosen.test, window)


def to_records(data: Dataset, window: int = 1) -> list[Any]:
    """Runs as `Input_output_data`: u (samples, inputs), y (samples, 10), named like the run; copies, so that nobody
    writes into `data`.

    `window`: number of first samples that a model may see; at least 1, since a rollout needs the state that it starts
    from.
    """
    with needed_by("to_records"):
        from nonlinear_benchmarks import Input_output_data
    return [Input_output_data(run.inputs.copy(), run.states.copy(), data.dt, run.id, window) for run in data.runs]


def from_records(
    records: Iterable[Any],
    ship: Ship,
    *,
    outputs: Sequence[str] = STATES,
    inputs: Sequence[str] = COMMANDS,
    name: str = "records",
) -> Dataset:
    """Data set of records whose columns are `outputs` (of y) and `inputs` (of u), in the units and signs of `signals`.

    y must hold x, y, psi, u, v, r; actuators that it lacks are taken from their commands, commands that u lacks are
    zero, and the notes say so. A record is anything with u, y and sampling_time.

    Raises:
        InputError: a column is unknown, missing or of another number than the names; records are sampled differently.
    """
    records = [records] if hasattr(records, "sampling_time") else list(records)
    for names, known in ((outputs, STATES), (inputs, (*COMMANDS, *ENVIRONMENT))):
        for column in names:
            if column not in known:
                raise unknown_name("channel", column, known)
    lacking = [s for s in _MOTION if s not in outputs]
    if lacking:
        raise InputError(
            f"outputs = {', '.join(outputs)}; {', '.join(lacking)} is missing, without which a rollout cannot "
            "start. Add it to y."
        )
    used = (*COMMANDS, *[c for c in inputs if c not in COMMANDS])
    runs = [_run(i, record, outputs, inputs, used) for i, record in enumerate(records)]
    times = {float(record.sampling_time or np.nan) for record in records}
    if len(times) != 1 or not times.copy().pop() > 0.0:
        raise InputError(
            f"sampling_time = {', '.join(str(r.sampling_time) for r in records[:5])}; accepted: one time [s] for "
            "all records."
        )
    notes = [f"{s} is not in y: taken from {c}" for s, c in zip(STATES[6:], COMMANDS, strict=True) if s not in outputs]
    notes += [f"{c} is not in u: taken as zero" for c in COMMANDS if c not in inputs]
    return Dataset(
        name,
        ship,
        times.pop(),
        tuple(runs),
        actuators="measured" if set(STATES) <= set(outputs) else "commanded",
        notes=tuple(notes),
    )


def _run(index: int, record: Any, outputs: Sequence[str], inputs: Sequence[str], used: tuple[str, ...]) -> Run:
    u, y = (np.asarray(a, dtype=float) for a in (record.u, record.y))
    u, y = (a[:, None] if a.ndim == 1 else a for a in (u, y))
    label = getattr(record, "name", "") or f"record{index}"
    if y.shape[1] != len(outputs) or u.shape[1] != len(inputs):
        wanted = f"{len(outputs)} outputs ({', '.join(outputs)}), {len(inputs)} inputs ({', '.join(inputs)})"
        raise InputError(f"record '{label}': y {y.shape}, u {u.shape}; accepted: {wanted}.")
    held = np.zeros((len(u), len(used)))
    held[:, [used.index(c) for c in inputs]] = u
    states = np.zeros((len(y), len(STATES)))
    states[:, 6:] = held[:, : len(COMMANDS)]
    states[:, [STATES.index(s) for s in outputs]] = y
    return Run(label, float(record.sampling_time or 1.0) * np.arange(len(u)), states, held, used)


class InputOutputModel:
    """Model of shipbench with the two calls of `nonlinear_benchmarks`-style code: `fit(train)` and
    `simulate(u, y_init)`.

    Args:
        spec: model spec, such as "physics", "mlp[hidden=64]" or "path/to/model.py:ClassName".
        ship: the vessel; models of physics need its dimensions.
        outputs, inputs: names of the columns of y and u, as in `from_records`.
        seed: of the fit.
    """

    def __init__(
        self, spec: str, ship: Ship, *, outputs: Sequence[str] = STATES, inputs: Sequence[str] = COMMANDS, seed: int = 0
    ) -> None:
        self.predictor = make_predictor(parse_spec(spec))
        self.ship, self.outputs, self.inputs, self.seed = ship, tuple(outputs), tuple(inputs), seed

    def fit(self, train: Any) -> Self:
        """Fit on one record or several."""
        data = from_records(train, self.ship, outputs=self.outputs, inputs=self.inputs, name="train")
        refusal = getattr(self.predictor, "skip", None)
        if callable(refusal) and (why := refusal(data)):
            raise InputError(f"the model cannot be fitted here: {why}.")
        self._dt = data.dt
        self.predictor.fit(data, None, seed=self.seed)
        return self

    def simulate(self, u: np.ndarray, y_init: np.ndarray) -> np.ndarray:
        """Outputs y (samples, outputs) under the inputs u (samples, inputs), of which the first n are `y_init`
        (n, outputs), n >= 1, as given.

        Raises:
            InputError: `fit` was not called, or the shapes do not fit.
        """
        if not hasattr(self, "_dt"):
            raise InputError("simulate was called before fit; fit the model first.")
        n = len(y_init)
        if not 1 <= n < len(u):
            raise InputError(f"y_init has {n} samples, u {len(u)}; accepted: at least 1 and fewer than u.")
        known = SimpleNamespace(u=np.asarray(u)[:n], y=np.asarray(y_init), sampling_time=self._dt)
        later = SimpleNamespace(
            u=np.asarray(u)[n - 1 :], y=np.zeros((len(u) - n + 1, len(self.outputs))), sampling_time=self._dt
        )
        run, rest = from_records([known, later], self.ship, outputs=self.outputs, inputs=self.inputs).runs
        U = rest.inputs[:-1]
        history = (run.states[None, :-1], run.inputs[None, :-1]) if n > 1 else None
        S = np.asarray(self.predictor.predict(run.states[None, -1], U[None], history))[0]
        return np.concatenate([np.asarray(y_init, dtype=float), S[:, [STATES.index(s) for s in self.outputs]]])
