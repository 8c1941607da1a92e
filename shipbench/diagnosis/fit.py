"""The joint fit: base parameters, effects, initial states and the latent force, with the variances of force and noise (an iterated smoother)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from .colour import Colour
from .gram import ETA_PRECISION, Gram, Hyper, Prior, Products, Reduced, Solution, accelerated, background, solve, update_force, update_noise
from .model import FREE, NUM_BASE, Columns, Linearisation, Point, Scales, Term
from .plant import NUM_HULL, Plant

_EM_CYCLES = 3
_MAY_RISE, _FREE_STEPS, _LEAST_SHARE = 1.1, 5, 0.05
"""Factor by which a step may raise the cost, on the first steps; later ones must lower it."""
_LEAP = 0.3
"""Most that the logarithm of a variance moves between those later steps: two linearisations may else call the other's variance wrong for ever."""
_AT_REST, _AT_REST_EVIDENCE = 0.5, 0.1
"""Excess of the cost over what the linear model promises, and change of the evidence, at which a fit rests."""
_LOG_FLOOR = np.log(0.1**2)
"""A channel is never taken for better than a tenth of an ordinary sensor, else the latent force follows its noise."""


@dataclass(frozen=True)
class Model:
    """Structure: terms, and how far the hull may lie from the regressions and the other parameters from their centres (factors of the prior
    standard deviations)."""

    terms: tuple[Term, ...] = ()
    hull: float = 1.0
    base: float = 1.0

    def prior(self, log_tau2: dict[int, float]) -> Prior:
        """Columns in the order base, own terms; candidates stay outside."""
        at, shared, precision, random, tau = NUM_BASE, list(range(NUM_BASE)), base_precision(self), [], []
        weights = list(precision)
        for i, term in enumerate(self.terms):
            columns = list(range(at, at + term.size))
            at += term.size
            if term.per_run:
                random += columns
                tau += [log_tau2.get(i, 0.0)] * term.size
            else:
                shared += columns
                weights += [1.0] * term.size
        return Prior(np.array(shared), np.array(weights), np.array(random, dtype=int), np.array(tau))


def base_precision(model: Model) -> np.ndarray:
    """Prior precisions of the base parameters in units of their spreads."""
    return np.repeat([model.base**-2, model.hull**-2, model.base**-2], [len(FREE), NUM_HULL, NUM_BASE - len(FREE) - NUM_HULL])


@dataclass(frozen=True)
class Fit:
    """A fitted model and its linearisation about `motion` (B, K + 1, 6). solution: of `prior` on `gram`; estimate, cov: of [eta, w] per segment."""

    plant: Plant
    scales: Scales
    model: Model
    point: Point
    hyper: Hyper
    log_tau2: dict[int, float]
    prior: Prior
    columns: Columns
    candidates: tuple[Term, ...]
    motion: np.ndarray
    products: Products
    gram: Gram
    reduced: Reduced
    solution: Solution
    estimate: np.ndarray
    cov: np.ndarray
    excess: float

    @property
    def evidence(self) -> float:
        """Log evidence, without constants, less the costs of the terms.

        Laplace's: with the cost that the point has, not the lower one that the linear model promises. Where the fit rests they are the same.
        """
        return self.solution.log_evidence - 0.5 * (self.excess + sum(t.cost(self.plant.seg.runs) for t in self.model.terms))

    @property
    def values(self) -> tuple[np.ndarray, ...]:
        """Estimates of the terms' amplitudes, in units of their typical sizes: (size,), or (runs, size) of a random effect."""
        return point_from(self.model, self.point, self.solution, self.prior, self.estimate).values

    def solution_without(self, index: int) -> Solution:
        """The posterior on the same linearisation with the model's index-th term left out."""
        columns, prior = self.columns_of(index), self.prior
        keep, random = ~np.isin(prior.shared, columns), ~np.isin(prior.random, columns)
        return solve(self.reduced, Prior(prior.shared[keep], prior.precision[keep], prior.random[random], prior.log_tau2[random]))

    def worth(self, index: int) -> float:
        """Twice the log evidence that the index-th term adds on this linearisation, its cost taken off."""
        gain = 2.0 * (self.solution.log_evidence - self.solution_without(index).log_evidence)
        return gain - self.model.terms[index].cost(self.plant.seg.runs)

    def columns_of(self, index: int) -> np.ndarray:
        """Shared columns of the model's index-th term."""
        at = NUM_BASE + sum(t.size for t in self.model.terms[:index])
        return np.arange(at, at + self.model.terms[index].size)


def products_of(plant: Plant, scales: Scales, point: Point, columns: Columns, extra: Sequence[np.ndarray] = ()) -> Products:
    """Products of [eta, w, base, own, candidates, extra, e]; e is the residual with everything linear added back, so that all of it competes anew."""
    B, noise = len(point.eta), np.tile(scales.noise, plant.steps + 1)
    e = (plant.seg.states[..., :6] - columns.predicted).reshape(B, -1)
    e = e + _times(columns.eta, point.eta) + _times(columns.w, np.moveaxis(point.w, -1, 1).reshape(B, -1)) + columns.base @ point.base
    for term, value, own in zip(point.terms, point.values, columns.own, strict=True):
        e = e + _times(own, value[plant.seg.run] if term.per_run else np.broadcast_to(value, (B, term.size)))
    Z = np.concatenate([columns.eta, columns.w, columns.base, *columns.own, *columns.candidates, *extra, e[..., None]], axis=-1)
    Z = np.nan_to_num(Z / noise[None, :, None], nan=0.0, posinf=0.0, neginf=0.0)
    Z = scales.colour.whitened(Z.reshape(B, plant.steps + 1, 6, -1)).reshape(Z.shape)
    logdet = scales.colour.log_determinant(plant.seg.mask.sum(axis=1))
    return Products.of(Z, plant.seg.mask, plant.knots, plant.knot_time, plant.seg.run, plant.seg.runs, logdet)


def _times(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """(B, T) from columns (B, T, C) and coefficients (B, C)."""
    return (columns @ values[:, :, None])[..., 0]


def point_from(model: Model, point: Point, solution: Solution, prior: Prior, estimate: np.ndarray) -> Point:
    """The point that a solution describes."""
    knots = point.w.shape[1]
    values, at, at_random = [], NUM_BASE, 0
    for term in model.terms:
        if term.per_run:
            values.append(solution.means[:, at_random : at_random + term.size])
            at_random += term.size
        else:
            values.append(solution.mean[at : at + term.size])
            at += term.size
    w = np.moveaxis(estimate[:, 6:].reshape(len(estimate), 3, knots), 1, 2)
    return Point(solution.mean[:NUM_BASE], estimate[:, :6], w, model.terms, tuple(values))


def between(a: Point, b: Point, share: float) -> Point:
    """a + share (b - a); terms that `a` lacks start from zero."""

    def mix(p: np.ndarray, q: np.ndarray) -> np.ndarray:
        return p + share * (q - p)

    old = [a.values[i] if i < len(a.values) else np.zeros_like(v) for i, v in enumerate(b.values)]
    return Point(mix(a.base, b.base), mix(a.eta, b.eta), mix(a.w, b.w), b.terms, tuple(mix(p, q) for p, q in zip(old, b.values, strict=True)))


def within_bounds(plant: Plant, scales: Scales, point: Point) -> Point:
    """Amplitudes held inside the bounds of their effects; those of single runs are held by what the runs have in common."""
    values = []
    for term, value in zip(point.terms, point.values, strict=True):
        if term.per_run:
            values.append(value)
            continue
        unit = scales.amplitudes(term, plant.c.L)
        sized = [p for p in term.effect.sized(plant.c.L) if not p.shape]
        values.append(np.clip(value, [p.low / s for p, s in zip(sized, unit, strict=True)], [p.high / s for p, s in zip(sized, unit, strict=True)]))
    return replace(point, values=tuple(values))


def objective(lin: Linearisation, model: Model, hyper: Hyper, log_tau2: dict[int, float], gram: Gram) -> float:
    """Twice the negative log posterior of a point, without constants."""
    plant, point = lin.plant, lin.point
    error = np.where(plant.seg.mask[..., None], (plant.seg.states[..., :6] - lin.predicted) / lin.scales.noise, 0.0)
    error = np.where(plant.seg.mask[..., None], lin.scales.colour.whitened(error), 0.0)
    with np.errstate(over="ignore"):
        cost = float(np.sum(error**2 * np.exp(-hyper.log_noise))) + float(np.sum(base_precision(model) * point.base**2))
    cost += ETA_PRECISION * float(np.sum(point.eta**2))
    w = np.moveaxis(point.w, -1, 1)
    cost += float(np.sum(np.sum(w @ gram.K_inv * w, axis=(0, 2)) * np.exp(-hyper.log_force)))
    for i, (term, value) in enumerate(zip(point.terms, point.values, strict=True)):
        cost += float(np.sum(value**2)) * (np.exp(-log_tau2.get(i, 0.0)) if term.per_run else 1.0)
    return cost if np.isfinite(cost) else np.inf


def start(plant: Plant) -> tuple[Point, Hyper]:
    """Regressions, no effect, no latent force."""
    B = len(plant.seg.run)
    hyper = Hyper(np.zeros(3), np.zeros(6), 12.0 * (plant.c.L / 130.0) ** 0.5)
    return Point(np.zeros(NUM_BASE), np.zeros((B, 6)), np.zeros((B, plant.knots, 3))), hyper


def fit(
    plant: Plant, scales: Scales, model: Model, point: Point, hyper: Hyper, log_tau2: dict[int, float] | None = None, *, iterations: int = 20,
    candidates: Sequence[Term] = (), guess: np.ndarray | None = None,
) -> Fit:  # fmt: skip
    """Gauss-Newton with EM for the variances, from `point` (which may lack the last terms of `model`: they start at zero), until it rests.

    A step is at first halved only where the cost explodes: the cost of a step that is right for the parameters rises until the latent force has
    followed, and the path would else end where parameters compensate each other. The best point of the path is kept, by its evidence.
    `candidates` get columns there.
    """
    log_tau2 = dict(log_tau2 or {})
    if len(point.terms) < len(model.terms):
        new = [np.zeros((plant.seg.runs, t.size) if t.per_run else t.size) for t in model.terms[len(point.terms) :]]
        point = Point(point.base, point.eta, point.w, model.terms, (*point.values, *new))
    lin, best, before = Linearisation(plant, scales, point, guess), None, -np.inf
    for number in range(iterations):
        free = number < _FREE_STEPS
        found = settle(lin, model, hyper, log_tau2, leap=np.inf if free else _LEAP)
        hyper, log_tau2 = found.hyper, found.log_tau2
        if best is None or found.evidence > best[0].evidence:
            best = found, lin
        if found.excess < _AT_REST and abs(found.evidence - before) < _AT_REST_EVIDENCE:
            break
        before = found.evidence
        after = _step(lin, found, number + 1 < _FREE_STEPS) if number < iterations - 1 else None
        if after is None:
            break
        lin = after
    assert best is not None
    found, lin = best
    return settle(lin, model, found.hyper, found.log_tau2, candidates, leap=0.0) if candidates else found


def _step(lin: Linearisation, found: Fit, free: bool) -> Linearisation | None:
    """Towards the point that the linear model thinks best; None where no part of the way is any better (the first steps are `free`)."""
    plant, scales, model, may_rise = lin.plant, lin.scales, found.model, _MAY_RISE if free else 1.0
    target = within_bounds(plant, scales, point_from(model, lin.point, found.solution, found.prior, found.estimate))
    at, share = objective(lin, model, found.hyper, found.log_tau2, found.gram), 1.0
    while True:
        part = between(lin.point, target, share)
        trial = Linearisation(plant, scales, part, lin.towards(part), coarse=free)
        if objective(trial, model, found.hyper, found.log_tau2, found.gram) < may_rise * at:
            return trial
        share *= 0.5
        if share < _LEAST_SHARE:
            return trial if free else None


@dataclass(frozen=True)
class Origin:
    """Where fits begin: regressions, with trajectories on the measured ones by the latent force alone. Gauss-Newton is nearly linear from there; from
    another fit it may end where parameters compensate each other."""

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


def settle(
    lin: Linearisation, model: Model, hyper: Hyper, log_tau2: dict[int, float], candidates: Sequence[Term] = (), cycles: int = _EM_CYCLES,
    leap: float = np.inf,
) -> Fit:  # fmt: skip
    """Variances, whose logarithms move by `leap` at most, and posterior on one linearisation."""
    plant, scales, point, columns = lin.plant, lin.scales, lin.point, lin.columns(candidates)
    products = products_of(plant, scales, point, columns)
    if leap > 0.0:
        hyper, log_tau2 = _variances(products.without(sum(t.size for t in candidates)), model, hyper, log_tau2, cycles, leap)
    gram = products.weigh(hyper)
    reduced = gram.reduce(hyper.log_force)
    prior = model.prior(log_tau2)
    solution = solve(reduced, prior)
    estimate, cov = background(gram, reduced, prior, solution)
    excess = max(objective(lin, model, hyper, log_tau2, gram) - solution.squares, 0.0)
    return Fit(
        plant, scales, model, point, hyper, log_tau2, prior, columns, tuple(candidates), lin.motion, products, gram, reduced, solution, estimate, cov,
        excess,
    )  # fmt: skip


def evidence_with(found: Fit, colour: Colour) -> float:
    """Log evidence of the same linearisation with noise of another correlation, whose variances are fitted anew."""
    scales, more = found.scales.coloured(colour), sum(t.size for t in found.candidates)
    products = products_of(found.plant, scales, found.point, found.columns).without(more)
    hyper, log_tau2 = _variances(products, found.model, found.hyper, found.log_tau2, 1)
    return solve(products.weigh(hyper).reduce(hyper.log_force), found.model.prior(log_tau2)).log_evidence


def _variances(
    products: Products, model: Model, hyper: Hyper, log_tau2: dict[int, float], cycles: int, leap: float = np.inf
) -> tuple[Hyper, dict[int, float]]:
    """Variances of force, noise and random effects on one linearisation."""
    random = [i for i, term in enumerate(model.terms) if term.per_run]

    def step(theta: np.ndarray) -> tuple[float, np.ndarray]:
        now, tau2 = Hyper(theta[:3], theta[3:9], hyper.tau), dict(zip(random, theta[9:], strict=True))
        gram, prior = products.weigh(now), model.prior(tau2)
        reduced = gram.reduce(now.log_force)
        solution = solve(reduced, prior)
        estimate, cov = background(gram, reduced, prior, solution)
        force, noise = update_force(gram, estimate, cov), update_noise(products, gram, reduced, prior, solution, estimate, _LOG_FLOOR)
        return solution.log_evidence, np.concatenate([force, noise, _random_variances(model, solution)])

    first = np.concatenate([hyper.log_force, hyper.log_noise, [log_tau2.get(i, 0.0) for i in random]])
    theta = np.clip(accelerated(step, first, cycles), first - leap, first + leap)
    return Hyper(theta[:3], theta[3:9], hyper.tau), dict(zip(random, (float(v) for v in theta[9:]), strict=True))


def _random_variances(model: Model, solution: Solution) -> list[float]:
    """One EM step for the log variance of each random effect."""
    at, found = 0, []
    for term in model.terms:
        if term.per_run:
            sel = slice(at, at + term.size)
            at += term.size
            second = np.mean(solution.means[:, sel] ** 2) + np.mean(np.diagonal(solution.covs[:, sel, sel], axis1=1, axis2=2))
            found.append(float(np.log(second)))
    return found
