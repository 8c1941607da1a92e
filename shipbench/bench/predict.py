"""Rollouts of a saved model over whole runs, as CSV for use outside the benchmark."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..predictors._band import Band, own_band
from ..predictors._saved import check_origin, runs_of_training
from ..predictors.base import make_predictor
from ..predictors.context import Context, predicted
from ..records import Dataset
from ..render.escaping import csv_text
from ..signals import MOTION, STATES
from ..specs import parse_spec
from ..storage import in_one_step
from .bands import half_width
from .task import samples

LIMITS = tuple(f"{name}_{end}" for name in STATES[MOTION] for end in ("low", "high"))
"""Columns of the limits: x_low, x_high, y_low and so on to r_high, in the units of x to r."""

_WIDER = " The model was fitted on {} of the {} runs: there they can be too wide."


class Rollout(NamedTuple):
    """Run id, t (K + 1,) [s], states (K + 1, 10), the first being the recorded start, and the limits (K + 1, 12) in the
    order of `LIMITS` where the model has a band: NaN at the start and beyond the band's horizon."""

    run: str
    t: np.ndarray
    states: np.ndarray
    limits: np.ndarray | None = None


def predict_runs(
    model: str, dataset: Dataset, horizon_s: float | None = None, device: str | None = None,
    tell: Callable[[str], None] = lambda line: None,
) -> list[Rollout]:  # fmt: skip
    """Roll the saved model in the folder `model` out from the first sample of every run, to its end or over `horizon_s`
    seconds, on `device` (see `check_device`).

    Where the model has a band, `tell` gets one line on its limits: how far they reach and for what they hold, or why
    they are left out.

    Raises:
        InputError: the folder is no saved model, its inputs or sample time are not those of the data set, a run is
            shorter than the horizon, its band is damaged or of other weights, or the device is not here.
    """
    spec = parse_spec(model)
    if not spec.saved:
        raise InputError(
            f"'{model}' is not a saved model; give a folder that holds model.json "
            "(cells/<dataset>/<model>/fold0-seed0/model)."
        )
    predictor = make_predictor(spec, device)
    origin = getattr(predictor, "origin", None)
    check_origin(model, origin, dataset)
    known = 0 if origin is None else runs_of_training(origin, dataset)
    if horizon_s is not None and not 0.0 < horizon_s < np.inf:
        raise InputError(f"--horizon {horizon_s:g}; accepted: a positive number of seconds.")
    asked = None if horizon_s is None else samples(horizon_s, dataset.dt, "--horizon")
    band = own_band(predictor)
    if band is not None and (reason := band.misfit(predictor, 0, dataset.dt)):
        tell(f"Limits are left out: {reason}.")
        band = None
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
        limits = None if band is None else _limits(band, predictor, run.states[0], run.inputs[:steps], S)
        rollouts.append(Rollout(run.id, run.t[: steps + 1], np.concatenate([run.states[:1], S]), limits))
    if band is not None:
        tell(_about(band, max(len(r.t) - 1 for r in rollouts)) + (_WIDER.format(known, len(dataset)) if known else ""))
    return rollouts


def _limits(band: Band, model: Any, s0: np.ndarray, U: np.ndarray, S: np.ndarray) -> np.ndarray:
    """Limits (K + 1, 12) of one rollout, in the order of `LIMITS`."""
    width = half_width(band, model, s0[None], U[None])[0]
    ends = np.stack([S[:, MOTION] - width, S[:, MOTION] + width], axis=-1)
    return np.concatenate([np.full((1, len(LIMITS)), np.nan), ends.reshape(len(S), len(LIMITS))])


def _about(band: Band, longest: int) -> str:
    """Line on the limits of rollouts of at most `longest` time steps."""
    seconds = min(longest, len(band.factor)) * band.dt
    return (
        f"Limits: {LIMITS[0]} to {LIMITS[-1]} over the first {seconds:g} s. They hold {100 * band.coverage:g} % of the "
        "measurements on average over runs like those fitted, not for each manoeuvre."
    )


def write_csv(rollouts: list[Rollout], path: str | Path) -> None:
    """Write columns trajectory, t and the ten states (SI, `n` in rpm), and `LIMITS` where there are some, atomically;
    run names as in `csv_text`. A limit that is not known is empty."""
    bounded = any(rollout.limits is not None for rollout in rollouts)
    path = Path(path)
    with in_one_step(path) as part, part.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(["trajectory", "t", *STATES, *(LIMITS if bounded else ())])
        for run, t, states, limits in rollouts:
            ends = np.empty((len(t), 0)) if limits is None else limits
            writer.writerows(
                [
                    csv_text(run), f"{time:.10g}", *(f"{value:.10g}" for value in state),
                    *(f"{value:.10g}" if np.isfinite(value) else "" for value in row),
                ]
                for time, state, row in zip(t, states, ends, strict=True)
            )  # fmt: skip
