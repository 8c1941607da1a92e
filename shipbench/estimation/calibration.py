"""Calibration of the whole ship: every coefficient with a prior between ships, from short pieces and from rollouts.

First the maximum of the posterior with the latent force integrated out (`calibrated`): a push that the model lacks is
then no error of a coefficient. Then, from there, least squares of open-loop rollouts (`refined`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .baseline import from_regressions
from .budget import is_spent
from .coefficients import NUM_BASE
from .forward import Plant
from .gauss_newton import Origin, fit
from .gram import solve
from .laplace import Fit, Model, base_precision, with_hull
from .linearisation import Linearisation, Scales
from .open_loop import cost, errors, rolled, sizes
from .robust_prior import widened
from .term import Term
from .thresholds import THRESHOLDS

_PIECES = 24
"""Pieces of a first estimate."""
_REFINEMENTS, _LEAST_GAIN, _LEAST_SHARE = 5, 3e-3, 0.1
"""Most Gauss-Newton steps of `refined`; relative decrease of its cost, and share of a step, at which it stops."""


@dataclass(frozen=True)
class Pushes:
    """Random parts of the motion and of its record.

    Attributes:
        force: (3,) standard deviations of the latent acceleration [m/s^2, m/s^2, rad/s^2].
        tau: its correlation time [s].
        noise: (6,) standard deviations of the sensors.
    """

    force: np.ndarray
    tau: float
    noise: np.ndarray


@dataclass(frozen=True)
class Calibration:
    """Calibrated coefficients of one ship.

    Attributes:
        base: (NUM_BASE,) differences from the prior means, in prior standard deviations.
        cov: posterior covariance of `base` and then of the amplitudes, in the same units.
        widths: (NUM_BASE,) factors of the prior standard deviations, above 1 for outliers among ships.
        pushes: random parts.
        terms: effects in the model.
        values: their amplitudes, in typical sizes.
    """

    base: np.ndarray
    cov: np.ndarray
    widths: np.ndarray
    pushes: Pushes
    terms: tuple[Term, ...] = ()
    values: tuple[np.ndarray, ...] = ()

    @property
    def spread(self) -> np.ndarray:
        """Posterior standard deviations of `base`."""
        return np.asarray(np.sqrt(np.diag(self.cov)[:NUM_BASE]))

    @property
    def value_spreads(self) -> tuple[np.ndarray, ...]:
        """Posterior standard deviations of `values`."""
        return _parts(np.sqrt(np.diag(self.cov)), self.terms)


def estimated(plant: Plant) -> Fit:
    """First estimate without effects, from some of the pieces."""
    return widened(from_regressions(some_of(plant), Scales(plant)))


def some_of(plant: Plant) -> Plant:
    """Pieces of a first estimate, evenly spread."""
    return plant.thinned(_PIECES)


def calibrated(plant: Plant, like: Fit, terms: Sequence[Term] = ()) -> Fit:
    """Maximum of the posterior of all coefficients and the amplitudes of `terms`, from those of `like` on, a fit to
    other pieces. Where that path has not converged, the one from the regressions is tried, too.
    """
    scales = Scales(plant).with_background(like.hyper)
    model, origin = replace(like.model, terms=tuple(terms)), Origin.like(plant, scales, like)
    found = fit(plant, scales, model, origin.point, like.hyper, guess=origin.motion)
    if found.excess < THRESHOLDS.value("unconverged_excess"):
        return found
    origin = Origin.of(plant, scales)
    other = fit(plant, scales, model, origin.point, like.hyper, guess=origin.motion, far=True)
    return found if found.evidence > other.evidence else other


def calibration_of(found: Fit) -> Calibration:
    """Estimates, their covariance and the random parts of a fit; without values of single runs, which a run that was
    not seen does not have."""
    shared = [(t, v) for t, v in zip(found.model.terms, found.values, strict=True) if not t.per_run]
    size = NUM_BASE + sum(t.size for t, _ in shared)
    hyper, scales = found.hyper, found.scales
    pushes = Pushes(np.exp(0.5 * hyper.log_force) * scales.w, hyper.tau, np.exp(0.5 * hyper.log_noise) * scales.noise)
    return Calibration(
        found.solution.mean[:NUM_BASE], found.solution.cov[:size, :size],
        np.asarray(found.model.widths or np.ones(NUM_BASE)), pushes, tuple(t for t, _ in shared),
        tuple(v for _, v in shared),
    )  # fmt: skip


def calibration_without(found: Fit, runs: Sequence[int]) -> Calibration:
    """Calibration by the other runs than `runs` (indices), on the linearisation of `found`, a fit to all."""
    keep, reduced = ~np.isin(np.arange(found.plant.seg.runs), runs), found.reduced
    rest = replace(reduced, S=reduced.S[keep], logdet=reduced.logdet[keep])
    return calibration_of(replace(found, solution=solve(rest, found.prior)))


def calibration_on_regressions(found: Fit) -> Calibration:
    """Calibration with a hull that follows the regressions, on the linearisation of `found`."""
    return calibration_of(replace(found, solution=with_hull(found, THRESHOLDS.value("hull_on_regressions"))))


def _parts(at: np.ndarray, terms: Sequence[Term]) -> tuple[np.ndarray, ...]:
    """Amplitudes of the terms in a vector that begins with the coefficients."""
    edges = np.cumsum([NUM_BASE, *(t.size for t in terms)])
    return tuple(at[a:b] for a, b in pairwise(edges))


def refined(plant: Plant, scales: Scales, start: Calibration) -> Calibration:
    """Least squares of open-loop rollouts over all coefficients and amplitudes, from `start` and under the same prior.

    The errors of one rollout are those of one push or of one coefficient: they count as a single observation of each
    channel, whose size is the root mean square error at `start`. Positions are one channel.
    """
    free = np.ones(NUM_BASE + sum(t.size for t in start.terms))
    free[:NUM_BASE] = base_precision(Model(widths=tuple(start.widths)))
    lin = rolled(plant, scales, start)
    weights, before = _weights(lin), np.inf
    for _ in range(_REFINEMENTS):
        if is_spent():
            break
        at = _stacked(start)
        old = cost(lin, weights) + float(free @ at**2)
        if old > (1.0 - _LEAST_GAIN) * before:
            break
        base, own = lin.parameter_columns()
        J = np.concatenate([base, *own], axis=-1) * weights[:, :, None]
        e = errors(lin) * weights
        ok = np.isfinite(J).all(axis=(1, 2)) & np.isfinite(e).all(axis=1)
        J, e = (J, e) if ok.all() else (J[ok], e[ok])
        J = J.reshape(-1, J.shape[2])
        cov, share, before = np.linalg.inv(J.T @ J + np.diag(free)), 1.0, old
        step, start = cov @ (J.T @ e.ravel() - free * at), replace(start, cov=cov)
        while share > _LEAST_SHARE:
            moved = _unstacked(start, at + share * step)
            trial = rolled(plant, scales, moved)
            if cost(trial, weights) + float(free @ _stacked(moved) ** 2) < old:
                start, lin = moved, trial
                break
            share *= 0.5
        else:
            break
    return start


def _stacked(model: Calibration) -> np.ndarray:
    return np.concatenate([model.base, *model.values])


def _unstacked(like: Calibration, at: np.ndarray) -> Calibration:
    return replace(like, base=at[:NUM_BASE], values=_parts(at, like.terms))


def _weights(lin: Linearisation) -> np.ndarray:
    """Weights (B, T) with which the squares of a segment sum up to one for each measured channel."""
    seg = lin.plant.seg
    by_channel = seg.seen / np.maximum(sizes(lin), 1e-9) / np.sqrt(seg.mask.sum(axis=1))[:, None]
    return np.tile(by_channel, lin.plant.steps + 1)
