"""Requirements that a cause must meet to be named: the one list by which causes are selected, rejections explained and
detection limits counted."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ..inference.laplace import Fit
from ..inference.robust_prior import STRANGE_SIZE
from ..model.term import Term
from ..thresholds import THRESHOLDS
from .agreement import (
    bends,
    imitates,
    is_borne_by_one,
    is_on_a_ship,
    lasts,
    least_size,
    matters,
    relies_on_a_ship,
    runs_agree,
    tells_runs_apart,
)
from .screening import Score


@dataclass(frozen=True)
class Standard:
    """Measure by which causes of some runs are judged.

    Attributes:
        null: the plain model.
        threshold: least gain of a named cause, 2 log evidence.
        off_form: gain asked besides of what the form of this hull could pass for: a hull that lies off the regressions
            is not of the fitted form either.
        careful: False where the causes are given: whoever is told the names asks for no evidence.
    """

    null: Fit
    threshold: float
    off_form: float = 0.0
    careful: bool = True

    def asked_besides(self, term: Term, size: float = 0.0) -> float:
        """Gain that a term must be worth besides the threshold, since what the form of a hull lacks could pass for it.
        Not so much of one whose `size`, in typical ones, doubts the ship file: that is no name."""
        if not self.careful:
            return 0.0
        traits = term.effect.traits
        besides = 0.0
        if term.per_run:
            besides = THRESHOLDS.value("evidence_of_run_values")
        elif traits.absorbs_misfit and size < STRANGE_SIZE:
            besides = THRESHOLDS.value("evidence_of_misfit")
        return besides + self.off_form * (term.per_run or term.since is not None or traits.between_ships)


@dataclass(frozen=True)
class Verdict:
    """Answer of a requirement; `reason` says why it is not met."""

    met: bool
    reason: str = ""


class Requirement:
    """One thing that is asked of the index-th cause of a model. `of_size`: it is asked last, when all others are
    met."""

    of_size = False

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        """Whether the cause meets it."""
        raise NotImplementedError

    def least_size(self, seen: Score, standard: Standard) -> np.ndarray | float:
        """Smallest size of each amplitude, in typical ones, that could meet it in these runs; 0 where it asks for
        none."""
        return 0.0


class Evidence(Requirement):
    """The cause is worth the threshold, and what is asked of its kind besides. Selection checks it by refits; here it
    is the linearised model's."""

    @staticmethod
    def asked(fit: Fit, index: int, standard: Standard) -> float:
        """Gain that the cause must be worth."""
        return standard.threshold + standard.asked_besides(fit.model.terms[index], np.max(np.abs(fit.values[index])))

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        asked, worth = self.asked(fit, index, standard), fit.worth(index)
        return Verdict(bool(worth >= asked), f"score {worth:.1f} below {asked:.1f}")

    def least_size(self, seen: Score, standard: Standard) -> np.ndarray | float:
        """Size x along amplitude i for which x^2 V_ii - log det(1 + V) is what is asked; of values of single runs the
        root mean square x, where the sum of x^2 tr(V) - log det(1 + x^2 V) is."""
        term = seen.term
        asked = standard.threshold + term.cost(standard.null.plant.seg.runs) + standard.asked_besides(term)
        if term.per_run:
            return _root_mean_square(seen.information, asked)
        V, volume = (
            np.maximum(np.diag(seen.information), 1e-12),
            np.linalg.slogdet(np.eye(term.size) + seen.information)[1],
        )
        return np.asarray(np.sqrt((asked + volume) / V))


class Plausible(Requirement):
    """A ship may have a cause of this size."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        return Verdict(is_on_a_ship(fit, index), "no ship has it of the size that the runs ask for")


class OrdinaryShip(Requirement):
    """The ship's coefficients that the cause relies on are those of some ship (a superstructure, for a wind that is not
    measured)."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        return Verdict(
            relies_on_a_ship(fit, fit.model.terms[index].effect), "it would need a superstructure that no ship has"
        )


class NoImitation(Requirement):
    """The cause does not merely mend the law of another one that is in the model."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        of = " and ".join(fit.model.terms[index].effect.traits.imitates)
        return Verdict(
            not imitates(fit, index),
            f"it points straight along the force of {of}, whose own law leaves what looks like it",
        )


class ConstantWithinRuns(Requirement):
    """Values of single runs last for their run, and leave little in which runs differ."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        met = not fit.model.terms[index].per_run or (lasts(fit) and tells_runs_apart(fit))
        return Verdict(met, "one value for each run does not explain how runs differ")


class RunsAgree(Requirement):
    """The runs, as independent witnesses, agree that the size is not zero, and no single one bears it against the
    others."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        if fit.model.terms[index].per_run:
            return Verdict(True)
        if not runs_agree(fit, index):
            return Verdict(False, "the runs do not agree that its size differs from zero")
        return Verdict(not is_borne_by_one(fit, index), "one run alone supports it, and the others speak against it")


class SameShip(Requirement):
    """A cause that acts through coefficients does not turn an ordinary ship into an outlier."""

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        return Verdict(not bends(fit, index, standard.null), "beside it the ship's own coefficients become outliers")


class Significant(Requirement):
    """The cause is large enough to matter."""

    of_size = True

    def check(self, fit: Fit, index: int, standard: Standard) -> Verdict:
        term = fit.model.terms[index]
        return Verdict(
            matters(fit, index),
            f"less than {least_size(fit, term):.0%} of its typical size: not practically significant",
        )

    def least_size(self, seen: Score, standard: Standard) -> np.ndarray | float:
        return least_size(standard.null, seen.term)


EVIDENCE, SIGNIFICANT, SAME_SHIP = Evidence(), Significant(), SameShip()
REQUIREMENTS: tuple[Requirement, ...] = (
    EVIDENCE, Plausible(), OrdinaryShip(), NoImitation(), ConstantWithinRuns(), RunsAgree(), SAME_SHIP, SIGNIFICANT,
)  # fmt: skip
"""All requirements, in the order in which they are asked."""
SURE = tuple(r for r in REQUIREMENTS if r not in (EVIDENCE, SAME_SHIP) and not r.of_size)
"""Those of a cause by itself: evidence is asked by refits, and the ship is compared with that of the plain model once
the causes are chosen."""


def first_unmet(requirements: Iterable[Requirement], fit: Fit, index: int, standard: Standard) -> Verdict:
    """Verdict of the first requirement that is not met, or one that is."""
    return next((v for r in requirements if not (v := r.check(fit, index, standard)).met), Verdict(True))


def detection_limit(seen: Score, standard: Standard) -> np.ndarray:
    """Size of each amplitude of a candidate, in typical ones, from which it is expected to be named."""
    limits = [np.broadcast_to(r.least_size(seen, standard), (seen.term.size,)) for r in REQUIREMENTS]
    return np.max(limits, axis=0)


def _root_mean_square(information: np.ndarray, asked: float) -> float:
    """Root mean square of the values of single runs, whose `information` (N, size, size) is known, where they are
    expected to score `asked`."""
    from scipy.optimize import brentq

    seen = np.maximum(np.linalg.eigvalsh(information), 0.0) + 1e-12
    return float(
        np.exp(brentq(lambda x: np.sum(np.exp(2.0 * x) * seen - np.log1p(np.exp(2.0 * x) * seen)) - asked, -20.0, 20.0))
    )
