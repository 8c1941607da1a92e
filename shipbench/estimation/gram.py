"""Linear Gaussian algebra on the sensitivities: evidence, estimates and variances of the nuisance parameters, without
another simulation.

Model of a segment: e = S_eta eta + S_w w + S_g g + noise, with w ~ N(0, sigma_j^2 K) per axis (stationary,
Ornstein-Uhlenbeck), a weak prior of the initial state eta, and shared coefficients g: base parameters and effects, each
with a zero-mean prior; or one set per run (random effects).

Source: model discrepancy of Kennedy & O'Hagan (2001) put on the force side as in Hooker (2009).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from . import packed
from .linalg import inverses, log_determinant
from .thresholds import THRESHOLDS

ETA_PRECISION = THRESHOLDS.value("initial_state_precision")
"""Prior precision of an initial state beside its first sample."""


@dataclass(frozen=True)
class Hyper:
    """Log variances: log_force (3,) of the latent acceleration and log_noise (6,) of the samples, in units of the
    scales; correlation time tau [s] of the force."""

    log_force: np.ndarray
    log_noise: np.ndarray
    tau: float


@dataclass(frozen=True)
class Products:
    """Products of columns [eta, w, shared, e] per channel and segment, each (B, length) of `packed` (Z + G + 1, Z + G +
    1), before noise variances apply.

    run (B,): the segment's run; samples (B,): number of real samples; colour (B,): log determinant of the noise's
    correlations; initial (B,), slope (B, G + 1): as in `sloped`.
    """

    P: tuple[np.ndarray, ...]
    knots: int
    spacing: float
    run: np.ndarray
    runs: int
    samples: np.ndarray
    colour: np.ndarray
    initial: np.ndarray
    slope: np.ndarray

    @classmethod
    def of(
        cls,
        P: Sequence[np.ndarray],
        size: int,
        samples: np.ndarray,
        knots: int,
        spacing: float,
        run: np.ndarray,
        runs: int,
        colour: np.ndarray | None = None,
    ) -> Products:
        """Products, packed, of columns of this size Z + G + 1 at so many `samples` (B,) of each segment."""
        nothing = np.zeros((len(samples), size - 6 - 3 * knots))
        logdet = np.zeros(len(samples)) if colour is None else colour
        return cls(tuple(P), knots, spacing, run, runs, samples, logdet, np.zeros(len(samples)), nothing)

    @property
    def latent(self) -> int:
        return 6 + 3 * self.knots

    @property
    def shared(self) -> int:
        return self.slope.shape[1] - 1

    @property
    def size(self) -> int:
        """Number of columns, Z + G + 1."""
        return self.latent + self.slope.shape[1]

    def without(self, num: int) -> Products:
        """Products without the last `num` shared columns."""
        return self if not num else self.only(np.arange(self.shared - num))

    def only(self, columns: np.ndarray) -> Products:
        """Products of some shared columns alone (and the residual)."""
        keep = np.concatenate([np.arange(self.latent), self.latent + columns, [self.size - 1]])
        P = tuple(packed.only(part, self.size, keep) for part in self.P)
        return replace(self, P=P, slope=self.slope[:, keep[self.latent :] - self.latent])

    def sloped(self, slopes: np.ndarray, at: np.ndarray, initial: np.ndarray) -> Products:
        """Products without the part (B,) of the log determinants that belongs to initial states, and with derivatives
        (B, G) of the rest by the shared columns, which stand at coefficients `at` (B, G).

        Initial states have no informative prior. Integrated out, they would favour parameters under which a ship
        forgets her initial state: such a likelihood depends on the parameters by more than the data (Francke, Koopman &
        de Vos, J. Time Ser. Anal. 31 (2010) 407). Without that part they are fixed but unknown (Durbin & Koopman, Time
        Series Analysis by State Space Methods, 2nd ed., 2012, 7.2.4).
        """
        return replace(self, initial=initial, slope=beside_products(slopes, at))

    def weigh(self, hyper: Hyper) -> Gram:
        """Gram matrices under the noise variances of `hyper`."""
        G = packed.weighed(self.P, np.exp(-hyper.log_noise), self.size)
        K_inv, K_logdet = ornstein_uhlenbeck(self.knots, self.spacing, hyper.tau)
        log_noise = self.samples * float(np.sum(hyper.log_noise)) + self.colour - self.initial
        return Gram(G, self.knots, K_inv, K_logdet, log_noise, self.slope, self.run, self.runs)


def beside_products(slopes: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Products (B, G + 1) to add to those of [shared, e] with e, from slopes (B, G) at coefficients `at` (B, G)."""
    return np.concatenate([-0.5 * slopes, -np.sum(slopes * at, axis=1, keepdims=True)], axis=1)


def ornstein_uhlenbeck(knots: int, spacing: float, tau: float) -> tuple[np.ndarray, float]:
    """Inverse and log determinant of the correlation exp(-|t - s|/tau) on `knots` equally spaced times."""
    K = np.exp(-np.abs(np.subtract.outer(np.arange(knots), np.arange(knots))) * spacing / tau) + 1e-9 * np.eye(knots)
    return np.linalg.inv(K), float(np.linalg.slogdet(K)[1])


def by_run(values: np.ndarray, run: np.ndarray) -> np.ndarray:
    """Sums (N, ...) over the segments of every run, in the order of the runs (`np.add.reduceat`, but quick for
    matrices)."""
    first = np.flatnonzero(np.diff(run, prepend=-1))
    counts, total = np.diff(first, append=len(run)), values[first]
    for j in range(1, counts.max()):
        longer = counts > j
        total[longer] += values[first[longer] + j]
    return np.asarray(total)


@dataclass(frozen=True)
class Gram:
    """Whitened products per segment, (B, Z + G + 1, Z + G + 1); log_noise (B,): sums of log variances of the samples,
    less `Products.initial`."""

    G: np.ndarray
    knots: int
    K_inv: np.ndarray
    K_logdet: float
    log_noise: np.ndarray
    slope: np.ndarray
    run: np.ndarray
    runs: int

    @property
    def latent(self) -> int:
        return 6 + 3 * self.knots

    def only(self, columns: np.ndarray) -> Gram:
        """Gram of some shared columns (the residual is kept)."""
        keep = np.concatenate([np.arange(self.latent), self.latent + columns, [self.G.shape[-1] - 1]])
        return replace(
            self,
            G=np.ascontiguousarray(self.G[:, keep][:, :, keep]),
            slope=self.slope[:, keep[self.latent :] - self.latent],
        )

    def precision(self, log_force: np.ndarray) -> np.ndarray:
        """Prior precision of [eta, w]."""
        P = np.zeros((self.latent, self.latent))
        P[:6, :6] = ETA_PRECISION * np.eye(6)
        for j in range(3):
            at = slice(6 + j * self.knots, 6 + (j + 1) * self.knots)
            P[at, at] = self.K_inv * np.exp(-log_force[j])
        return P

    def reduce(self, log_force: np.ndarray) -> Reduced:
        """Integrate eta and w out of every segment and sum over the segments of a run."""
        Z, runs = self.latent, np.flatnonzero(np.diff(self.run, prepend=-1))
        inverse, logdet = inverses(self.G[:, :Z, :Z] + self.precision(log_force))
        right, S = np.ascontiguousarray(self.G[:, :Z, Z:]), by_run(self.G[:, Z:, Z:], self.run)
        solved, slope = inverse @ right, by_run(self.slope, self.run)
        for i, (a, b) in enumerate(pairwise([*runs, len(self.run)])):  # one product a run: its sum over the segments
            S[i] -= right[a:b].reshape(-1, S.shape[2]).T @ solved[a:b].reshape(-1, S.shape[2])
        S[:, :-1, -1] += slope[:, :-1]
        S[:, -1, :] += slope
        logdet = (
            logdet + self.knots * np.sum(log_force) + 3 * self.K_logdet + self.log_noise - 6 * np.log(ETA_PRECISION)
        )
        return Reduced(S, by_run(logdet, self.run), inverse, solved)


@dataclass(frozen=True)
class Reduced:
    """Sums per run with eta and w integrated out: S (N, G + 1, G + 1) of [shared, e] and logdet (N,); inverse and
    solved per segment, for back substitution."""

    S: np.ndarray
    logdet: np.ndarray
    inverse: np.ndarray
    solved: np.ndarray


@dataclass(frozen=True)
class Prior:
    """Columns in the model: `shared` by all runs with prior precisions, `random` with a variance log_tau2 each."""

    shared: np.ndarray
    precision: np.ndarray
    random: np.ndarray
    log_tau2: np.ndarray

    def and_shared(self, more: int) -> Prior:
        """Prior with `more` further shared columns behind its own, each with unit variance."""
        at = len(self.shared) + len(self.random) + np.arange(more)
        return replace(self, shared=np.append(self.shared, at), precision=np.append(self.precision, np.ones(more)))


@dataclass(frozen=True)
class Solution:
    """Posterior of the coefficients.

    log_evidence: without constants. squares: twice the negative log posterior at its mode, as the linear model expects
    it. mean, cov: of `prior.shared`. means (N, R), covs (N, R, R): of `prior.random`. per_run (N,): share of each run
    in the log evidence given the mean.
    """

    log_evidence: float
    squares: float
    mean: np.ndarray
    cov: np.ndarray
    means: np.ndarray
    covs: np.ndarray
    per_run: np.ndarray


def shared_alone(reduced: Reduced, prior: Prior) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Sums S (N, P + 1, P + 1) of [prior.shared, e] and logdet (N,) with the values of single runs integrated out; for
    back substitution, covs (N, R, R) given the shared coefficients, and covs times their products with [shared, e]."""
    keep, random = np.append(prior.shared, reduced.S.shape[1] - 1), prior.random
    S = reduced.S[:, keep][:, :, keep]
    if not len(random):
        return S, reduced.logdet, np.zeros((len(S), 0, 0)), np.zeros((len(S), 0, len(keep)))
    A = reduced.S[:, random][:, :, random] + np.diag(np.exp(-prior.log_tau2))
    covs, right = np.linalg.inv(A), reduced.S[:, random][:, :, keep]
    back = covs @ right
    return S - np.swapaxes(right, 1, 2) @ back, reduced.logdet + log_determinant(A) + np.sum(prior.log_tau2), covs, back


def solve(reduced: Reduced, prior: Prior) -> Solution:
    """Integrate the random effects and the shared coefficients out."""
    S, logdet, covs, back = shared_alone(reduced, prior)
    total = S.sum(axis=0)
    A = total[:-1, :-1] + np.diag(prior.precision)
    cov = np.linalg.inv(A)
    mean = cov @ total[:-1, -1]
    quad = total[-1, -1] - total[:-1, -1] @ mean
    log_evidence = -0.5 * (quad + np.sum(logdet) + log_determinant(A) - np.sum(np.log(prior.precision)))
    fitted = np.append(-mean, 1.0)
    per_run = -0.5 * (np.einsum("nij,i,j->n", S, fitted, fitted) + logdet)
    means = back @ fitted
    spread = back[:, :, :-1] @ cov @ np.swapaxes(back[:, :, :-1], 1, 2)
    return Solution(float(log_evidence), float(quad), mean, cov, means, covs + spread, per_run)


def background(gram: Gram, reduced: Reduced, prior: Prior, solution: Solution) -> np.ndarray:
    """Estimates (B, Z) of the nuisance parameters [eta, w]."""
    B, G = len(reduced.solved), reduced.S.shape[1] - 1
    coefficients = np.zeros((B, G))
    coefficients[:, prior.shared] = solution.mean
    coefficients[:, prior.random] = solution.means[gram.run]
    return np.asarray(reduced.solved[:, :, -1] - (reduced.solved[:, :, :-1] @ coefficients[:, :, None])[..., 0])


def background_cov(gram: Gram, reduced: Reduced, prior: Prior, solution: Solution) -> np.ndarray:
    """Covariances (B, Z, Z) of the nuisance parameters [eta, w], with the uncertainty of the shared coefficients."""
    J, R = reduced.solved[:, :, prior.shared], reduced.solved[:, :, prior.random]
    return (
        reduced.inverse + J @ solution.cov @ np.swapaxes(J, 1, 2) + R @ solution.covs[gram.run] @ np.swapaxes(R, 1, 2)
    )


def update_force(gram: Gram, reduced: Reduced, prior: Prior, solution: Solution, estimate: np.ndarray) -> np.ndarray:
    """Log variances (3,) of the latent force after one EM step.

    Of the force's covariance (`background_cov`) it needs only the trace with K^-1, for which no matrix of a segment is
    built.
    """
    B, covs, log_force = len(estimate), solution.covs[gram.run], np.empty(3)
    for j in range(3):
        at = slice(6 + j * gram.knots, 6 + (j + 1) * gram.knots)
        w, solved = estimate[:, at], reduced.solved[:, at]
        J, R = solved[:, :, prior.shared], solved[:, :, prior.random]
        shared = J.reshape(B * gram.knots, -1).T @ (gram.K_inv @ J).reshape(B * gram.knots, -1)
        own = np.swapaxes(R, 1, 2) @ (gram.K_inv @ R)
        spread = (
            np.sum(gram.K_inv * reduced.inverse[:, at, at].sum(axis=0))
            + np.sum(shared * solution.cov)
            + np.sum(own * covs)
        )
        log_force[j] = np.log((np.sum(w @ gram.K_inv * w) + spread) / (B * gram.knots))
    least, most = THRESHOLDS.value("least_spread"), THRESHOLDS.value("most_latent_force")
    return np.clip(log_force, float(np.log(least**2)), float(np.log(most**2)))


def coefficients_of(gram: Gram, prior: Prior, solution: Solution, estimate: np.ndarray, size: int) -> np.ndarray:
    """Coefficients (B, size) of all columns per segment, with -1 for e: the vectors with which products are
    contracted."""
    theta = np.zeros((len(estimate), size))
    theta[:, : gram.latent] = estimate
    theta[:, gram.latent + prior.shared] = solution.mean
    theta[:, gram.latent + prior.random] = solution.means[gram.run]
    theta[:, -1] = -1.0
    return theta


def update_noise(
    products: Products,
    gram: Gram,
    reduced: Reduced,
    prior: Prior,
    solution: Solution,
    estimate: np.ndarray,
    floor: float,
) -> np.ndarray:
    """Log variances (6,) of the noise after one EM step; 0 for a channel that was not measured.

    They are conditional on the shared coefficients. Those are few beside the samples, and the errors of the latent
    force cancel the errors that they cause.
    """
    theta = coefficients_of(gram, prior, solution, estimate, products.size)
    squares = packed.contracted(products.P, theta, reduced.inverse)
    variances = np.where(squares > 0.0, squares / np.sum(products.samples), 1.0)
    return np.maximum(np.log(variances), floor)


def accelerated(step: Callable[[np.ndarray], tuple[float, np.ndarray]], theta: np.ndarray, cycles: int) -> np.ndarray:
    """Logarithms of variances after EM steps, extrapolated: plain EM converges slowly where the data hold little
    information on the latent force.

    `step` takes theta to (log evidence at theta, next theta). There are three steps a cycle, fewer once converged; an
    extrapolation that lowers the evidence is rejected.

    Source: Varadhan & Roland, Scand. J. Stat. 35 (2008) 335, scheme S3 (SQUAREM).
    """
    for _ in range(cycles):
        _, first = step(theta)
        plain, second = step(first)
        change, curve = first - theta, second - 2.0 * first + theta
        if np.max(np.abs(second - first)) < 0.003:
            return second
        length = float(np.clip(np.linalg.norm(change) / (np.linalg.norm(curve) + 1e-12), 1.0, 16.0))
        leap, beyond = step(np.maximum(theta + 2.0 * length * change + length**2 * curve, -20.0))
        theta = beyond if leap >= plain else second
    return theta
