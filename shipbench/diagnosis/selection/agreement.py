"""Agreement of runs on the size of a cause, if runs are independent, not samples (the errors of a wrong model are too
small), and its practical significance."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...data.noise import white_noise
from ...effects.base import Effect
from ...estimation.coefficients import PLACES
from ...estimation.forward import Segments
from ...estimation.gram import by_run, shared_alone, solve
from ...estimation.laplace import Fit
from ...estimation.robust_prior import STRANGE, is_strange, needed
from ...estimation.term import Term
from ...signals import STATES
from ..thresholds import THRESHOLDS
from .screening import evidence

_FACTORS = np.log(np.array([0.1, 0.2, 0.3, 0.5, 1.0, 2.0, 3.0, 5.0, 10.0]) ** 2)
"""Grid of factors of the variances of the values of single runs, or segments; the likeliest is taken."""


def inflation(fit: Fit, at: np.ndarray) -> np.ndarray:
    """Variance of the shared coefficients `at` (P,) by the sandwich clustered by run, over the model's. Values of
    single runs are integrated out; otherwise each run's current would count as its disagreement with the others."""
    S, *_ = shared_alone(fit.reduced, fit.prior)
    scores = S[:, :-1, -1] - S[:, :-1, :-1] @ fit.solution.mean
    bread = fit.solution.cov
    num = len(S)
    sandwich = bread @ (scores.T @ scores * num / max(num - 1, 1)) @ bread
    return np.diag(sandwich)[at] / np.diag(bread)[at]


def covariance(fit: Fit, index: int) -> np.ndarray:
    """Covariance of the values of a cause that all runs share, (P, P) in typical sizes: the model's, widened to the
    sandwich where that is wider. Where only the forces tell how far ahead on the ship positions and velocities are, by
    as much more as the form of a hull moves those."""
    at, term = np.flatnonzero(np.isin(fit.prior.shared, fit.columns_of(index))), fit.model.terms[index]
    wider = np.maximum(1.0, inflation(fit, at)) ** 0.5
    cov = fit.solution.cov[np.ix_(at, at)] * np.outer(wider, wider)
    return cov + _moved_by_form(fit, term)


def is_borne_by_one(fit: Fit, index: int) -> bool:
    """Whether one run alone supports a cause against the others: there is evidence for it, and, without that run,
    against it. Runs in which it does not act (propeller walk astern, where one run alone goes astern) speak neither
    way: what they leave is 0 but for rounding."""
    S, *_ = shared_alone(fit.reduced, fit.prior)
    inside, whole = np.isin(fit.prior.shared, fit.columns_of(index)), S.sum(axis=0)

    def evidence(keep: np.ndarray) -> np.ndarray:
        at, precision = np.append(keep, True), fit.prior.precision[keep]
        total = np.concatenate([whole[None], whole - S])[:, at][:, :, at]
        A, b = total[:, :-1, :-1] + np.diag(precision), total[:, :-1, -1]
        fitted = np.sum(b * np.linalg.solve(A, b[..., None])[..., 0], axis=1)
        return np.asarray(fitted - np.linalg.slogdet(A)[1] + np.sum(np.log(precision)))

    with_all, *left = evidence(np.ones_like(inside)) - evidence(~inside)
    return bool(with_all > 0.0 and len(left) > 1 and min(left) < -THRESHOLDS.value("tie"))


def lasts(fit: Fit) -> bool:
    """Whether one value in each run of all causes that have such explains the runs no worse than one in each piece of
    it, what runs share held where it is: a wind or a current stays for a run, what the model lacks of the ship changes
    with the manoeuvre. All such causes are judged together, since they take over from each other, and a wind has gusts
    (docs/calibration.md#values-of-single-runs). Runs of one piece cannot tell."""
    columns, num = fit.prior.random, len(fit.gram.run)
    pieces = replace(fit.gram, run=np.arange(num), runs=num).reduce(fit.hyper.log_force).S[:, columns]
    held = np.zeros(pieces.shape[-1])
    held[fit.prior.shared], held[-1] = fit.solution.mean, -1.0
    information, left = pieces[:, :, columns], -pieces @ held

    def worth(A: np.ndarray, b: np.ndarray) -> float:
        ways = [(A + np.diag(np.exp(-t)), t) for t in fit.prior.log_tau2 + _FACTORS[:, None]]
        return max(
            float(np.sum(b * np.linalg.solve(W, b[..., None])[..., 0]) - np.sum(np.linalg.slogdet(W)[1] + np.sum(t)))
            for W, t in ways
        )

    return worth(by_run(information, fit.gram.run), by_run(left, fit.gram.run)) >= worth(information, left)


def own_forces(fit: Fit) -> float:
    """Twice the log Bayes factor of a constant force of its own in each run, in all three axes of the ship, beside all
    causes."""
    inside = np.concatenate([fit.prior.shared, fit.prior.random]).astype(int)
    gram, shared, end = fit.gram.only(inside), len(fit.prior.shared), len(inside)
    prior = replace(fit.prior, shared=np.arange(shared), random=np.arange(shared, end))
    constant = np.zeros((gram.G.shape[-1], 3))
    constant[6 : gram.latent] = np.kron(np.eye(3), np.ones((gram.knots, 1)))
    unit = np.eye(len(constant))
    with_own = np.hstack([unit[:, :-1], constant, unit[:, -1:]])
    slope = np.insert(gram.slope, [end] * 3, 0.0, axis=1)
    wider = replace(gram, G=np.swapaxes(with_own, 0, 1) @ gram.G @ with_own, slope=slope)
    start = np.full(3, float(np.log(0.5**2)))  # search begins at half the latent force
    own = replace(prior, random=np.arange(shared, end + 3), log_tau2=np.append(prior.log_tau2, start))
    log_force = fit.hyper.log_force
    return 2.0 * (evidence(wider, own, log_force, 3)[0] - evidence(gram, prior, log_force)[0])


def tells_runs_apart(fit: Fit) -> bool:
    """Whether the values of single runs of all causes that have such leave little in which runs differ: a constant
    force of its own in each run, in the axes of the ship, beside them. What the model lacks of the ship is another
    force in each manoeuvre, and no current or wind explains it."""
    alone = replace(fit.prior, random=fit.prior.random[:0], log_tau2=fit.prior.log_tau2[:0])
    worth = 2.0 * (fit.solution.log_evidence - solve(fit.reduced, alone).log_evidence)
    return own_forces(fit) < THRESHOLDS.value("evidence_of_misfit") + THRESHOLDS.value("minor_share") * max(worth, 0.0)


def relies_on_a_ship(fit: Fit, effect: Effect) -> bool:
    """Whether the ship coefficients on which the effect relies are those of a real ship (a superstructure, of an
    unmeasured wind): otherwise it is confounded with another cause."""
    places = [PLACES[name] for name in effect.traits.relies_on]
    return not places or bool(np.max(np.abs(needed(fit)[places])) < STRANGE)


def is_on_a_ship(fit: Fit, index: int) -> bool:
    """Whether the size found is plausible on a ship (`Effect.plausible`); of values of single runs their root mean
    square counts."""
    term, values = (
        fit.model.terms[index],
        fit.values[index] * fit.scales.amplitudes(fit.model.terms[index], fit.plant.c.L),
    )
    size = np.sqrt(np.mean(values**2, axis=0)) if term.per_run else values
    return bool(term.effect.plausible((*size, *term.setting), fit.plant.ship))


def imitates(fit: Fit, index: int) -> bool:
    """Whether it is a steady vector along the normal of a cause with which it is confounded (a bank): the residual of
    that one's law looks like it."""
    of = fit.model.terms[index].effect.traits.imitates
    normals = [t.effect.normal(t.setting) for t in fit.model.terms if t.label in of]
    if not normals:
        return False
    north, east = fit.values[index]
    return any(
        n is not None and abs(np.sin(np.arctan2(east, north) - n)) < THRESHOLDS.value("along_the_normal")
        for n in normals
    )


def shows_on_any_ship(effect: Effect) -> bool:
    """Whether it shows beside the coefficients of another ship, too: a fault of a sensor, or a force that breaks a
    symmetry which every ship has (not a wind of each run, nor a bank, which act through coefficients alone)."""
    return effect.family == "sensor" or (effect.breaks_symmetry and not effect.traits.by_coefficients)


def bends(fit: Fit, index: int, null: Fit) -> bool:
    """Whether a cause that goes by the ship file is in a model that makes the ship an outlier, which she is not in the
    plain model `null`: then it explains one error by another (docs/calibration.md#ship-file)."""
    return (
        not shows_on_any_ship(fit.model.terms[index].effect)
        and is_strange(needed(fit))
        and not is_strange(needed(null))
    )


def runs_agree(fit: Fit, index: int) -> bool:
    """Whether the values of a cause that all runs share differ from zero (Hotelling's test over the runs)."""
    return _differs(fit, index, fit.values[index], covariance(fit, index))


def is_told_from_form(fit: Fit, index: int, value: np.ndarray, cov: np.ndarray) -> bool:
    """Whether the values of a cause, estimated beside a form error, differ from zero, where the form of a hull also
    moves them (`Effect.form_spread`)."""
    return _differs(fit, index, value, cov + _moved_by_form(fit, fit.model.terms[index]))


def _moved_by_form(fit: Fit, term: Term) -> np.ndarray:
    """Covariance (size, size) that the form of a hull adds to the estimate of a cause, in typical sizes."""
    length = fit.plant.c.L
    spread = np.array(term.effect.form_spread(term.setting, length))
    return np.diag((spread / fit.scales.amplitudes(term, length)) ** 2)


def _differs(fit: Fit, index: int, value: np.ndarray, cov: np.ndarray) -> bool:
    from scipy.stats import f

    num = fit.plant.seg.runs
    size, free = len(value), max(num - len(value), 1)
    squares = float(value @ np.linalg.solve(cov, value))
    doubt = float(f.sf(squares * free / (size * max(num - 1, 1)), size, free))
    return doubt < (
        THRESHOLDS.value("error_probability")
        if fit.model.terms[index].since is None
        else THRESHOLDS.value("error_probability_of_many")
    )


def least_size(fit: Fit, term: Term) -> float:
    """Least size of a cause that is practically significant, in typical sizes.

    Times of an actuator are at least half a sample, for which an order may have stood before it was recorded. Play
    behind a record exceeds what the record's noise makes of it. A delay beside that of another sensor is judged as that
    of a rudder: which of the two sensors is late, the ship's answer alone tells.
    """
    least = term.effect.least_size(term.setting)
    if term.effect.late and any(t.effect.late for t in fit.model.terms if t.label != term.label):
        least = max(least, THRESHOLDS.value("delay_beside_delay"))
    if term.effect.enters == "gear" and term.effect.parameters[0].unit == "s":
        least = max(least, 0.5 * fit.plant.seg.dt / float(fit.scales.amplitudes(term, fit.plant.c.L)[0]))
    if term.effect.traits.least_unrecorded and not fit.plant.seg.commanded:
        noise = _record_noise(fit.plant.seg, term.effect.acts_through[0]) / float(
            fit.scales.amplitudes(term, fit.plant.c.L)[0]
        )
        least = max(least, term.effect.traits.least_unrecorded, THRESHOLDS.value("doubtful_distance") * noise)
    return least


def _record_noise(seg: Segments, channel: str) -> float:
    """Standard deviation of the noise of the record of an actuator, in its unit."""
    record = seg.states[..., STATES.index(channel)]
    return float(np.median([white_noise(values[real]) for values, real in zip(record, seg.mask, strict=True)]))


def matters(fit: Fit, index: int) -> bool:
    """Whether a cause is practically significant; of one with a value for each run, their root mean square counts. Lag
    and delay of one actuator must be so together: where one takes back what the other does, what is left is smoother,
    but no later, as is a record that was filtered."""
    term, squares = fit.model.terms[index], np.sum(np.square(fit.values[index]), axis=-1)
    shared = term.effect.traits.gear_field in _LATER and not term.per_run
    together = _later(fit, term) if shared else np.inf
    return bool(min(np.mean(squares), together**2) >= least_size(fit, term) ** 2)


_LATER = ("T", "delay")
"""Times of an actuator that make the motion later, to first order by as much."""


def _later(fit: Fit, term: Term) -> float:
    """Time by which lag and delay of the actuator of `term` make the motion later together, in its typical size."""
    alike = [
        float(np.mean(value)) * float(fit.scales.amplitudes(other, fit.plant.c.L)[0])
        for other, value in zip(fit.model.terms, fit.values, strict=True)
        if other.effect.traits.gear_field in _LATER
        and not other.per_run
        and other.effect.acts_through == term.effect.acts_through
    ]
    return sum(alike) / float(fit.scales.amplitudes(term, fit.plant.c.L)[0])
