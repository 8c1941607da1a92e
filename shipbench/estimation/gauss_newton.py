"""Joint fit of base parameters, effects, initial states and latent force, with the variances of force and noise (an
iterated smoother)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .budget import count, is_spent
from .coefficients import NUM_BASE
from .forward import Plant
from .gram import Hyper
from .laplace import (
    Fit,
    Model,
    at_point,
    by_segment,
    leaning,
    objective,
    once_followed,
    point_from,
    settle,
    suiting,
)
from .linearisation import Linearisation, Point, Scales
from .term import Term
from .thresholds import THRESHOLDS

_FREE_STEPS = 5
"""Number of first steps, which may raise the cost a little; later ones must lower it."""
_LEAST_SHARE, _MAY_FOLLOW = 0.05, 100.0
"""Least share of a step before it is given up; factor of the cost above which no latent force could compensate it."""
_AT_REST, _AT_REST_EVIDENCE = 0.5, 0.1
"""Excess of the cost over the linear model's prediction, and change of the evidence, at which a fit has converged."""


def fit(
    plant: Plant, scales: Scales, model: Model, point: Point, hyper: Hyper, log_tau2: dict[int, float] | None = None, *,
    iterations: int = 20,
    candidates: Sequence[Term] = (), guess: np.ndarray | None = None, hope: float = -np.inf, rival: float = -np.inf,
    far: bool = False, begun: tuple[Linearisation, Fit] | None = None, free_steps: int = _FREE_STEPS,
) -> Fit:  # fmt: skip
    """Gauss-Newton with EM for the variances, from `point` to convergence.

    `point` may lack the last terms of `model`: they start at zero. The fit stops early when its predicted log evidence
    is below `hope`, or when the time budget is spent. After the free steps it stops when the prediction is below
    `rival` by more than twice its last change.

    A step is at first halved only where the cost diverges. The cost of a step that is right for the parameters rises
    until the latent force has followed; otherwise the path would end where parameters compensate each other. The best
    point of the path is kept, by its evidence once the force has followed. If that point is worse, each step must lower
    the cost from the first on. `candidates` get columns at the best point. far: `point` is that of an `Origin`; begun:
    its linearisation, and a fit there whose products hold.
    """
    log_tau2, began = dict(log_tau2 or {}), (hyper, dict(log_tau2 or {}))
    if len(point.terms) < len(model.terms):
        new = [np.zeros((plant.seg.runs, t.size) if t.per_run else t.size) for t in model.terms[len(point.terms) :]]
        point = Point(point.base, point.eta, point.w, model.terms, (*point.values, *new))
    lin, seen = begun or (Linearisation(plant, scales, point, guess), None)
    best, before, promised, stale, early, foreseen = None, -np.inf, -np.inf, 0, np.nan, np.inf
    for number in range(iterations):
        free = number < free_steps  # later, variances move little, or two linearisations may alternate for ever
        found = settle(lin, model, hyper, log_tau2, leap=np.inf if free else 0.3, seen=seen, far=far and not number)
        if not (number or far) and found.excess < THRESHOLDS.value("unconverged_excess"):
            free_steps = 0
        if number < 2:
            early = found.promise
        if number and found.promise < hope:
            return found
        if not free and found.promise + 2.0 * abs(found.promise - foreseen) < rival:
            return found
        foreseen = found.promise
        hyper, log_tau2 = found.hyper, found.log_tau2
        worth = float(np.nan_to_num(found.evidence if free else found.evidence_followed, nan=-np.inf))
        if free or best is None or worth > best[0] + _AT_REST_EVIDENCE or found.promise > promised + _AT_REST_EVIDENCE:
            stale = 0
        else:
            stale += 1
        promised = -np.inf if free else max(promised, found.promise)
        if best is None or worth > best[0]:
            best = worth, found, lin
        count()
        # it stops after three halved steps without a better point: two linearisations may alternate for ever
        if is_spent() or stale == 3 or (found.excess < _AT_REST and abs(found.evidence - before) < _AT_REST_EVIDENCE):
            break
        before = found.evidence
        after = _step(lin, found, number + 1 < free_steps, 0.5**stale) if number < iterations - 1 else None
        if after is None:
            break
        lin, seen = after, None
    assert best is not None
    found, lin = _followed(*best[1:])
    if free_steps and found.excess > THRESHOLDS.value("led_astray") and not is_spent():
        again = fit(
            plant, scales, model, point, *began, iterations=iterations, candidates=candidates, guess=guess, hope=hope,
            rival=rival, far=far, begun=begun, free_steps=0,
        )  # fmt: skip
        if again.evidence > found.evidence:
            return again
    return replace(
        settle(lin, model, found.hyper, found.log_tau2, candidates, leap=0.0) if candidates else found, early=early
    )


def looking_at(found: Fit, candidates: Sequence[Term]) -> Fit:
    """Fit `found` with columns of `candidates`; iterated further if it has not converged on the linearisation with
    which fits begin."""
    plant, scales, model, hyper, log_tau2 = found.plant, found.scales, found.model, found.hyper, found.log_tau2
    again = settle(
        Linearisation(plant, scales, found.point, found.motion), model, hyper, log_tau2, candidates, leap=0.0
    )
    if again.excess < _AT_REST or is_spent():
        return again
    return fit(plant, scales, model, found.point, hyper, log_tau2, candidates=candidates, guess=found.motion)


def _step(lin: Linearisation, found: Fit, free: bool, share: float) -> Linearisation | None:
    """Step towards the optimum of the linear model.

    None where no share of the step, from `share` down, is better (the first steps are `free`). A point is better if its
    cost is lower, or would be once the latent force has followed. With exact sensors the trajectory of a new point
    nearly always costs more than the old one, whose latent force has been fitted.
    """
    plant, scales, model, may_rise = lin.plant, lin.scales, found.model, 1.1 if free else 1.0
    target = within_bounds(plant, scales, point_from(model, lin.point, found.solution, found.prior, found.estimate))
    at = objective(lin, model, found.hyper, found.log_tau2, found.gram)
    followed = at_point(found, lin.point) + float(np.sum(found.reduced.logdet))
    while not is_spent():
        part = between(lin.point, target, share)
        trial = Linearisation(plant, scales, part, lin.towards(part), coarse=free)
        cost = objective(trial, model, found.hyper, found.log_tau2, found.gram)
        if cost + leaning(found, part) < may_rise * at:
            return trial
        may_follow = cost < _MAY_FOLLOW * at
        if may_follow and once_followed(trial, model, found.hyper, found.log_tau2) < followed:
            return trial
        share *= 0.5
        if share < _LEAST_SHARE and free and may_follow:
            return trial
        if share < (1e-3 if free else _LEAST_SHARE):
            break
    return None


def _followed(found: Fit, lin: Linearisation) -> tuple[Fit, Linearisation]:
    """Fit with the initial states and latent force that fit the parameters of the point best; the step of a segment is
    halved while its cost rises."""
    for _ in range(6):
        if found.excess < _AT_REST or is_spent():
            break
        here, (eta, w), before = lin.point, suiting(found, lin.point), by_segment(lin, found.hyper, found.gram)
        share = np.ones(len(before))
        for _ in range(5):
            part = replace(
                here, eta=here.eta + share[:, None] * (eta - here.eta), w=here.w + share[:, None, None] * (w - here.w)
            )
            trial = Linearisation(found.plant, found.scales, part, lin.towards(part), coarse=False)
            costs = by_segment(trial, found.hyper, found.gram)
            worse = ~(costs <= before)
            if not worse.any():
                break
            share[worse] *= 0.5
        if not costs.sum() < before.sum():  # an unstable ship's trajectory may blow up from its own point
            break
        after = settle(trial, found.model, found.hyper, found.log_tau2, leap=0.0)
        gained = after.evidence - found.evidence
        if gained > 0.0:
            found, lin = after, trial
        if gained < _AT_REST_EVIDENCE:
            break
    return found, lin


def between(a: Point, b: Point, share: float) -> Point:
    """Point a + share (b - a); terms that `a` lacks start from zero."""

    def mix(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return p + share * (q - p)

    old = [a.values[i] if i < len(a.values) else np.zeros_like(v) for i, v in enumerate(b.values)]
    return Point(
        mix(a.base, b.base),
        mix(a.eta, b.eta),
        mix(a.w, b.w),
        b.terms,
        tuple(mix(p, q) for p, q in zip(old, b.values, strict=True)),
    )


def within_bounds(plant: Plant, scales: Scales, point: Point) -> Point:
    """Point with amplitudes clipped to the bounds of their effects. Amplitudes of single runs are limited by the values
    common to all runs."""
    values = []
    for term, value in zip(point.terms, point.values, strict=True):
        if term.per_run:
            values.append(value)
            continue
        unit = scales.amplitudes(term, plant.c.L)
        sized = [p for p in term.effect.sized(plant.c.L) if not p.shape]
        values.append(
            np.clip(
                value,
                [p.low / s for p, s in zip(sized, unit, strict=True)],
                [p.high / s for p, s in zip(sized, unit, strict=True)],
            )
        )
    return replace(point, values=tuple(values))


def start(plant: Plant) -> tuple[Point, Hyper]:
    """Point at the regressions, without effects and latent force."""
    B = len(plant.seg.run)
    hyper = Hyper(np.zeros(3), np.zeros(6), 12.0 * plant.froude)
    return Point(np.zeros(NUM_BASE), np.zeros((B, 6)), np.zeros((B, plant.knots, 3))), hyper


@dataclass(frozen=True)
class Origin:
    """Starting point of fits: the regressions, with trajectories kept on the measured ones by the latent force alone.

    Gauss-Newton is nearly linear from there. From another fit it may end where parameters compensate each other.
    """

    point: Point
    hyper: Hyper
    motion: np.ndarray

    @classmethod
    def of(cls, plant: Plant, scales: Scales) -> Origin:
        still, (point, hyper) = Model(hull=1e-4, base=1e-4), start(plant)
        lin = Linearisation(plant, scales, point, plant.seg.states[..., :6].copy())
        found = settle(lin, still, hyper, {})
        tracked = point_from(still, point, found.solution, found.prior, found.estimate)
        return cls(tracked, found.hyper, lin.towards(tracked))

    @classmethod
    def like(cls, plant: Plant, scales: Scales, other: Fit) -> Origin:
        """Starting point at the parameters of a fit to other pieces, trajectories kept on the measured ones as well."""
        base, terms = other.solution.mean[:NUM_BASE], other.model.terms
        point = replace(start(plant)[0], base=base, terms=terms, values=other.values)
        lin = Linearisation(plant, scales, point, plant.seg.states[..., :6].copy())
        eta, w = suiting(settle(lin, other.model, other.hyper, {}, leap=0.0), point)
        tracked = replace(point, eta=eta, w=w)
        return cls(tracked, other.hyper, lin.towards(tracked))
