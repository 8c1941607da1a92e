"""Baselines of the diagnosis: two usual methods to identify a missing cause, on the same data, candidates and
linearised model.

Both assume that the model's residual is white. It never is, so both find a cause in nearly every data set.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...diagnosis.preparation.plant import plant_of
from ...effects.base import EFFECTS, flow_first
from ...estimation.coefficients import FREE, NUM_BASE, NUM_HULL, parameters
from ...estimation.forward import Plant
from ...estimation.gauss_newton import between, start
from ...estimation.linearisation import Columns, Linearisation, Point, Scales, predict
from ...estimation.rollout import Active
from ...estimation.term import Term
from ...ops import Array
from ...physics import eq2
from ...physics.modifiers import Flow, Modifiers
from ...physics.wind import apparent_wind
from ...records import Dataset
from .cases import singles

_ITERATIONS = 6
_WINDOW = 9
_MOST_NAMED = 4


@dataclass(frozen=True)
class Ranking:
    """Effects with their scores (information gained: test statistic less the penalty of its degrees of freedom), best
    first; `named`: those above zero that the method would report, at most one (white residuals) or four (regression).
    """

    ranking: tuple[tuple[str, float], ...]
    named: tuple[str, ...]

    @property
    def verdict(self) -> str:
        """Verdict of the method by the effects that it reports."""
        return "found" if self.named else "none"


def candidate_terms(plant: Plant, names: Sequence[str] | None = None) -> list[Term]:
    """Terms of the effects that can act on this ship, one per setting of their shape parameters, in the forms that the
    suite draws."""
    terms = []
    for name in names or singles():
        effect = EFFECTS.get(name)
        if effect.family == "thruster" and not np.any(plant.seg.states[..., 8:10]):
            continue
        others = [p.other for p in effect.parameters if p.shape]
        settings = [
            s
            for s in effect.settings(plant.seg.states[..., :2], plant.ship)
            if not any(v for v, other in zip(s, others, strict=True) if other)
        ]
        terms += [Term(effect, tuple(s), effect.per_run) for s in settings]
    return terms


def white_residual_test(dataset: Dataset, names: Sequence[str] | None = None) -> Ranking:
    """Score test of every candidate on the residuals of an output-error fit (base parameters and initial states, no
    latent force).

    The residuals count as white with one variance per channel; the penalty is that of BIC. Effects with one set of
    values per run have as many degrees of freedom as runs.
    """
    plant = plant_of(dataset)
    scales, terms = Scales(plant), candidate_terms(plant, names)
    point, _ = start(plant)
    noise = scales.noise
    for _ in range(_ITERATIONS):
        columns = Linearisation(plant, scales, point).columns()
        error = _error(plant, columns.predicted)
        noise = np.maximum(np.sqrt(np.mean(error[plant.seg.mask] ** 2, axis=0)), 0.3 * scales.noise)
        step_eta, step_base = _newton(plant, columns, error, noise, point)
        target = replace(point, eta=point.eta + step_eta, base=point.base + step_base)
        better = _line_search(plant, scales, point, target, noise)
        if better is None:
            break
        point = better
    columns = Linearisation(plant, scales, point).columns(terms)
    scores = _score_test(plant, columns, noise, terms)
    return Ranking(scores, tuple(name for name, score in scores[:1] if score > 0.0))


def derivative_regression(dataset: Dataset, names: Sequence[str] | None = None) -> Ranking:
    """Sparse regression of smoothed derivatives as in SINDy (Brunton et al. 2016; for a known model's discrepancy:
    Kaheman et al. 2019).

    du, dv, dr by a local parabola over nine samples are regressed on the base model's terms plus every candidate's
    column, by forward selection with BIC. Sensor errors, which are no forces, have no columns: with them it selects
    `speed_scale` in every set, since smoothing makes all derivatives too small.
    """
    plant = plant_of(dataset)
    scales, terms = Scales(plant), [t for t in candidate_terms(plant, names) if t.effect.enters != "sensor"]
    rows = _Derivatives(plant, scales)
    target = rows.defect((), np.zeros(NUM_BASE))
    used = np.isfinite(target)
    step = 1e-2
    # of what differs between ships only resistance, rudder and hull: with all of it free, without priors, nothing is
    # left to be named
    base = [(target - rows.defect((), step * unit)) / step for unit in np.eye(NUM_BASE)[: len(FREE) + NUM_HULL]]
    weight = 1.0 / np.std(target[used.all(axis=-1)], axis=0)
    y, X = (weight * target)[used], np.stack([(weight * column)[used] for column in base], axis=-1)
    run = np.broadcast_to(plant.seg.run[:, None, None], target.shape)[used]
    own = [_term_columns(rows, plant, scales, term, target, weight, used, run) for term in terms]
    return _forward_selection(y, X, own, terms)


def _error(plant: Plant, predicted: np.ndarray) -> np.ndarray:
    """Residuals, measured less predicted, (B, K + 1, 6); zero where there is no sample."""
    return np.where(plant.seg.mask[..., None], np.nan_to_num(plant.seg.states[..., :6] - predicted), 0.0)


def _whitened(plant: Plant, values: np.ndarray, noise: np.ndarray) -> np.ndarray:
    """Columns (B, T, D) over the noise, zero where there is no sample."""
    scale = np.repeat(plant.seg.mask, 6, axis=1) / np.tile(noise, plant.steps + 1)
    return np.nan_to_num(values, posinf=0.0, neginf=0.0) * scale[..., None]


def _newton(
    plant: Plant, columns: Columns, error: np.ndarray, noise: np.ndarray, point: Point
) -> tuple[np.ndarray, np.ndarray]:
    """Gauss-Newton step of initial states (B, 6) and base parameters, with their priors."""
    e = _whitened(plant, error.reshape(len(error), -1, 1), noise)
    eta, base = _whitened(plant, columns.eta, noise), _whitened(plant, columns.base, noise)
    inverse = np.linalg.inv(np.swapaxes(eta, 1, 2) @ eta + 1e-4 * np.eye(6))
    back = inverse @ np.swapaxes(eta, 1, 2)
    left = base - eta @ (back @ base)
    A = np.einsum("bti,btj->ij", base, left) + np.eye(NUM_BASE)
    step = np.linalg.solve(A, np.einsum("bti,btk->i", left, e) - point.base)
    return (back @ (e - (base @ step)[..., None]))[..., 0], step


def _line_search(plant: Plant, scales: Scales, point: Point, target: Point, noise: np.ndarray) -> Point | None:
    """The first of the full, half ... sixteenth step that lowers the cost by more than one thousandth; None if none
    does."""

    def cost(at: Point) -> float:
        with np.errstate(over="ignore", invalid="ignore"):  # a step that sends the ship away costs infinitely much
            value = float(
                np.sum(((plant.seg.states[..., :6] - predict(plant, scales, at)) / noise)[plant.seg.mask] ** 2)
                + np.sum(at.base**2)
            )
        return value if np.isfinite(value) else np.inf

    now = cost(point)
    for share in (1.0, 0.5, 0.25, 0.125, 0.0625):
        trial = between(point, target, share)
        if cost(trial) < (1.0 - 1e-3) * now:
            return trial
    return None


def _score_test(
    plant: Plant, columns: Columns, noise: np.ndarray, terms: Sequence[Term]
) -> tuple[tuple[str, float], ...]:
    """Statistic of Rao for every term with initial states and base parameters projected out, less its degrees of
    freedom times log(values)."""
    e = _whitened(plant, _error(plant, columns.predicted).reshape(len(columns.predicted), -1, 1), noise)
    eta, base = _whitened(plant, columns.eta, noise), _whitened(plant, columns.base, noise)
    back = np.linalg.inv(np.swapaxes(eta, 1, 2) @ eta + 1e-4 * np.eye(6)) @ np.swapaxes(eta, 1, 2)

    def free(X: np.ndarray) -> np.ndarray:
        return X - eta @ (back @ X)

    base, e = free(base), free(e)
    A = np.linalg.inv(np.einsum("bti,btj->ij", base, base) + np.eye(NUM_BASE))
    e = e - (base @ (A @ np.einsum("bti,btk->i", base, e)))[..., None]
    price = math.log(6.0 * plant.seg.mask.sum())
    best: dict[str, float] = {}
    for term, column in zip(terms, columns.candidates, strict=True):
        X = free(_whitened(plant, column, noise))
        if term.per_run:
            runs = [plant.seg.run == k for k in range(plant.seg.runs)]
        else:
            X = X - base @ (A @ np.einsum("bti,btj->ij", base, X))
            runs = [np.ones(len(X), dtype=bool)]
        statistic = sum(
            _quadratic(np.einsum("bti,btj->ij", X[r], X[r]), np.einsum("bti,btk->i", X[r], e[r])) for r in runs
        )
        score = statistic - price * term.size * len(runs)
        best[term.label] = max(score, best.get(term.label, -np.inf))
    return tuple(sorted(best.items(), key=lambda item: -item[1]))


def _quadratic(V: np.ndarray, s: np.ndarray) -> float:
    """Quadratic form s' V^-1 s; directions without any information count nothing."""
    values, vectors = np.linalg.eigh(V)
    keep = values > 1e-9 * max(float(values[-1]), 1e-12)
    return float(np.sum((vectors.T @ s)[keep] ** 2 / values[keep]))


class _Derivatives:
    """Smoothed derivatives of the measured motion, and the model's accelerations at the smoothed states."""

    def __init__(self, plant: Plant, scales: Scales) -> None:
        self.plant, self.scales = plant, scales
        self.motion = self._smooth(plant.seg.states[..., :6], 0)
        self.derivative = self._smooth(plant.seg.states[..., 3:6], 1)

    def _smooth(self, values: np.ndarray, order: int) -> np.ndarray:
        from scipy.signal import savgol_filter

        window = min(_WINDOW, values.shape[1] - (values.shape[1] + 1) % 2)
        return savgol_filter(values, window, 2, deriv=order, delta=self.plant.seg.dt, axis=1)

    def defect(self, active: Sequence[Active], base: np.ndarray) -> np.ndarray:
        """Residual (B, K + 1, 3): derivative less model with the effects `active`, NaN where there is no sample."""
        plant, seg = self.plant, self.plant.seg
        act = seg.states[..., 6:10]
        if any(a.effect.enters == "gear" for a in active):
            path = plant.path_of(active)
            act = np.concatenate([path[:, :: plant.substeps, 0], path[:, -1:, 2]], axis=1)
        x, y, psi, u, v, r = np.moveaxis(self.motion, -1, 0)
        n, delta, F_b, F_s = np.moveaxis(act, -1, 0)
        p, hull = parameters(self.scales, base)
        e = Modifiers()
        t = seg.start[:, None] + seg.dt * np.arange(plant.steps + 1)
        for a in (*flow_first(active), *hull):
            a.effect.force(e, Flow(x, y, t, psi, u, v, r, n, delta, F_b, F_s), a.q, plant.ship)
        air: tuple[Array, Array] = (
            (u, v) if seg.wind is None else apparent_wind(psi, u, v, seg.wind[..., 0], seg.wind[..., 1])
        )
        found = np.stack(
            np.broadcast_arrays(*eq2.accelerations(u, v, r, n, delta, F_b, F_s, air, plant.c, p, e)), axis=-1
        )
        return np.where(seg.mask[..., None], self.derivative - found, np.nan)


def _term_columns(
    rows: _Derivatives,
    plant: Plant,
    scales: Scales,
    term: Term,
    target: np.ndarray,
    weight: np.ndarray,
    used: np.ndarray,
    run: np.ndarray,
) -> np.ndarray:
    """Columns (values, size) of a term at half its typical size; (values, size * runs) where every run has its own."""
    found = []
    unit = 0.5 * scales.amplitudes(term, plant.c.L)
    for a in range(term.size):
        q = (*(float(unit[a]) if k == a else 0.0 for k in range(term.size)), *term.setting)
        change = np.nan_to_num(
            weight * (target - rows.defect([Active(term.effect, q)], np.zeros(NUM_BASE))), posinf=0.0, neginf=0.0
        )[used]
        found += [change * (run == k) for k in range(plant.seg.runs)] if term.per_run else [change]
    return np.stack(found, axis=-1)


def _forward_selection(y: np.ndarray, X: np.ndarray, own: Sequence[np.ndarray], terms: Sequence[Term]) -> Ranking:
    """Add the term with the greatest gain in BIC until none gains."""
    values = len(y)

    def orthogonal(basis: np.ndarray, columns: np.ndarray) -> np.ndarray:
        rest = columns - basis @ (basis.T @ columns)
        return rest - basis @ (basis.T @ rest)

    def span(columns: np.ndarray) -> np.ndarray:
        left, sizes, _ = np.linalg.svd(columns, full_matrices=False)
        return left[:, sizes > 1e-6 * max(float(sizes[0]), 1e-12)] if sizes[0] > 1e-9 else left[:, :0]

    basis = span(X)
    first: dict[str, float] = {}
    named: list[str] = []
    for _ in range(_MOST_NAMED):
        e = orthogonal(basis, y)
        rss = float(e @ e)
        gains = []
        for columns in own:
            part = span(orthogonal(basis, columns))
            left = rss - float(np.sum((part.T @ e) ** 2))
            gains.append(values * math.log(rss / max(left, 1e-12 * rss)) - math.log(values) * part.shape[1])
        if not first:
            for term, gain in zip(terms, gains, strict=True):
                first[term.label] = max(gain, first.get(term.label, -np.inf))
        best = int(np.argmax(gains))
        if gains[best] <= 0.0:
            break
        named.append(terms[best].label)
        basis = np.concatenate([basis, span(orthogonal(basis, own[best]))], axis=1)
    return Ranking(tuple(sorted(first.items(), key=lambda item: -item[1])), tuple(dict.fromkeys(named)))
