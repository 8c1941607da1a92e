"""Screening: every candidate's evidence on one linearisation, without another simulation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...estimation.budget import is_spent
from ...estimation.gram import Gram, Prior, Reduced, accelerated, background, shared_alone, solve, update_force
from ...estimation.laplace import Fit
from ...estimation.linalg import log_determinant
from ...estimation.term import Term
from ..thresholds import THRESHOLDS

_TAUS = np.log(np.array([0.03, 0.1, 0.3, 1.0, 3.0]) ** 2)
"""Grid of log variances of the values of single runs, in squares of the typical size."""


@dataclass(frozen=True)
class Score:
    """A candidate beside a fitted model.

    score: twice the gain in log evidence (2 log Bayes factor with a prior of typical size), less the term's cost;
    estimate, sd (size,) in units of the typical size (for a random effect: root mean square over runs, and NaN);
    information (size, size): precision of the estimate that the data give, nuisances integrated out (for a random
    effect (N, size, size): of each run, what it has of its own integrated out); per_run (N,): gain in log likelihood by
    run; log_tau2: of a random effect; beside_form: information that is left beside a form error (`form_error`), where
    it is known.
    """

    term: Term
    score: float
    estimate: np.ndarray
    sd: np.ndarray
    information: np.ndarray
    per_run: np.ndarray
    log_tau2: float = 0.0
    beside_form: np.ndarray | None = None


def with_columns(prior: Prior, at: np.ndarray, term: Term, log_tau2: float, width: float = 1.0) -> Prior:
    """Prior of a model that holds the columns `at` as well."""
    if term.per_run:
        return replace(
            prior, random=np.append(prior.random, at), log_tau2=np.append(prior.log_tau2, np.full(len(at), log_tau2))
        )
    return replace(
        prior, shared=np.append(prior.shared, at), precision=np.append(prior.precision, np.full(len(at), width**-2))
    )


def evidence(gram: Gram, prior: Prior, log_force: np.ndarray, own_random: int = 0) -> tuple[float, np.ndarray, float]:
    """Log evidence with re-estimated variances of the force and of the last `own_random` random columns; and the log
    variances."""

    def with_tau(log_tau2: np.ndarray) -> Prior:
        return replace(
            prior,
            log_tau2=np.append(prior.log_tau2[: len(prior.log_tau2) - own_random], np.repeat(log_tau2, own_random)),
        )

    def step(theta: np.ndarray) -> tuple[float, np.ndarray]:
        reduced, now = gram.reduce(theta[:3]), with_tau(theta[3:])
        solution = solve(reduced, now)
        force = update_force(gram, reduced, now, solution, background(gram, reduced, now, solution))
        if not own_random:
            return solution.log_evidence, force
        own = slice(len(prior.random) - own_random, None)
        second = np.mean(solution.means[:, own] ** 2) + np.mean(
            np.diagonal(solution.covs[:, own, own], axis1=1, axis2=2)
        )
        return solution.log_evidence, np.append(force, np.log(second))

    theta = accelerated(step, np.append(log_force, prior.log_tau2[-1:] if own_random else []), 6)  # cycles
    return step(theta)[0], theta[:3], float(theta[3]) if own_random else 0.0


def _columns(fit: Fit) -> list[np.ndarray]:
    """Indices of the columns of the candidates of `fit`."""
    at, columns = fit.reduced.S.shape[1] - 1 - sum(t.size for t in fit.candidates), []
    for term in fit.candidates:
        columns.append(np.arange(at, at + term.size))
        at += term.size
    return columns


def _of_all_runs(fit: Fit) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Sums S (N, P + 1, P + 1) with the values of single runs integrated out, and the indices of the shared columns and
    of the candidates in them."""
    kept = np.setdiff1d(np.arange(fit.reduced.S.shape[1] - 1), fit.prior.random)
    S, *_ = shared_alone(fit.reduced, replace(fit.prior, shared=kept))
    return S, np.searchsorted(kept, fit.prior.shared), [np.searchsorted(kept, at) for at in _columns(fit)]


def glance(fit: Fit) -> list[Score]:
    """Scores of the candidates of `fit`, in their order, under its variances."""
    null = solve(fit.reduced, fit.prior)
    terms = zip(fit.candidates, _columns(fit), strict=True)
    return [_score(fit, term, at, null.log_evidence, null.per_run, fit.reduced) for term, at in terms]


def screen(fit: Fit) -> list[Score]:
    """Scores of the candidates of `fit`, best first. For those that are not hopeless the variances are re-estimated:
    the force of the baseline model has absorbed part of the missing cause."""
    gram, candidates, columns, scores = fit.gram, fit.candidates, _columns(fit), glance(fit)
    if is_spent():
        return sorted(scores, key=lambda s: -s.score)
    base = np.concatenate([fit.prior.shared, fit.prior.random]).astype(int)
    renumbered = replace(
        fit.prior, shared=np.arange(len(fit.prior.shared)), random=np.arange(len(fit.prior.shared), len(base))
    )
    before, log_force, _ = evidence(gram.only(base), renumbered, fit.hyper.log_force)
    for i, term in enumerate(candidates):
        if _wrong_way(term, scores[i].estimate):
            scores[i] = replace(scores[i], score=min(scores[i].score, 0.0))
            continue
        if scores[i].score < -THRESHOLDS.value("values_per_run") * term.per_run or is_spent():
            continue
        own = term.size if term.per_run else 0
        start = max(scores[i].log_tau2, float(np.log(0.1**2)))  # least variance at the start
        prior = with_columns(renumbered, len(base) + np.arange(term.size), term, start)
        after, _, log_tau2 = evidence(gram.only(np.append(base, columns[i])), prior, log_force, own)
        scores[i] = replace(scores[i], score=2.0 * (after - before) - term.cost(fit.plant.seg.runs), log_tau2=log_tau2)
    return sorted(scores, key=lambda s: -s.score)


def _wrong_way(term: Term, estimate: np.ndarray) -> bool:
    """Whether the estimate has the impossible sign of an effect that only slows, delays or narrows: a quicker actuator,
    water deeper than deep."""
    (*others, last) = (p for p in term.effect.parameters if not p.shape)
    return not others and not term.per_run and last.low >= 0.0 and float(estimate[0]) < 0.0


def _score(fit: Fit, term: Term, at: np.ndarray, null: float, null_runs: np.ndarray, reduced: Reduced) -> Score:
    """Score under the variances of the null."""
    if term.per_run:
        tries = [(solve(reduced, with_columns(fit.prior, at, term, tau)), tau) for tau in _TAUS]
        best, tau = max(tries, key=lambda pair: pair[0].log_evidence)
        values = best.means[:, -term.size :]
        rms = np.sqrt(np.mean(values**2, axis=0))
        score = 2.0 * (best.log_evidence - null) - term.cost(fit.plant.seg.runs)
        return Score(
            term, score, rms, np.full(term.size, np.nan), reduced.S[:, at][:, :, at], best.per_run - null_runs, tau
        )
    found = solve(reduced, with_columns(fit.prior, at, term, 0.0))
    cov = found.cov[-term.size :, -term.size :]
    information = np.linalg.inv(cov) - np.eye(term.size)
    score = 2.0 * (found.log_evidence - null) - term.cost(fit.plant.seg.runs)
    return Score(term, score, found.mean[-term.size :], np.sqrt(np.diag(cov)), information, found.per_run - null_runs)


def overlap(fit: Fit, term: Term, value: np.ndarray) -> dict[str, float]:
    """Share of the evidence for a candidate of size `value` that each other candidate could take over: 1 - gap/total,
    the best of its settings.

    gap is the expected log likelihood ratio left between the two (docs/theory.md#evidence-of-a-cause); base parameters
    are projected out of both.
    """
    by_run, base, places = _of_all_runs(fit)
    columns, S = dict(zip(fit.candidates, places, strict=True)), by_run.sum(axis=0)
    rest = np.arange(len(S) - 1)
    V = S[rest][:, rest] - S[rest][:, base] @ np.linalg.solve(
        S[np.ix_(base, base)] + np.diag(fit.prior.precision), S[base][:, rest]
    )
    own = columns[term]
    total = float(value @ V[np.ix_(own, own)] @ value)
    shares: dict[str, float] = {}
    for candidate, cols in columns.items():
        if candidate.label == term.label or total <= 0.0:
            continue
        cross = V[np.ix_(cols, own)] @ value
        taken = float(cross @ np.linalg.solve(V[np.ix_(cols, cols)] + 1e-6 * np.eye(len(cols)), cross))
        shares[candidate.label] = max(shares.get(candidate.label, 0.0), taken / total)
    return shares


def changes(fit: Fit) -> list[Score]:
    """Best beginning at a run of every candidate with one value for all runs, if that is better than from the first run
    on; best first.

    Two coefficients, one for all runs and one from run k on, are free; the score is that of the second beside the
    first, less 2 log N for the choice of k. The order of the runs is taken for their order in time. Where the kinds of
    manoeuvre change with it, a change is confounded with the model's errors in one of them, and none is searched. A
    change that one run supports nearly alone is none: a hull or propeller that is not of the fitted form does that.
    """
    (S, base, columns), barred = _of_all_runs(fit), other_kinds_from(fit.plant.seg.kinds)
    begins = np.array([k for k in places(len(S)) if k not in barred], dtype=int)
    if not len(begins):
        return []
    total, from_run = S.sum(axis=0), np.cumsum(S[::-1], axis=0)[::-1]
    prior, cost, found = fit.prior.precision, 2.0 * float(np.log(len(S))), []
    for term, cols in zip(fit.candidates, columns, strict=True):
        if term.per_run or term.effect.enters == "gear":
            continue
        scores, means = _changes(total, from_run[begins], base, prior, cols, cost)
        best = int(np.argmax(scores))
        k, score, least = int(begins[best]), float(scores[best]), float(scores[best])
        if score > 0.0:
            late = np.arange(len(S))[:, None, None] >= k
            least = float(np.min(_changes(total - S, from_run[k] - np.where(late, S, 0.0), base, prior, cols, cost)[0]))
        if least >= THRESHOLDS.value("change_without_one_run") * score:
            nan = np.full(term.size, np.nan)
            found.append(
                Score(
                    replace(term, since=k), score, means[best], nan, np.zeros((term.size, term.size)), np.zeros(len(S))
                )
            )
    return sorted(found, key=lambda s: -s.score)


def places(runs: int) -> range:
    """Runs with which a change may begin: three or more are sailed on either side."""
    return range(3, runs - 2)


def other_kinds_from(kinds: Sequence[str]) -> list[int]:
    """Runs among `places` from which on mostly other kinds of manoeuvre are sailed than before, and more so than in
    random order of the kinds; none where the kind of a run is not known."""
    if not all(kinds):
        return []
    of = np.array([[kind == one for one in sorted(set(kinds))] for kind in kinds], dtype=float)
    at, shuffle = np.array(places(len(kinds)), dtype=int), np.random.default_rng(0)
    by_chance = [_alike(shuffle.permutation(of), at) for _ in range(500)]  # random orders
    chance, mostly = np.quantile(by_chance, THRESHOLDS.value("error_probability"), axis=0), 0.5
    least = np.clip(chance, THRESHOLDS.value("alike_runs"), mostly)
    return [int(k) for k in at[_alike(of, at) < least]]


def _alike(of: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Share of runs of the same kinds before and after places, of the kinds (runs, kinds) of the runs."""
    before = np.cumsum(of, axis=0)[at - 1]
    shares = before / at[:, None], (of.sum(axis=0) - before) / (len(of) - at)[:, None]
    return np.asarray(np.minimum(*shares).sum(axis=1))


def _changes(
    total: np.ndarray, gated: np.ndarray, base: np.ndarray, prior: np.ndarray, cols: np.ndarray, cost: float
) -> tuple[np.ndarray, np.ndarray]:
    """Scores (K,) of columns that change, and the changes (K, size): what coefficients that are free from then on add
    to those of all runs.

    total: sum of S over all runs, (G + 1, G + 1) or one for each change; gated: (K, G + 1, G + 1) over those from the
    change on.
    """
    keep, last, own = np.concatenate([base, cols]), gated.shape[-1] - 1, np.eye(len(cols))
    A = total[..., keep[:, None], keep] + np.diag(np.append(prior, np.ones(len(cols))))
    across = gated[:, keep[:, None], cols]
    solved = np.linalg.solve(
        A, np.concatenate([across, np.broadcast_to(total[..., keep, last, None], (*across.shape[:2], 1))], axis=-1)
    )
    left = gated[:, cols[:, None], np.append(cols, last)] - np.swapaxes(across, 1, 2) @ solved
    V, s = left[..., :-1] + own, left[..., -1:]
    means = np.linalg.solve(V, s)
    return np.sum(s * means, axis=(1, 2)) - log_determinant(V) - cost, means[..., 0]
