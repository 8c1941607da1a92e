"""Analysis of one set of runs, without its gain: causes, their order, and the unexplained remainder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...estimation.baseline import null_fit
from ...estimation.budget import is_spent, refuse_large
from ...estimation.coefficients import HULL, NUM_BASE
from ...estimation.forward import Plant
from ...estimation.laplace import Fit, hull_evidence
from ...estimation.linearisation import Scales
from ...estimation.robust_prior import NOTICEABLE
from ...physics.actuators import Gear
from ..actuators.identify import find_in_gears
from ..actuators.kinds import GearFinding
from ..actuators.record_error import RecordError
from ..preparation.actuator_readings import judged
from ..thresholds import THRESHOLDS
from .form_error import beside_form
from .requirements import Standard
from .stepwise import Selection, candidates_for, select
from .unknown import NO_FORM, Dependence, Search, dependences

THRESHOLD = THRESHOLDS.value("evidence")
"""Least score of an identified cause, 2 log Bayes factor; the bootstrap of each diagnosis may raise it."""
HULL_THRESHOLD = THRESHOLDS.value("evidence_of_misfit")
_HULL_ALONE = ("speed", "sway velocity", "yaw rate")
_ESTIMATED = ("rudder", "revolutions", "revolutions and rudder", "speed and rudder")
"""Variables of forces that belong to the hull where its derivatives are off, and to rudder and propeller where the ship
file leaves them to an estimate: they are no unknown cause, and others are judged beside them."""


@dataclass(frozen=True)
class Analysis:
    """Findings of one set of runs.

    threshold: the one in use; hull: twice the log Bayes factor that the hull differs from the regressions, or 0; gears:
    identified effects on actuators; unknown: the dependence that no identified cause covers; rival: one that covers
    about as much as the identified causes; left: one that remains beside them; misread: errors of the actuators'
    records.
    """

    selection: Selection
    threshold: float
    null_draws: np.ndarray
    hull: float
    gears: tuple[GearFinding, ...]
    all_gears: tuple[GearFinding, ...]
    generic: tuple[Dependence, ...]
    unknown: Dependence | None = None
    rival: Dependence | None = None
    left: Dependence | None = None
    misread: tuple[RecordError, ...] = ()

    @property
    def final(self) -> Fit:
        """Fit with the causes found."""
        return self.selection.final

    @property
    def standard(self) -> Standard:
        """Standard for the causes."""
        return Standard(self.selection.null, self.threshold, self.selection.off_form)

    def score(self, index: int) -> tuple[float, int, str]:
        """Twice the log Bayes factor of the index-th cause, number of runs that support it, and its alternative: beside
        the others or where it was added.

        The linear model of the fit without it does not hold so far from its point: the gain of a refit is an upper
        bound, or all there is.
        """
        score, term = self.final.worth(index), self.final.model.terms[index]
        added = max((s for s in self.selection.steps if s.term == term), key=lambda s: s.score, default=None)
        if added is not None and (score < self.threshold or score > added.score):
            return added.score, added.supporters, "before and after it was added"
        supporters = int(np.sum(self.final.solution.per_run > self.final.solution_without(index).per_run))
        return (
            score,
            supporters,
            "with and without it beside the other causes" if len(self.final.model.terms) > 1 else "with and without it",
        )

    @property
    def changed_gears(self) -> dict[str, Gear]:
        """Actuator dynamics that are causes, by actuator."""
        return {g.actuator: g.gear for g in self.gears}


def causes_of(null: Fit, threshold: float, only: Sequence[str] | None = None) -> tuple[Fit, dict[str, Gear]]:
    """Causes of one training part alone, by the same selection, with the threshold of the whole: the model with those
    in the motion, and the actuator dynamics that are causes."""
    selection = select(null, threshold)
    findings, _, _ = find_in_gears(selection.final.plant)
    return selection.final, {g.actuator: g.gear for g in _named_gears(findings, threshold, only)}


def _named_gears(findings: Sequence[GearFinding], threshold: float, only: Sequence[str] | None) -> list[GearFinding]:
    """Best finding of every actuator, if it reaches the threshold."""
    named: dict[str, GearFinding] = {}
    for g in findings:
        if (only is None or g.effect in only) and g.score > threshold:
            named.setdefault(g.actuator, g)
    return list(named.values())


def plain_model(plant: Plant, only: Sequence[str] | None = None, settled: Sequence[str] = ()) -> Fit:
    """Baseline model, fitted, with the candidates for its extension.

    Args:
        only: restrict the candidates to these effects (for an oracle that knows the truth).
        settled: effects of which the data are free already.

    Raises:
        InputError: it would take more memory than the budget allows.
    """
    candidates = candidates_for(plant, only, settled)
    refuse_large(len(plant.seg.run), plant.steps + 1, 7 + 3 * plant.knots + NUM_BASE + sum(t.size for t in candidates))
    return null_fit(plant, Scales(plant), candidates)


def analyse(
    null: Fit,
    *,
    only: Sequence[str] | None = None,
    seed: int = 0,
    cautious: bool = False,
    misread: Sequence[RecordError] = (),
) -> Analysis:
    """Look for causes in the motion and in the gears beside the plain model, and for dependences that no cause
    explains.

    Args:
        only: name none but these effects.
        cautious: name nothing (too little data), but rank everything.
        misread: errors of actuators' records that were taken out before.

    Once the budget is spent, no dependences are reported: they are compared with each other.
    """
    draws = null_maxima(null, seed)
    threshold = (
        max(THRESHOLD, float(np.quantile(draws, 1.0 - THRESHOLDS.value("error_probability")))) if only is None else 0.0
    )
    selection = select(null, np.inf if cautious else threshold)
    if not is_spent():
        selection = replace(selection, first=beside_form(selection.null, selection.first))
    null = selection.null
    findings, _, errors = find_in_gears(null.plant)
    gears = [] if cautious else _named_gears(findings, threshold, only)
    hull = 0.0 if is_spent() or (only is not None and HULL.name not in only) else hull_evidence(selection.final)
    known = Analysis(selection, threshold, draws, hull, tuple(gears), tuple(findings), ())
    if is_spent():
        return known
    if only is not None or cautious:
        return replace(known, generic=tuple(dependences(selection.final)))
    estimated = any(null.plant.ship.lacks(part) for part in ("rudder", "propeller"))
    search = Search(
        selection.small or selection.null,
        (*(_HULL_ALONE if hull > HULL_THRESHOLD else ()), *(_ESTIMATED if estimated else ())),
    )
    unknown, rival = _unknown(selection, gears, search)
    generic, left = tuple(search.found), None
    if selection.final.model.terms:
        beside = Search(selection.final)
        generic = tuple(beside.found)
        doubtful = (d for d in generic if d.of_sensor or d.variable in NO_FORM)
        left = next(iter(_beyond_form(doubtful, selection.off_form, beside)), None)
        left = None if left is None or left.has_name else left
    errors = [*misread, *judged(null, [e for e in errors if e.actuator not in {m.actuator for m in misread}])]
    if is_spent():
        return known
    if unknown is None and errors and not selection.final.model.terms and not gears:
        most = max(errors, key=lambda e: e.score)
        unknown = Dependence(most.variable, most.axis, most.form, most.score, np.nan, most.size, 0.0)
    left = None if unknown else left
    return replace(known, generic=generic, unknown=unknown, rival=rival, left=left, misread=tuple(errors))


def asked(d: Dependence, off_form: float) -> float:
    """Least score of an unknown force or error, 2 log Bayes factor; infinite for one that is too small.

    A force that depends on a variable of a ship's form must exceed several times `off_form` (`Selection.off_form`)
    besides: the more, the less of the latent force it explains. A force that depends on time, but leaves the latent
    force as large as it was, is wave motion.
    """
    least = THRESHOLDS.value("error_size") if d.of_sensor else 0.5 * NOTICEABLE
    if not d.of_sensor and d.variable == "time" and d.taken < least:
        return np.inf
    beyond = THRESHOLDS.value("evidence_beyond_library")
    ahead = (d.axis, d.variable) == (
        "surge",
        "nothing",
    )  # a resistance or a propeller of another form comes near a constant
    if d.of_sensor or (d.variable in NO_FORM and not ahead):
        return beyond if d.size > least else np.inf
    large, small = THRESHOLDS.value("off_form_of_large"), THRESHOLDS.value("off_form_of_small")
    ordinary = large + (small - large) * max(2.0 - d.taken / NOTICEABLE, 0.0)
    times = max(ordinary, THRESHOLDS.value("off_form_slope") * off_form)
    return beyond + times * off_form if d.taken > least else np.inf


def _beyond_form(found: Iterable[Dependence], off_form: float, search: Search) -> list[Dependence]:
    """First few dependences that have the score that is asked, and beside a form error of the ship that of any unknown
    cause."""
    first = [d for d in found if d.score > asked(d, off_form)][: THRESHOLDS.count("refits")]
    beyond = THRESHOLDS.value("evidence_beyond_library")
    return [d for d in first if is_spent() or search.beside_form(d) > beyond]


def _unknown(
    selection: Selection, gears: Sequence[GearFinding], search: Search
) -> tuple[Dependence | None, Dependence | None]:
    """Dependence with a higher score than all identified causes together, if one has; or a sensor error with about the
    same."""
    named = bool(selection.final.model.terms) or bool(gears)
    worth = (
        max([2.0 * (selection.final.evidence - selection.null.evidence), *(g.score for g in gears)]) if named else 0.0
    )
    least = THRESHOLDS.value("prediction_share") * worth
    found = _beyond_form((d for d in search.found if d.score > least), selection.off_form, search)
    contenders = [d if is_spent() else search.settled(d) for d in found] if named else found[:1]
    best, margin = max(contenders, key=lambda d: d.score, default=None), THRESHOLD
    if best is None or best.has_name:
        return None, None
    if not named or best.score > worth + margin:
        return best, None
    return None, best if best.of_sensor and best.score > worth - margin else None


def null_maxima(null: Fit, seed: int, draws: int = 1000) -> np.ndarray:
    """Greatest score of all candidates under the fitted null (parametric bootstrap on the fixed linearisation), sorted.

    The reduced right-hand side is Gaussian with the reduced normal matrix as covariance; random effects are left out
    (their null is narrower).
    """
    candidates, at = null.candidates, null.reduced.S.shape[1] - 1 - sum(t.size for t in null.candidates)
    base = null.prior.shared
    S = null.reduced.S.sum(axis=0)[:-1, :-1]
    rng = np.random.default_rng(seed)
    values, vectors = np.linalg.eigh(S)
    z = (vectors * np.sqrt(np.maximum(values, 0.0))) @ rng.standard_normal((len(S), draws))
    solved = np.linalg.solve(S[np.ix_(base, base)] + np.diag(null.prior.precision), np.column_stack([S[base], z[base]]))
    V, s = S - S[:, base] @ solved[:, : len(S)], z - S[:, base] @ solved[:, len(S) :]
    best = np.full(draws, -np.inf)
    for term in candidates:
        cols = np.arange(at, at + term.size)
        at += term.size
        if term.per_run:
            continue
        A = V[np.ix_(cols, cols)] + np.eye(len(cols))
        score = (
            np.einsum("cd,cd->d", s[cols], np.linalg.solve(A, s[cols]))
            - np.linalg.slogdet(A)[1]
            - term.cost(null.plant.seg.runs)
        )
        best = np.maximum(best, score)
    return np.sort(best)
