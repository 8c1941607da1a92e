"""Requirements on an identified cause: the one list for the selection of causes, the reasons of rejection and the
detection limits."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...estimation.laplace import Fit
from ...estimation.robust_prior import STRANGE_SIZE
from ...estimation.term import Term
from ..thresholds import THRESHOLDS
from .agreement import (
    bends,
    imitates,
    is_borne_by_one,
    is_on_a_ship,
    is_told_from_form,
    lasts,
    least_size,
    matters,
    relies_on_a_ship,
    runs_agree,
    tells_runs_apart,
)
from .form_error import FormError
from .screening import Score


@dataclass(frozen=True)
class Standard:
    """Standard for the causes of some runs.

    Attributes:
        null: the baseline model.
        threshold: least score of an identified cause, 2 log Bayes factor.
        off_form: further score required of causes confounded with the form of this hull: a hull that differs from the
            regressions also differs from the fitted form.
        careful: False where the causes are given: then no evidence is required.
    """

    null: Fit
    threshold: float
    off_form: float = 0.0
    careful: bool = True

    def asked_besides(self, term: Term, size: float = 0.0) -> float:
        """Score that a term needs beyond the threshold, since it is confounded with the form of the hull. It is less
        for one whose `size`, in typical ones, casts doubt on the ship file: that identifies no cause."""
        if not self.careful:
            return 0.0
        traits = term.effect.traits
        besides = 0.0
        if term.per_run:
            besides = THRESHOLDS.value("evidence_of_run_values")
        elif traits.absorbs_misfit and size < STRANGE_SIZE:
            besides = THRESHOLDS.value("evidence")
        return besides + self.off_form * (term.per_run or term.since is not None or traits.between_ships)


@dataclass(frozen=True)
class Verdict:
    """Result of a requirement; `reason` says why it is not met."""

    met: bool
    reason: str = ""


class Requirement:
    """Requirement on the index-th cause of a model. `of_size`: it tells whether ordinary ships have as much, and is
    checked last, when all others are met: what they have is a part of the ship, beside which others are judged."""

    of_size = False

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        """Whether the cause meets it."""
        raise NotImplementedError

    def least_size(self, seen: Score, standard: Standard) -> np.ndarray | float:
        """Smallest size of each amplitude, in typical ones, that could meet it in these runs; 0 where it requires
        none."""
        return 0.0


class Evidence(Requirement):
    """Score of at least the threshold, and the further score required of its kind. Selection checks it by refits; here
    it is the linearised model's."""

    @staticmethod
    def asked(fit: Fit, index: int, standard: Standard) -> float:
        """Score that the cause must reach."""
        return standard.threshold + standard.asked_besides(fit.model.terms[index], np.max(np.abs(fit.values[index])))

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        asked, worth = self.asked(fit, index, standard), fit.worth(index)
        return Verdict(bool(worth >= asked), f"score {worth:.1f} below {asked:.1f}")

    def least_size(self, seen: Score, standard: Standard) -> np.ndarray | float:
        """Size x of each amplitude that is expected to reach the required score; of values of single runs the root mean
        square x, where the sum of x^2 tr(V) - log det(1 + x^2 V) is that score."""
        term = seen.term
        asked = standard.threshold + term.cost(standard.null.plant.seg.runs) + standard.asked_besides(term)
        if term.per_run:
            return _root_mean_square(seen.information, asked)
        return _least_amplitudes(seen.information, asked)


class Plausible(Requirement):
    """Size that a ship may have."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        return Verdict(is_on_a_ship(fit, index), "no ship has it of the size that the runs ask for")


class OrdinaryShip(Requirement):
    """Ship coefficients behind the cause are those of a real ship (a superstructure, for an unmeasured wind)."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        return Verdict(
            relies_on_a_ship(fit, fit.model.terms[index].effect), "it would need a superstructure that no ship has"
        )


class NoImitation(Requirement):
    """Independence of the law of another cause in the model, which it does not merely correct."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        of = " and ".join(fit.model.terms[index].effect.traits.imitates)
        return Verdict(
            not imitates(fit, index),
            f"it points straight along the force of {of}, whose own law leaves what looks like it",
        )


class ConstantWithinRuns(Requirement):
    """Values of single runs last for their run, and leave little difference between runs."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        met = not fit.model.terms[index].per_run or (lasts(fit) and tells_runs_apart(fit))
        return Verdict(met, "one value for each run does not explain how runs differ")


class RunsAgree(Requirement):
    """Runs agree, as independent observations, that the size is not zero, and no single one supports it against the
    others."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        if fit.model.terms[index].per_run:
            return Verdict(True)
        if not runs_agree(fit, index):
            return Verdict(False, "the runs do not agree that its size differs from zero")
        return Verdict(not is_borne_by_one(fit, index), "one run alone supports it, and the others speak against it")


class BeyondForm(Requirement):
    """Evidence beside a form error, too: what the fitted form of a ship lacks repeats in every run, and with exact
    sensors passes for a cause. Values of single runs differ, as a form error does not."""

    of_size = True

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        if fit.model.terms[index].per_run:
            return Verdict(True)
        form = FormError(fit)
        score = form.score(index)
        if score < standard.threshold:
            beside = "beside an ordinary error of the ship's fitted form"
            return Verdict(False, f"score {score:.1f} {beside}, below {standard.threshold:g}")
        told = is_told_from_form(fit, index, *form.estimate(index))
        return Verdict(told, "the form of a hull moves its estimate by as much")

    def least_size(self, seen: Score, standard: Standard) -> np.ndarray | float:
        return 0.0 if seen.beside_form is None else _least_amplitudes(seen.beside_form, standard.threshold)


class SameShip(Requirement):
    """Coefficients of the cause do not turn an ordinary ship into an outlier."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        return Verdict(not bends(fit, index, standard.null), "beside it the ship's own coefficients become outliers")


class Significant(Requirement):
    """Size of practical significance."""

    of_size = True

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        term = fit.model.terms[index]
        return Verdict(
            matters(fit, index),
            f"less than {least_size(fit, term):.0%} of its typical size: not practically significant",
        )

    def least_size(self, seen: Score, standard: Standard) -> np.ndarray | float:
        return least_size(standard.null, seen.term)


EVIDENCE, SIGNIFICANT, SAME_SHIP, BEYOND_FORM = Evidence(), Significant(), SameShip(), BeyondForm()
REQUIREMENTS: tuple[Requirement, ...] = (
    EVIDENCE, Plausible(), OrdinaryShip(), NoImitation(), ConstantWithinRuns(), RunsAgree(), SAME_SHIP, BEYOND_FORM,
    SIGNIFICANT,
)  # fmt: skip
"""Requirements in the order in which they are checked."""
ABOVE_ORDINARY = tuple(r for r in REQUIREMENTS if r.of_size)
SURE = tuple(r for r in REQUIREMENTS if r not in (EVIDENCE, SAME_SHIP, *ABOVE_ORDINARY))
"""Requirements on a cause by itself: evidence is checked by refits, and the ship is compared with that of the baseline
model once the causes are chosen."""


def first_unmet(requirements: Iterable[Requirement], fit: Fit, index: int, standard: Standard) -> Verdict:
    """Verdict of the first requirement that is not met, or a met one."""
    return next((v for r in requirements if not (v := r.check(fit, index, standard)).met), Verdict(True))


def detection_limit(seen: Score, standard: Standard) -> np.ndarray:
    """Detection limit of each amplitude of a candidate, in typical sizes."""
    limits = [np.broadcast_to(r.least_size(seen, standard), (seen.term.size,)) for r in REQUIREMENTS]
    return np.max(limits, axis=0)


def _least_amplitudes(information: np.ndarray, asked: float) -> np.ndarray:
    """Size x along amplitude i for which x^2 V_ii - log det(1 + V) is `asked`, of an `information` V (size, size)."""
    V = np.maximum(np.diag(information), 1e-12)
    volume = np.linalg.slogdet(np.eye(len(V)) + information)[1]
    return np.asarray(np.sqrt((asked + volume) / V))


def _root_mean_square(information: np.ndarray, asked: float) -> float:
    """Root mean square of the values of single runs, whose `information` (N, size, size) is known, where they are
    expected to score `asked`."""
    from scipy.optimize import brentq

    seen = np.maximum(np.linalg.eigvalsh(information), 0.0) + 1e-12
    return float(
        np.exp(brentq(lambda x: np.sum(np.exp(2.0 * x) * seen - np.log1p(np.exp(2.0 * x) * seen)) - asked, -20.0, 20.0))
    )
