"""Errors of three models on held-out runs: the ship file's, the calibrated ship's, and the same with the causes.

They are fitted to the training runs of a fold alone, in the way of the predictor `calibrated`, and scored by the
benchmark's ED.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...estimation.actuator_fit import fit_actuators
from ...estimation.calibration import (
    Calibration,
    calibration_of,
    calibration_on_regressions,
    calibration_without,
)
from ...estimation.coefficients import NUM_BASE
from ...estimation.gears import gears_of
from ...estimation.laplace import Fit
from ...estimation.linearisation import Scales
from ...estimation.open_loop import OpenLoop, Rollout, distance, rollout_plant
from ...estimation.refinement import refined_on, refinement_length
from ...physics.actuators import Gear
from ...records import Dataset
from ..result import Calibrated, Gain
from ..thresholds import THRESHOLDS

_VALIDATION = 9
"""Groups of training runs of which one decides whether rollouts refine a calibration, as in `shipbench run`."""
_DRAWS = 2000
AS_IN_FILE = Rollout(np.zeros(NUM_BASE), (), ())
"""The ship file's model: every coefficient at its prior mean."""


def horizon(L: float) -> float:
    """Longest rollout [s] of a ship of length L [m] (Froude-scaled)."""
    return THRESHOLDS.value("run_duration") * (L / 130.0) ** 0.5


@dataclass(frozen=True)
class FoldErrors:
    """Errors ED [m] of the held-out runs of a fold.

    Attributes:
        test: indices of the runs.
        file: errors of the ship file's model.
        calibrated: of the calibrated ship.
        with_causes: of the calibrated ship with the causes of the training runs.
        on_regressions: with the causes and a hull that follows the regressions, without refinement on rollouts;
            own_hull: the same with the calibrated hull.
        stopped: whether the budget ended the fits.
    """

    test: np.ndarray
    file: np.ndarray
    calibrated: np.ndarray
    with_causes: np.ndarray
    on_regressions: np.ndarray
    own_hull: np.ndarray
    stopped: bool = False


def fold_errors(dataset: Dataset, test: np.ndarray, null: Fit, final: Fit, gears: dict[str, Gear]) -> FoldErrors:
    """Errors of the held-out runs.

    Args:
        test: indices of the held-out runs.
        null: baseline model of the other runs.
        final: the same with their causes.
        gears: actuator dynamics that are causes, by actuator.
    """
    inside = set(test.tolist())
    train = dataset.with_runs([r for i, r in enumerate(dataset.runs) if i not in inside])
    held = dataset.with_runs([r for i, r in enumerate(dataset.runs) if i in inside])
    ordinary = recorded_gears(train, null)
    changed = ordinary | gears

    def errors(model: OpenLoop, driven: dict[str, Gear]) -> np.ndarray:
        plant = rollout_plant(held, driven, horizon(dataset.ship.L))
        return distance(plant, Scales(plant), model)[0]

    def moved(model: Calibration) -> Calibration:
        return _beginning_in(model, train, held, dataset)

    own = errors(model_of(train, null, ordinary), ordinary)
    after = own
    if final.model.terms or gears:
        after = errors(moved(model_of(train, final, changed)), changed)
    alike, other = (errors(moved(of_hull(final)), changed) for of_hull in (calibration_on_regressions, calibration_of))
    return FoldErrors(test, errors(AS_IN_FILE, ordinary), own, after, alike, other)


def model_of(train: Dataset, found: Fit, gears: dict[str, Gear]) -> Calibration:
    """Calibration of a fit to the training runs, refined on rollouts where that pays on some of them.

    Causes that begin with a run are left as they are: runs before and after would have to be refined separately.
    """
    model = calibration_of(found)
    names = list(dict.fromkeys(r.group for r in train.runs))[::_VALIDATION]
    validating = [i for i, r in enumerate(train.runs) if r.group in names]
    if len(validating) == len(train) or any(t.since is not None for t in model.terms):
        return model
    valid = train.with_runs([train.runs[i] for i in validating])
    rest = train.with_runs([r for r in train.runs if r.group not in names])
    start = calibration_without(found, validating)
    return refined_on(train, gears, refinement_length(rest, valid, gears, start), model)


def _beginning_in(model: Calibration, known: Dataset, wanted: Dataset, all_runs: Dataset) -> Calibration:
    """Calibration whose causes that begin with a run of `known` begin with the next one of `wanted`, in the order of
    `all_runs`."""
    place = {r.id: i for i, r in enumerate(all_runs.runs)}
    places = [place[r.id] for r in wanted.runs]

    def since(run: int) -> int:
        return sum(i < place[known.runs[run].id] for i in places)

    terms = tuple(t if t.since is None else replace(t, since=since(t.since)) for t in model.terms)
    return replace(model, terms=terms)


def recorded_gears(dataset: Dataset, null: Fit) -> dict[str, Gear]:
    """Actuator dynamics without a cause: from the records, or those of the fit where there are none."""
    if dataset.actuators == "commanded":
        return dict(null.plant.ordinary)
    batch = dataset.windows(min(len(run) for run in dataset.runs) - 1).batch()
    return gears_of(fit_actuators(batch, dataset.dt))


def on_fitted_runs(dataset: Dataset, null: Fit, seed: int) -> Calibrated:
    """Errors of the ship file's model and of the baseline model `null` on the runs that were fitted."""
    plant = rollout_plant(dataset, recorded_gears(dataset, null), horizon(dataset.ship.L))
    models: tuple[OpenLoop, ...] = (AS_IN_FILE, calibration_of(null))
    before, after = (distance(plant, Scales(plant), model)[0] for model in models)
    return of_runs(dataset, before, after, seed, held_out=False)


def of_runs(dataset: Dataset, before: np.ndarray, after: np.ndarray, seed: int, held_out: bool = True) -> Calibrated:
    """Errors (N,) of every run, by the ship file's and by the calibrated model, as one statement."""
    interval = mean_interval(after, seed, [run.group for run in dataset.runs])
    longest = min(horizon(dataset.ship.L), max(float(run.t[-1] - run.t[0]) for run in dataset.runs))
    return Calibrated(float(before.mean()), float(after.mean()), interval, longest, held_out)


def summarise(before: np.ndarray, after: np.ndarray, seed: int, groups: Sequence[str]) -> Gain:
    """Paired gain with a bootstrap interval over groups of runs."""
    plain, extended = (sums for sums in _drawn(np.stack([before, after]), seed, groups)[0])
    relative = 1.0 - extended / np.maximum(plain, 1e-12)
    low, high = np.quantile(relative, [0.025, 0.975])
    better = int(np.sum(after < before))
    mean_b, mean_a = float(before.mean()), float(after.mean())
    return Gain(
        "ED",
        mean_b,
        mean_a,
        1.0 - mean_a / max(mean_b, 1e-12),
        (float(low), float(high)),
        f"{better}/{len(before)}",
        mean_interval(after, seed, groups),
    )


def mean_interval(errors: np.ndarray, seed: int, groups: Sequence[str]) -> tuple[float, float]:
    """95 % interval of the mean of errors (N,), bootstrap over groups of runs."""
    (sums,), sizes = _drawn(errors[None], seed, groups)
    low, high = np.quantile(sums / sizes, [0.025, 0.975])
    return float(low), float(high)


def _drawn(values: np.ndarray, seed: int, groups: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
    """Sums (C, draws) of values (C, N) over groups drawn with replacement, and the numbers of runs in them (draws,)."""
    rng = np.random.default_rng(seed)
    place = {group: i for i, group in enumerate(dict.fromkeys(groups))}
    member = np.array([place[group] for group in groups])
    draws = rng.integers(0, len(place), (_DRAWS, len(place)))
    return np.stack([np.bincount(member, v)[draws].sum(axis=1) for v in values]), np.bincount(member)[draws].sum(axis=1)
