"""Fits and analyses that are made without fitting anything: real objects, whose estimates are given."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from shipbench.diagnosis.selection.analysis import Analysis
from shipbench.diagnosis.selection.stepwise import Selection, Step
from shipbench.effects.base import EFFECTS
from shipbench.estimation.coefficients import NUM_BASE
from shipbench.estimation.columns import Columns
from shipbench.estimation.forward import Plant, Segments
from shipbench.estimation.gram import Gram, Hyper, Products, Reduced, Solution, ornstein_uhlenbeck, solve
from shipbench.estimation.laplace import Fit, Model
from shipbench.estimation.linearisation import Point, Scales
from shipbench.estimation.packed import length
from shipbench.estimation.term import Term
from shipbench.physics.mmg import load_mmg_ship
from shipbench.ship import Particulars, complete

RUNS = 20


def made_ship(L: float = 130.0) -> Particulars:
    """A container ship of length L [m], with a breadth of 0.12 L."""
    ship = complete(load_mmg_ship("container130").particulars)
    return ship.resized(L / ship.L).model_copy(update={"L": L, "B": 0.12 * L, "x_bow": 0.38 * L})


def made_segments(run: Sequence[int] | np.ndarray, steps: int = 2, dt: float = 1.0, **others) -> Segments:
    """Segments of the runs `run` (B,), at rest where `others` do not hold states (B, K + 1, 10)."""
    run, states = np.asarray(run), others.pop("states", None)
    states = np.zeros((len(run), steps + 1, 10)) if states is None else states
    shape, runs = states.shape[:2], int(run.max()) + 1
    given = {
        "commanded": False, "commands": np.zeros((*shape, 4)), "earlier": np.zeros((len(run), 0, 4)), "wind": None,
        "mask": np.ones(shape, dtype=bool), "start": np.zeros(len(run)), "kinds": ("",) * runs,
    }  # fmt: skip
    return Segments(dt=dt, states=states, run=run, runs=runs, **(given | others))


def made_plant(runs: int = RUNS, L: float = 130.0, dt: float = 1.0, **others) -> Plant:
    """Runs of one segment each of a ship of length L [m]; `others` as in `made_segments`."""
    return Plant(made_ship(L), made_segments(np.arange(runs), dt=dt, **others))


def made_fit(
    terms: Iterable[Term] = (), values: Iterable[np.ndarray] = (), plant: Plant | None = None, log_evidence: float = 0.0
) -> Fit:
    """A fit with `values` of its terms in typical sizes, (size,) or (runs, size), each with a variance of 1; 0 where
    none are given. The base parameters are 0."""
    plant, terms = made_plant() if plant is None else plant, tuple(terms)
    given = tuple(values) or tuple(np.zeros((plant.seg.runs, t.size) if t.per_run else t.size) for t in terms)
    of_runs = [v for t, v in zip(terms, given, strict=True) if t.per_run]
    mean = np.concatenate([np.zeros(NUM_BASE), *(v for t, v in zip(terms, given, strict=True) if not t.per_run)])
    means = np.hstack(of_runs) if of_runs else np.zeros((plant.seg.runs, 0))
    covs = np.broadcast_to(np.eye(means.shape[1]), (len(means), means.shape[1], means.shape[1]))
    solution = Solution(log_evidence, 0.0, mean, np.eye(len(mean)), means, covs, np.zeros(len(means)))
    return _around(plant, terms, solution)


def _around(plant: Plant, terms: tuple[Term, ...], solution: Solution) -> Fit:
    """A fit with a solution, on data that say nothing."""
    seg, model, hyper = plant.seg, Model(terms), Hyper(np.zeros(3), np.zeros(6), 10.0)
    B, columns, latent = len(seg.run), NUM_BASE + sum(t.size for t in terms), 6 + 3 * plant.knots
    size = latent + columns + 1
    P, G = np.zeros((B, length(size))), np.broadcast_to(0.0, (B, size, size))
    slope = np.zeros((B, columns + 1))
    products = Products(
        (P,) * 6, plant.knots, plant.knot_time, seg.run, seg.runs, seg.mask.sum(axis=1), np.zeros(B), np.zeros(B), slope
    )
    K_inv, K_logdet = ornstein_uhlenbeck(plant.knots, plant.knot_time, hyper.tau)
    gram = Gram(G, plant.knots, K_inv, K_logdet, np.zeros(B), slope, seg.run, seg.runs)
    nothing = np.broadcast_to(0.0, (seg.runs, columns + 1, columns + 1))
    reduced = Reduced(nothing, np.zeros(seg.runs), np.zeros((B, 0, 0)), np.zeros((B, latent, columns + 1)))
    point = Point(np.zeros(NUM_BASE), np.zeros((B, 6)), np.zeros((B, plant.knots, 3)))
    T = 6 * (plant.steps + 1)
    sensitivities = Columns(
        np.zeros((B, plant.steps + 1, 6)), np.zeros((B, T, latent)),
        np.zeros((B, T, NUM_BASE)), tuple(np.zeros((B, T, t.size)) for t in terms), (), (),
    )  # fmt: skip
    return Fit(
        plant=plant, scales=Scales(plant), model=model, point=point, hyper=hyper, log_tau2={}, prior=model.prior({}),
        columns=sensitivities, candidates=(), motion=np.zeros((B, plant.steps + 1, 6)), products=products, gram=gram,
        reduced=reduced, solution=solution, estimate=np.zeros((B, latent)), excess=0.0,
    )  # fmt: skip


def fit_to(terms: Iterable[Term], S: np.ndarray, log_tau2: Sequence[float] = ()) -> Fit:
    """The fit to sums per run S (N, own + 1, own + 1) of [columns of the terms, e], of which the base parameters
    explain nothing; `log_tau2` of the terms with values of single runs."""
    fit, at = made_fit(terms, plant=made_plant(len(S))), NUM_BASE + np.arange(S.shape[1])
    whole = np.zeros((len(S), NUM_BASE + S.shape[1], NUM_BASE + S.shape[1]))
    whole[:, at[:, None], at] = S
    reduced, variances = replace(fit.reduced, S=whole), dict(enumerate(log_tau2))
    prior = fit.model.prior(variances)
    return replace(fit, reduced=reduced, log_tau2=variances, prior=prior, solution=solve(reduced, prior))


def fit_to_pieces(terms: Iterable[Term], Z: np.ndarray, run: np.ndarray, log_tau2: Sequence[float]) -> Fit:
    """The fit to whitened columns Z (B, samples, 6 + 3 + own + 1) of pieces, [eta, w of one knot for each axis, columns
    of the terms, e], of which the base parameters explain nothing."""
    fit, runs = made_fit(terms, plant=made_plant(int(run.max()) + 1)), int(run.max()) + 1
    with_base = np.insert(Z, [9] * NUM_BASE, 0.0, axis=2)
    slope = np.zeros((len(run), with_base.shape[2] - 9))
    gram = Gram(np.swapaxes(with_base, 1, 2) @ with_base, 1, np.ones((1, 1)), 0.0, np.zeros(len(run)), slope, run, runs)
    reduced, variances = gram.reduce(np.zeros(3)), dict(enumerate(log_tau2))
    prior = fit.model.prior(variances)
    return replace(
        fit, gram=gram, reduced=reduced, log_tau2=variances, prior=prior, solution=solve(reduced, prior),
    )  # fmt: skip


def fit_of(
    estimates: np.ndarray,
    since: int | None = None,
    effect: str = "rudder_offset",
    setting: tuple[float, ...] = (),
    term: Term | None = None,
) -> Fit:
    """Runs (N,) with information 9 each on every amplitude, whose own least squares estimates of the first are given,
    of others 0; prior N(0, 1)."""
    term, information = Term(EFFECTS.get(effect), setting, since=since) if term is None else term, 9.0
    S = np.zeros((len(estimates), term.size + 1, term.size + 1))
    S[:] = np.diag(np.append(np.full(term.size, information), 1.0))
    S[:, 0, -1], S[:, -1, 0] = information * estimates, information * estimates
    return fit_to((term,), S)


def made_analysis(final: Fit, steps: Iterable[Step] = (), threshold: float = 10.0) -> Analysis:
    """What was found, without gears and dependences."""
    selection = Selection(final, final, final, [], [], list(steps))
    return Analysis(selection, threshold, np.zeros(0), 0.0, (), (), ())
