"""Rollouts of a saved model over whole runs, as CSV for use outside the benchmark."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..predictors._saved import check_origin
from ..predictors.base import make_predictor
from ..predictors.context import Context, predicted
from ..records import Dataset
from ..render.escaping import csv_text
from ..signals import STATES
from ..specs import parse_spec
from ..storage import in_one_step
from .task import samples

Rollout = tuple[str, np.ndarray, np.ndarray]
"""Run id, t (K + 1,) [s] and states (K + 1, 10), the first being the recorded start."""


def predict_runs(
    model: str, dataset: Dataset, horizon_s: float | None = None, device: str | None = None
) -> list[Rollout]:
    """Roll the saved model in the folder `model` out from the first sample of every run, to its end or over `horizon_s`
    seconds, on `device` (see `check_device`).

    Raises:
        InputError: the folder is no saved model, its inputs or sample time are not those of the data set, a run is
            shorter than the horizon, or the device is not here.
    """
    spec = parse_spec(model)
    if not spec.saved:
        raise InputError(
            f"'{model}' is not a saved model; give a folder that holds model.json "
            "(cells/<dataset>/<model>/fold0-seed0/model)."
        )
    predictor = make_predictor(spec, device)
    check_origin(model, getattr(predictor, "origin", None), dataset)
    if horizon_s is not None and not 0.0 < horizon_s < np.inf:
        raise InputError(f"--horizon {horizon_s:g}; accepted: a positive number of seconds.")
    asked = None if horizon_s is None else samples(horizon_s, dataset.dt, "--horizon")
    rollouts = []
    whole = Context.of(dataset)
    for place, run in enumerate(dataset.runs):
        steps = asked or len(run) - 1
        if not 0 < steps < len(run):
            raise InputError(
                f"run '{run.id}' lasts {(len(run) - 1) * dataset.dt:g} s, the horizon is {steps * dataset.dt:g} s; "
                "give a positive --horizon "
                "that no run falls short of."
            )
        S = predicted(predictor, run.states[0], run.inputs[:steps], None, whole.rows([place]))
        rollouts.append((run.id, run.t[: steps + 1], np.concatenate([run.states[:1], S])))
    return rollouts


def write_csv(rollouts: list[Rollout], path: str | Path) -> None:
    """Write columns trajectory, t and the ten states (SI, `n` in rpm), atomically; run names as in `csv_text`."""
    path = Path(path)
    with in_one_step(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["trajectory", "t", *STATES])
        for run, t, states in rollouts:
            writer.writerows(
                [csv_text(run), f"{time:.10g}", *(f"{value:.10g}" for value in state)]
                for time, state in zip(t, states, strict=True)
            )
