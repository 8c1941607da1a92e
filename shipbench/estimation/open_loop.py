"""Open-loop rollouts of fitted models: no latent force, initial states as measured."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from ..physics.actuators import Gear
from ..records import Dataset
from ..ship import complete
from .forward import Plant, cut
from .linearisation import Linearisation, Point, Scales
from .resampling import averaged
from .term import Term


class OpenLoop(Protocol):
    """Model that can be rolled out: coefficients, effects and their amplitudes."""

    @property
    def base(self) -> np.ndarray: ...

    @property
    def terms(self) -> tuple[Term, ...]: ...

    @property
    def values(self) -> tuple[np.ndarray, ...]: ...


@dataclass(frozen=True)
class Rollout:
    """Fitted open-loop model: base parameters and effects."""

    base: np.ndarray
    terms: tuple[Term, ...]
    values: tuple[np.ndarray, ...]


def rollout_plant(dataset: Dataset, gears: dict[str, Gear], seconds: float) -> Plant:
    """Forward model with segments of at most `seconds`, fast records averaged.

    The commands drive it through `gears`, from the initial positions of the actuators.
    """
    ship, dataset = complete(dataset.ship), averaged(dataset)
    segments = cut(dataset, max(20, round(seconds / dataset.dt)))
    return Plant(ship, replace(segments, commanded=True), gears=gears, recorded=not segments.commanded)


def rolled(plant: Plant, scales: Scales, model: OpenLoop) -> Linearisation:
    """Linearisation of the rollout from initial states at which the model's sensors read the first measurement."""
    B = len(plant.seg.run)
    point = Point(model.base, np.zeros((B, 6)), np.zeros((B, plant.knots, 3)), model.terms, model.values)
    lin = Linearisation(plant, scales, point)
    if not any(a.effect.enters == "sensor" for a in lin.now):
        return lin
    eta = -(lin.predicted[:, 0] - plant.seg.states[:, 0, :6]) / scales.eta
    return Linearisation(plant, scales, replace(point, eta=eta))


def errors(lin: Linearisation) -> np.ndarray:
    """Errors (B, T) of a rollout, the channel last; zero beyond the end of a segment."""
    e = np.where(lin.plant.seg.mask[..., None], lin.plant.seg.states[..., :6] - lin.predicted, 0.0)
    return e.reshape(len(e), -1)


def sizes(lin: Linearisation) -> np.ndarray:
    """Root mean square errors (6,); positions are one channel."""
    e = errors(lin).reshape(len(lin.motion), -1, 6)
    size = np.sqrt(np.nanmean(np.where(np.isfinite(e), e, np.nan) ** 2, axis=(0, 1)))
    size[:2] = np.sqrt(np.mean(size[:2] ** 2))
    return size


def cost(lin: Linearisation, weights: np.ndarray) -> float:
    """Sum of weighted squared errors. Diverged segments count as errors of a hundred times the typical one."""
    with np.errstate(all="ignore"):
        e = np.clip(np.nan_to_num(errors(lin) * weights, nan=100.0, posinf=100.0, neginf=-100.0), -100.0, 100.0)
    return float(np.sum(e**2))


def distance(plant: Plant, scales: Scales, model: OpenLoop) -> tuple[np.ndarray, np.ndarray]:
    """Mean ED [m] of every run (N,), without the initial sample, and the predicted motion (B, K + 1, 6)."""
    lin = rolled(plant, scales, model)
    with np.errstate(all="ignore"):
        ed = np.hypot(*np.moveaxis(lin.predicted[..., :2] - plant.seg.states[..., :2], -1, 0))
    ed = np.nan_to_num(ed, nan=1e3 * plant.c.L, posinf=1e3 * plant.c.L)
    scored = plant.seg.mask.copy()
    scored[:, 0] = False
    total, count = np.zeros(plant.seg.runs), np.zeros(plant.seg.runs)
    np.add.at(total, plant.seg.run, np.sum(np.where(scored, ed, 0.0), axis=1))
    np.add.at(count, plant.seg.run, scored.sum(axis=1))
    return total / np.maximum(count, 1), lin.predicted
