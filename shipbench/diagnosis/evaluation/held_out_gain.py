"""Held-out gain of identified causes: open-loop rollouts of held-out runs.

Selection and fits are repeated on every training part.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ...estimation.between_ships import STRUCTURE
from ...estimation.budget import is_spent
from ...estimation.coefficients import FREE, NUM_BASE, NUM_HULL
from ...estimation.forward import Plant
from ...estimation.linearisation import Point, Scales
from ...estimation.open_loop import Rollout, cost, distance, errors, rolled, rollout_plant, sizes
from ...estimation.term import Term
from ...physics.actuators import Gear
from ...records import Dataset
from ..result import Gain
from ..thresholds import THRESHOLDS


@dataclass(frozen=True)
class Extension:
    """Addition to the baseline model by a diagnosis: terms with first guesses, the hull, changed actuator dynamics."""

    terms: tuple[Term, ...] = ()
    values: tuple[np.ndarray, ...] = ()
    hull: bool = False
    gears: dict[str, Gear] | None = None


def horizon(L: float) -> float:
    """Longest rollout [s] of a ship of length L [m] (Froude-scaled)."""
    return THRESHOLDS.value("run_duration") * (L / 130.0) ** 0.5


def plain_base() -> np.ndarray:
    """Base parameters of eq. (2) alone: the differences of `Structure` are removed, so that "before" is the plain
    physics model."""
    base = np.zeros(NUM_BASE)
    base[len(FREE) + NUM_HULL :] = STRUCTURE.plain()
    return base


def fit_rollout(plant: Plant, scales: Scales, extension: Extension) -> Rollout:
    """Least squares of whole rollouts over p, the identified effects (and the hull where it is named), with weak
    priors.

    Channels are weighted by the root mean square of the error before the fit, positions as one: the spread that the
    model must explain. Once the time budget is spent, the current fit is returned.
    """
    free = list(range(len(FREE) + (NUM_HULL if extension.hull else 0)))
    terms = tuple(t for t in extension.terms if not t.per_run)  # a run that was not seen has no value of its own
    start = tuple(v for t, v in zip(extension.terms, extension.values, strict=True) if not t.per_run)
    lin = rolled(plant, scales, Rollout(plain_base(), terms, start))
    weights = np.tile(1.0 / np.maximum(sizes(lin), lin.scales.noise), lin.plant.steps + 1)
    for _ in range(8):
        if is_spent():
            break
        base, own = lin.parameter_columns(free)
        J = np.concatenate([base, *own], axis=-1) * weights[None, :, None]
        J = J * np.repeat(plant.seg.mask, 6, axis=1)[..., None]
        e = errors(lin) * weights
        ok = np.isfinite(J).all(axis=(1, 2)) & np.isfinite(e).all(axis=1)
        at = np.concatenate([lin.point.base[free], *lin.point.values]) if terms else lin.point.base[free]
        prior = np.ones(len(at))
        step = np.linalg.solve(
            np.einsum("bti,btj->ij", J[ok], J[ok]) + np.diag(prior),
            np.einsum("bti,bt->i", J[ok], e[ok]) - prior * (at - _centre(free, terms)),
        )
        share, old = 1.0, cost(lin, weights)
        while True:
            trial = rolled(plant, scales, _moved(lin.point, free, terms, at + share * step))
            if cost(trial, weights) < old or share < 0.1:
                break
            share *= 0.5
        if cost(trial, weights) > 0.999 * old:
            break
        lin = trial
    return Rollout(lin.point.base, terms, lin.point.values)


def _centre(free: Sequence[int], terms: Sequence[Term]) -> np.ndarray:
    return np.concatenate([plain_base()[list(free)], np.zeros(sum(t.size for t in terms))])


def _moved(point: Point, free: Sequence[int], terms: Sequence[Term], at: np.ndarray) -> Rollout:
    base = point.base.copy()
    base[list(free)] = at[: len(free)]
    sizes = np.cumsum([len(free), *(t.size for t in terms)])
    return Rollout(base, tuple(terms), tuple(at[a:b] for a, b in pairwise(sizes)))


@dataclass(frozen=True)
class FoldGain:
    """Errors ED [m] of the test runs: of the baseline model, with the causes, and with the hull's derivatives fitted as
    well; the causes of the training runs, and whether the budget stopped their selection."""

    test: np.ndarray
    before: np.ndarray
    after: np.ndarray
    with_hull: np.ndarray
    names: tuple[str, ...]
    stopped: bool = False


def fold_gain(dataset: Dataset, test: np.ndarray, extension: Extension, plain: dict[str, Gear], hull: bool) -> FoldGain:
    """Fit the plain model, the extended one (and that with the hull) to the training runs alone, and roll all out on
    the test runs."""
    inside = set(test.tolist())
    part = dataset.with_runs([r for i, r in enumerate(dataset.runs) if i not in inside])
    rest = dataset.with_runs([r for i, r in enumerate(dataset.runs) if i in inside])
    seconds = horizon(dataset.ship.L)
    plant, held = rollout_plant(part, plain, seconds), rollout_plant(rest, plain, seconds)
    scales = Scales(plant)
    before, _ = distance(held, scales, fit_rollout(plant, scales, Extension()))
    names = tuple(t.label for t in extension.terms)
    after, driven, goal = before, plant, held
    if extension.gears:
        gears = plain | extension.gears
        driven, goal = rollout_plant(part, gears, seconds), rollout_plant(rest, gears, seconds)
    if names or extension.gears:
        after, _ = distance(goal, scales, fit_rollout(driven, scales, extension))
    with_hull = after
    if hull:
        with_hull, _ = distance(goal, scales, fit_rollout(driven, scales, replace(extension, hull=True)))
    return FoldGain(test, before, after, with_hull, names)


def summarise(before: np.ndarray, after: np.ndarray, seed: int, groups: Sequence[str]) -> Gain:
    """Paired gain with a bootstrap interval over groups of runs."""
    rng = np.random.default_rng(seed)
    place = {group: i for i, group in enumerate(dict.fromkeys(groups))}
    member = np.array([place[group] for group in groups])
    draws = rng.integers(0, len(place), (2000, len(place)))
    plain, extended = (np.bincount(member, ed)[draws].sum(axis=1) for ed in (before, after))
    relative = 1.0 - extended / np.maximum(plain, 1e-12)
    low, high = np.quantile(relative, [0.025, 0.975])
    better = int(np.sum(after < before))
    mean_b, mean_a = float(before.mean()), float(after.mean())
    return Gain(
        "ED", mean_b, mean_a, 1.0 - mean_a / max(mean_b, 1e-12), (float(low), float(high)), f"{better}/{len(before)}"
    )
