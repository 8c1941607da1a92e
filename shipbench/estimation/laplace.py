"""Laplace approximation of the joint fit on one linearisation: variances, posterior, and cost of points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from .coefficients import FREE, NUM_BASE, NUM_HULL
from .columns import Columns
from .forward import Plant
from .gram import (
    ETA_PRECISION,
    Gram,
    Hyper,
    Prior,
    Products,
    Reduced,
    Solution,
    accelerated,
    background,
    background_cov,
    by_run,
    solve,
    update_force,
    update_noise,
)
from .linalg import log_determinant
from .linearisation import Linearisation, Point, Scales
from .log_determinant import coefficients_at, slopes
from .noise import Colour
from .term import Term
from .thresholds import THRESHOLDS
from .whitening import products_of

_EM_CYCLES = 3


@dataclass(frozen=True)
class Model:
    """Terms of a model, and factors of the prior standard deviations of the hull and of the other parameters; `widths`:
    such a factor for each base parameter besides, None for 1."""

    terms: tuple[Term, ...] = ()
    hull: float = 1.0
    base: float = 1.0
    widths: tuple[float, ...] = ()

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
    usual = np.repeat(
        [model.base**-2, model.hull**-2, model.base**-2], [len(FREE), NUM_HULL, NUM_BASE - len(FREE) - NUM_HULL]
    )
    return usual / np.square(model.widths or 1.0)


@dataclass(frozen=True)
class Fit:
    """Fitted model and its linearisation about `motion` (B, K + 1, 6). solution: of `prior` on `gram`; estimate: of
    [eta, w] per segment; early: predicted evidence at the second linearisation."""

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
    excess: float
    early: float = np.nan

    @property
    def evidence(self) -> float:
        """Log evidence (Laplace approximation), without constants, less the costs of the terms. It uses the cost at the
        point, not the lower one that the linear model predicts; once converged they are the same."""
        return self.promise - 0.5 * self.excess

    @property
    def promise(self) -> float:
        """Predicted log evidence, at the optimum of the linear model."""
        return self.solution.log_evidence - 0.5 * sum(t.cost(self.plant.seg.runs) for t in self.model.terms)

    @property
    def evidence_followed(self) -> float:
        """Log evidence once initial states and latent force have followed the parameters of the point, as the linear
        model expects it."""
        return self.evidence + 0.5 * (self.excess - at_point(self, self.point) + self.solution.squares)

    @cached_property
    def cov(self) -> np.ndarray:
        """Covariances (B, Z, Z) of `estimate`."""
        return background_cov(self.gram, self.reduced, self.prior, self.solution)

    @cached_property
    def own_products(self) -> Products:
        """Products without the columns of the candidates."""
        return self.products.without(sum(t.size for t in self.candidates))

    @property
    def values(self) -> tuple[np.ndarray, ...]:
        """Estimates of the terms' amplitudes, in units of their typical sizes: (size,), or (runs, size) of a random
        effect."""
        return point_from(self.model, self.point, self.solution, self.prior, self.estimate).values

    def solution_without(self, index: int) -> Solution:
        """Posterior on the same linearisation without the model's index-th term."""
        columns, prior = self.columns_of(index), self.prior
        keep, random = ~np.isin(prior.shared, columns), ~np.isin(prior.random, columns)
        return solve(
            self.reduced, Prior(prior.shared[keep], prior.precision[keep], prior.random[random], prior.log_tau2[random])
        )

    def worth(self, index: int) -> float:
        """Twice the log Bayes factor of the index-th term on this linearisation, less its cost."""
        gain = 2.0 * (self.solution.log_evidence - self.solution_without(index).log_evidence)
        return gain - self.model.terms[index].cost(self.plant.seg.runs)

    def columns_of(self, index: int) -> np.ndarray:
        """Shared columns of the model's index-th term."""
        at = NUM_BASE + sum(t.size for t in self.model.terms[:index])
        return np.arange(at, at + self.model.terms[index].size)


def point_from(model: Model, point: Point, solution: Solution, prior: Prior, estimate: np.ndarray) -> Point:
    """Point that a solution describes."""
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


def objective(lin: Linearisation, model: Model, hyper: Hyper, log_tau2: dict[int, float], gram: Gram) -> float:
    """Twice the negative log posterior of a point, without constants."""
    return float(np.sum(by_segment(lin, hyper, gram))) + prior_squares(model, lin.point, log_tau2)


def by_segment(lin: Linearisation, hyper: Hyper, gram: Gram) -> np.ndarray:
    """Twice the negative log posterior of every segment (B,) given the parameters; infinite if it diverges."""
    plant, point = lin.plant, lin.point
    w = np.moveaxis(point.w, -1, 1)
    with np.errstate(over="ignore", invalid="ignore"):
        error = np.where(plant.seg.mask[..., None], (plant.seg.states[..., :6] - lin.predicted) / lin.scales.noise, 0.0)
        error = np.where(plant.seg.mask[..., None] & plant.seg.seen, lin.scales.colour.whitened(error), 0.0)
        cost = np.sum(error**2 * np.exp(-hyper.log_noise), axis=(1, 2)) + ETA_PRECISION * np.sum(point.eta**2, axis=1)
    cost += np.sum(w @ gram.K_inv * w, axis=2) @ np.exp(-hyper.log_force)
    return np.where(np.isfinite(cost), cost, np.inf)


def suiting(found: Fit, point: Point) -> tuple[np.ndarray, np.ndarray]:
    """Initial states (B, 6) and latent force (B, knots, 3) of highest posterior given the parameters and values of a
    point, on the linearisation of `found`."""
    theta = _coefficients(found, point)[found.plant.seg.run]
    estimate = -(found.reduced.solved @ theta[:, :, None])[..., 0]
    return estimate[:, :6], np.moveaxis(estimate[:, 6:].reshape(len(estimate), 3, -1), 1, 2)


def at_point(found: Fit, point: Point) -> float:
    """Twice the negative log posterior at the parameters and values of a point, with the initial states and latent
    force that maximise it on the linearisation of `found`."""
    theta = _coefficients(found, point)
    return float(np.einsum("ni,nij,nj", theta, found.reduced.S, theta)) + prior_squares(
        found.model, point, found.log_tau2
    )


def once_followed(lin: Linearisation, model: Model, hyper: Hyper, log_tau2: dict[int, float]) -> float:
    """Twice the negative log posterior at the parameters and values of the point of a linearisation, with the initial
    states and latent force that maximise it there, and with their log determinants: `at_point` of a fit there, and the
    sum of its `reduced.logdet`. It needs no sensitivities to parameters and values."""
    point, nothing = lin.point, np.zeros((len(lin.motion), lin.latent.shape[1], 0))
    columns = Columns(lin.predicted, lin.latent, nothing, (), (), ())
    alone = products_of(lin.plant, lin.scales, replace(point, base=np.zeros(0), terms=(), values=()), columns)
    reduced = replace(alone, initial=_of_initial_states(alone, lin.scales, hyper)).weigh(hyper).reduce(hyper.log_force)
    return float(np.sum(reduced.S) + np.sum(reduced.logdet)) + prior_squares(model, point, log_tau2)


def leaning(found: Fit, point: Point) -> float:
    """Curvature term: rise of the log determinant of the latent force at a point, as the linearisation of `found`
    predicts it."""
    slope = by_run(found.gram.slope, found.gram.run)
    return -2.0 * float(np.sum(_coefficients(found, point)[:, :-1] * slope[:, :-1])) + float(np.sum(slope[:, -1]))


def _coefficients(found: Fit, point: Point) -> np.ndarray:
    """Parameters and values (N, G + 1) of a point by run, -1 for the residual."""
    runs = found.plant.seg.runs
    own = [
        v if t.per_run else np.broadcast_to(v, (runs, t.size)) for t, v in zip(point.terms, point.values, strict=True)
    ]
    return np.concatenate([np.broadcast_to(point.base, (runs, NUM_BASE)), *own, -np.ones((runs, 1))], axis=1)


def prior_squares(model: Model, point: Point, log_tau2: dict[int, float]) -> float:
    """Twice the negative log prior of the parameters and values, without constants."""
    squares = float(np.sum(base_precision(model) * point.base**2))
    for i, (term, value) in enumerate(zip(point.terms, point.values, strict=True)):
        squares += float(np.sum(value**2)) * (np.exp(-log_tau2.get(i, 0.0)) if term.per_run else 1.0)
    return squares


def settle(
    lin: Linearisation, model: Model, hyper: Hyper, log_tau2: dict[int, float], candidates: Sequence[Term] = (),
    cycles: int = _EM_CYCLES,
    leap: float = np.inf, seen: Fit | None = None, far: bool = False,
) -> Fit:  # fmt: skip
    """Converged variances and posterior on one linearisation. leap: limit of the change of each log variance; seen: an
    earlier fit on it, whose products hold; far: see `sloped`."""
    plant, scales, point = lin.plant, lin.scales, lin.point
    columns = lin.columns(candidates) if seen is None else seen.columns
    products = products_of(plant, scales, point, columns) if seen is None else seen.products
    products = sloped(lin, columns, products, hyper, far, known=seen is not None)
    if leap > 0.0:
        hyper, log_tau2 = _variances(
            products.without(sum(t.size for t in candidates)), model, hyper, log_tau2, cycles, leap
        )
    gram = products.weigh(hyper)
    reduced = gram.reduce(hyper.log_force)
    prior = model.prior(log_tau2)
    solution = solve(reduced, prior)
    estimate = background(gram, reduced, prior, solution)
    excess = max(objective(lin, model, hyper, log_tau2, gram) - solution.squares, 0.0)
    return Fit(
        plant, scales, model, point, hyper, log_tau2, prior, columns, tuple(candidates), lin.motion, products, gram,
        reduced, solution, estimate,
        excess,
    )  # fmt: skip


def sloped(
    lin: Linearisation, columns: Columns, products: Products, hyper: Hyper, far: bool = False, known: bool = False
) -> Products:
    """Products with the derivatives of the log determinants by the shared columns; known: the products are of an
    earlier fit on this linearisation.

    The part of the initial states is evaluated at the same variances in all fits of a diagnosis; otherwise it would
    reward lower variances. The derivatives are zero where the latent force stands in for the parameters (`far`).
    """
    alone = products.without(products.shared)
    flat = np.zeros((len(products.run), products.slope.shape[1] - 1))
    by_column = flat if far else slopes(lin, columns, alone.weigh(hyper).reduce(hyper.log_force).inverse, hyper)
    kept = known and lin.scales.background
    initial = products.initial if kept else _of_initial_states(alone, lin.scales, hyper)
    return products.sloped(by_column, coefficients_at(lin, columns), initial)


def _of_initial_states(alone: Products, scales: Scales, hyper: Hyper) -> np.ndarray:
    """Part (B,) of the log determinants that belongs to initial states, of products without shared columns."""
    seen = scales.background or hyper
    return -log_determinant(alone.weigh(seen).reduce(seen.log_force).inverse[:, :6, :6])


def evidence_with(found: Fit, colour: Colour) -> float:
    """Log evidence of the same linearisation under another noise model, with its variances fitted anew."""
    other, columns = colour.differs(found.scales.colour), replace(found.columns, candidates=())
    part = products_of(found.plant, found.scales.coloured(colour), found.point, columns, other)
    known = dict(enumerate(found.own_products.P)) | dict(zip(other, part.P, strict=True))
    products = replace(found.own_products, P=tuple(known.values()), colour=part.colour)
    hyper, log_tau2 = _variances(products, found.model, found.hyper, found.log_tau2, 1)
    return solve(products.weigh(hyper).reduce(hyper.log_force), found.model.prior(log_tau2)).log_evidence


def hull_evidence(found: Fit) -> float:
    """Return 2 log evidence for a hull that differs from the regressions as ships usually do, against one that follows
    them."""
    follows = with_hull(found, THRESHOLDS.value("hull_on_regressions"))
    return 2.0 * (with_hull(found, 1.0).log_evidence - follows.log_evidence)


def with_hull(found: Fit, width: float) -> Solution:
    """Posterior on the same linearisation with the prior standard deviations of the hull times `width`, and with all
    variances fitted anew."""
    products, model = found.own_products, replace(found.model, hull=width)
    hyper, log_tau2 = _variances(products, model, found.hyper, found.log_tau2, _EM_CYCLES)
    return solve(products.weigh(hyper).reduce(hyper.log_force), model.prior(log_tau2))


def settled_evidence(found: Fit, products: Products, more: int) -> float:
    """Log evidence of products that hold `more` shared columns behind those of the model of `found`, with all variances
    fitted anew."""
    hyper, log_tau2 = _variances(products, found.model, found.hyper, found.log_tau2, _EM_CYCLES, more=more)
    return solve(
        products.weigh(hyper).reduce(hyper.log_force), found.model.prior(log_tau2).and_shared(more)
    ).log_evidence


def _variances(
    products: Products,
    model: Model,
    hyper: Hyper,
    log_tau2: dict[int, float],
    cycles: int,
    leap: float = np.inf,
    more: int = 0,
) -> tuple[Hyper, dict[int, float]]:
    """Variances of force, noise and random effects on one linearisation; more: shared columns behind those of the
    model."""
    random = [i for i, term in enumerate(model.terms) if term.per_run]
    least = np.log(THRESHOLDS.value("least_spread") ** 2)

    def step(theta: np.ndarray) -> tuple[float, np.ndarray]:
        now, tau2 = Hyper(theta[:3], theta[3:9], hyper.tau), dict(zip(random, theta[9:], strict=True))
        gram, prior = products.weigh(now), model.prior(tau2).and_shared(more)
        reduced = gram.reduce(now.log_force)
        solution = solve(reduced, prior)
        estimate = background(gram, reduced, prior, solution)
        force = update_force(gram, reduced, prior, solution, estimate)
        noise = update_noise(products, gram, reduced, prior, solution, estimate, least)
        return solution.log_evidence, np.concatenate([force, noise, _random_variances(model, solution)])

    first = np.concatenate([hyper.log_force, hyper.log_noise, [log_tau2.get(i, 0.0) for i in random]])
    # values per run move less: a variance that vanishes far from convergence hardly returns
    leaps = np.append(np.full(9, leap), np.full(len(random), min(leap, 0.5)))
    theta = np.clip(accelerated(step, first, cycles), first - leaps, first + leaps)
    return Hyper(theta[:3], theta[3:9], hyper.tau), dict(zip(random, (float(v) for v in theta[9:]), strict=True))


def _random_variances(model: Model, solution: Solution) -> list[float]:
    """Log variance of each random effect after one EM step."""
    at, found = 0, []
    for term in model.terms:
        if term.per_run:
            sel = slice(at, at + term.size)
            at += term.size
            second = np.mean(solution.means[:, sel] ** 2) + np.mean(
                np.diagonal(solution.covs[:, sel, sel], axis1=1, axis2=2)
            )
            found.append(float(np.log(second)))
    return found
