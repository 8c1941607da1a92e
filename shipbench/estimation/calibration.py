"""Calibration of the whole ship: every coefficient with a prior between ships, from short pieces and from rollouts.

First the maximum of the posterior with the latent force integrated out (`calibrated`): a push that the model lacks is
then no error of a coefficient. Then, from there, least squares of open-loop rollouts (`refined`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from ..physics.actuators import Gear
from ..records import Dataset
from ..ship import complete
from .baseline import from_regressions
from .coefficients import NUM_BASE
from .forward import Plant, cut
from .gauss_newton import Origin, fit
from .laplace import Fit, Model, base_precision, point_from, settle
from .linearisation import Linearisation, Point, Scales
from .resampling import averaged
from .robust_prior import widened
from .term import Term

_PIECES, _STEPS, _NEAR = 24, 1, 1.0
"""Pieces of a first estimate; steps on all pieces from there; longest last step, in posterior standard deviations."""
_REFINEMENTS, _LEAST_GAIN, _LEAST_SHARE = 5, 3e-3, 0.1
"""Most Gauss-Newton steps of `refined`; relative decrease of its cost, and share of a step, at which it stops."""


@dataclass(frozen=True)
class Calibration:
    """Calibrated coefficients of one ship.

    Attributes:
        base: (NUM_BASE,) differences from the prior means, in prior standard deviations.
        spread: (NUM_BASE,) posterior standard deviations, in prior ones.
        widths: (NUM_BASE,) factors of the prior standard deviations, above 1 for outliers among ships.
        terms: effects in the model.
        values: their amplitudes, in typical sizes.
        value_spreads: posterior standard deviations of `values`.
    """

    base: np.ndarray
    spread: np.ndarray
    widths: np.ndarray
    terms: tuple[Term, ...] = ()
    values: tuple[np.ndarray, ...] = ()
    value_spreads: tuple[np.ndarray, ...] = ()


def estimated(plant: Plant) -> Fit:
    """First estimate without effects, from some of the pieces."""
    return widened(from_regressions(some_of(plant), Scales(plant)))


def some_of(plant: Plant) -> Plant:
    """Pieces of a first estimate, evenly spread."""
    return plant.thinned(_PIECES)


def calibrated(plant: Plant, like: Fit, terms: Sequence[Term] = ()) -> Fit:
    """Maximum of the posterior of all coefficients and the amplitudes of `terms`, from `like` on: a fit to other
    pieces, with these terms or without.

    Gauss-Newton is nearly linear from trajectories that follow the measured ones (`Origin`), so a few full steps are
    enough. Where the last one is still long, the fit with step control goes on.
    """
    scales = Scales(plant).with_background(like.hyper)
    origin, model = Origin.of(plant, scales), replace(like.model, terms=tuple(terms))
    values = like.values if like.model.terms == model.terms else tuple(np.zeros(t.size) for t in model.terms)
    start = replace(origin.point, base=like.solution.mean[:NUM_BASE], terms=model.terms, values=values)
    lin = Linearisation(plant, scales, start, origin.motion)
    found = settle(lin, model, like.hyper, {})
    for _ in range(_STEPS):
        point = point_from(model, lin.point, found.solution, found.prior, found.estimate)
        lin = Linearisation(plant, scales, point, lin.towards(point))
        found = settle(lin, model, found.hyper, {})
    last = np.abs(found.solution.mean[:NUM_BASE] - lin.point.base) / np.sqrt(np.diag(found.solution.cov)[:NUM_BASE])
    if last.max() < _NEAR:
        return found
    return fit(plant, scales, model, found.point, found.hyper, guess=found.motion)


def calibration_of(found: Fit) -> Calibration:
    """Estimates and posterior standard deviations of a fit."""
    spreads = np.sqrt(np.diag(found.solution.cov))
    edges = np.cumsum([NUM_BASE, *(t.size for t in found.model.terms)])
    return Calibration(
        found.solution.mean[:NUM_BASE], spreads[:NUM_BASE], np.asarray(found.model.widths or np.ones(NUM_BASE)),
        found.model.terms, found.values, tuple(spreads[a:b] for a, b in pairwise(edges)),
    )  # fmt: skip


def rollout_plant(dataset: Dataset, gears: dict[str, Gear], seconds: float) -> Plant:
    """Plant with segments of at most `seconds`, fast records averaged; the commands drive it through `gears`, from
    where the actuators begin."""
    ship, dataset = complete(dataset.ship), averaged(dataset)
    segments = cut(dataset, max(20, round(seconds / dataset.dt)))
    return Plant(ship, replace(segments, commanded=True), gears=gears, recorded=not segments.commanded)


def refined(plant: Plant, scales: Scales, start: Calibration) -> Calibration:
    """Least squares of open-loop rollouts over all coefficients and amplitudes, from `start` and under the same prior.

    The errors of one rollout are those of one push or of one coefficient: they count as a single observation of each
    channel, whose size is the root mean square error at `start`. Positions are one channel.
    """
    free = np.ones(NUM_BASE + sum(t.size for t in start.terms))
    free[:NUM_BASE] = base_precision(Model(widths=tuple(start.widths)))
    lin = _rolled(plant, scales, start)
    weights, before = _weights(lin), np.inf
    for _ in range(_REFINEMENTS):
        at = _stacked(start)
        old = _cost(lin, weights) + float(free @ at**2)
        if old > (1.0 - _LEAST_GAIN) * before:
            break
        base, own = lin.parameter_columns()
        J = np.concatenate([base, *own], axis=-1) * weights[:, :, None]
        e = _errors(lin) * weights
        ok = np.isfinite(J).all(axis=(1, 2)) & np.isfinite(e).all(axis=1)
        H = np.einsum("bti,btj->ij", J[ok], J[ok]) + np.diag(free)
        cov, share, before = np.linalg.inv(H), 1.0, old
        step, start = cov @ (np.einsum("bti,bt->i", J[ok], e[ok]) - free * at), _with_spreads(start, cov)
        while share > _LEAST_SHARE:
            moved = _unstacked(start, at + share * step)
            trial = _rolled(plant, scales, moved)
            if _cost(trial, weights) + float(free @ _stacked(moved) ** 2) < old:
                start, lin = moved, trial
                break
            share *= 0.5
        else:
            break
    return start


def position_errors(plant: Plant, scales: Scales, model: Calibration) -> np.ndarray:
    """Mean position error [m] of the open-loop rollout of every run (runs,), the first sample not scored."""
    lin = _rolled(plant, scales, model)
    with np.errstate(all="ignore"):
        ed = np.hypot(*np.moveaxis(lin.predicted[..., :2] - plant.seg.states[..., :2], -1, 0))
    ed = np.nan_to_num(ed, nan=1e3 * plant.c.L, posinf=1e3 * plant.c.L)
    scored = plant.seg.mask.copy()
    scored[:, 0] = False
    total, count = np.zeros(plant.seg.runs), np.zeros(plant.seg.runs)
    np.add.at(total, plant.seg.run, np.sum(np.where(scored, ed, 0.0), axis=1))
    np.add.at(count, plant.seg.run, scored.sum(axis=1))
    return total / np.maximum(count, 1)


def _stacked(model: Calibration) -> np.ndarray:
    return np.concatenate([model.base, *model.values])


def _unstacked(like: Calibration, at: np.ndarray) -> Calibration:
    edges = np.cumsum([NUM_BASE, *(t.size for t in like.terms)])
    return replace(like, base=at[:NUM_BASE], values=tuple(at[a:b] for a, b in pairwise(edges)))


def _with_spreads(like: Calibration, cov: np.ndarray) -> Calibration:
    spreads = _unstacked(like, np.sqrt(np.maximum(np.diag(cov), 0.0)))
    return replace(like, spread=spreads.base, value_spreads=spreads.values)


def _rolled(plant: Plant, scales: Scales, model: Calibration) -> Linearisation:
    """Rollouts without latent force, begun so that the sensors of the model read what was measured first."""
    B = len(plant.seg.run)
    point = Point(model.base, np.zeros((B, 6)), np.zeros((B, plant.knots, 3)), model.terms, model.values)
    lin = Linearisation(plant, scales, point)
    if not any(a.effect.enters == "sensor" for a in lin.now):
        return lin
    eta = -(lin.predicted[:, 0] - plant.seg.states[:, 0, :6]) / scales.eta
    return Linearisation(plant, scales, replace(point, eta=eta))


def _errors(lin: Linearisation) -> np.ndarray:
    seg = lin.plant.seg
    e = np.where(seg.mask[..., None] & seg.seen, seg.states[..., :6] - lin.predicted, 0.0)
    return e.reshape(len(e), -1)


def _weights(lin: Linearisation) -> np.ndarray:
    """Weights (B, T) with which the squares of a segment sum up to one for each channel."""
    e = _errors(lin).reshape(len(lin.motion), -1, 6)
    size = np.sqrt(np.nanmean(np.where(np.isfinite(e), e, np.nan) ** 2, axis=(0, 1)))
    size[:2] = np.sqrt(np.mean(size[:2] ** 2))
    count = lin.plant.seg.mask.sum(axis=1)
    by_channel = 1.0 / np.maximum(size, 1e-9) / np.sqrt(count)[:, None]
    return np.tile(by_channel, lin.plant.steps + 1)


def _cost(lin: Linearisation, weights: np.ndarray) -> float:
    """Sum of weighted squares; a segment that diverges counts as errors of a hundred times the ordinary."""
    with np.errstate(all="ignore"):
        e = np.nan_to_num(_errors(lin) * weights, nan=100.0, posinf=100.0, neginf=-100.0)
    return float(np.sum(np.clip(e, -100.0, 100.0) ** 2))
