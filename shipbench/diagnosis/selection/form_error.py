"""Form error of a ship: forces beside those of the fitted form, the same in every run.

No fitted form is quite that of a ship. What it lacks repeats in each run, so that it gathers evidence with the length
of a record, and with exact sensors any cause may stand for it. A cause must explain more than such an error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from ...estimation.gram import Gram, Prior, solve
from ...estimation.laplace import Fit
from ...estimation.linearisation import Linearisation
from ..thresholds import THRESHOLDS
from .features import OUTSIDE, of_forces
from .form_columns import AXES, Tried, Wider, pushed
from .screening import Score, evidence

ORDINARY = (THRESHOLDS.value("least_spread"),) * len(AXES)
"""Standard deviations of the form error on the axes, in force scales: the least latent force, in every run the same."""


class FormError:
    """Fit beside a form error: random coefficients, shared by all runs, of every form of a force in the ship's own
    variables, on each axis.

    The coefficients of an axis have one variance, so that their sum has the standard deviation of the form error.
    """

    def __init__(self, fit: Fit) -> None:
        self.fit = fit

    @cached_property
    def _base(self) -> Wider:
        return Wider.of(self.fit)

    @cached_property
    def _forms(self) -> list[Tried]:
        return _forms(self._base.lin)

    @cached_property
    def _gram(self) -> Gram:
        """Gram with the columns of the form error."""
        return self._base.gram(self._forms)

    def score(self, index: int) -> float:
        """Score of the index-th cause, which all runs share (2 log Bayes factor), beside an ordinary form error."""
        return 2.0 * (self.evidence(ORDINARY) - self.evidence(ORDINARY, self.without(index)))

    def estimate(self, index: int) -> tuple[np.ndarray, np.ndarray]:
        """Value (size,) and covariance (size, size) of the index-th cause, which all runs share, beside an ordinary
        form error, in typical sizes."""
        gram, prior = self._with_form(self._gram, ORDINARY, self.fit.prior)
        found = solve(gram.reduce(self.fit.hyper.log_force), prior)
        at = np.flatnonzero(np.isin(self.fit.prior.shared, self.fit.columns_of(index)))
        return found.mean[at], found.cov[np.ix_(at, at)]

    def evidence(self, spread: Sequence[float], prior: Prior | None = None) -> float:
        """Log evidence beside a form error with standard deviations `spread` (3,) on the axes [force scales]."""
        return self._evidence(*self._with_form(self._gram, spread, prior or self.fit.prior))

    def _with_form(self, gram: Gram, spread: Sequence[float], prior: Prior) -> tuple[Gram, Prior]:
        """Columns of a prior and of a form error, and their prior."""
        sd = _spreads(self._forms, spread)
        on = np.flatnonzero(sd)
        at = len(self.fit.prior.shared) + len(self.fit.prior.random) + on
        shared, precision = np.append(prior.shared, at), np.append(prior.precision, sd[on] ** -2.0)
        return _only(gram, replace(prior, shared=shared, precision=precision))

    def _evidence(self, gram: Gram, prior: Prior) -> float:
        """Log evidence with re-estimated variances of the force."""
        return evidence(gram, prior, self.fit.hyper.log_force)[0]

    def gain(self, tried: Sequence[Tried], beside: Sequence[Tried] = ()) -> float:
        """Score of further columns beside an ordinary form error, and beside the columns `beside`."""
        gram = self._base.gram([*beside, *self._forms, *tried])
        prior, size, sides = self.fit.prior, sum(t.size for t in tried), sum(t.size for t in beside)
        precision = np.concatenate([prior.precision, np.ones(sides), _spreads(self._forms, ORDINARY) ** -2.0])
        first = len(prior.shared) + len(prior.random)
        shared = np.append(prior.shared, first + np.arange(len(precision) - len(prior.precision)))
        null = replace(prior, shared=shared, precision=precision)
        at = len(gram.slope[0]) - 1 - size + np.arange(size)
        more = replace(null, shared=np.append(shared, at), precision=np.append(precision, np.ones(size)))
        gained = self._evidence(*_only(gram, more)) - self._evidence(*_only(gram, null))
        return 2.0 * (gained - sum(t.cost for t in tried))

    def without(self, index: int) -> Prior:
        """Prior of the model without the index-th cause, which all runs share."""
        kept = ~np.isin(self.fit.prior.shared, self.fit.columns_of(index))
        return replace(self.fit.prior, shared=self.fit.prior.shared[kept], precision=self.fit.prior.precision[kept])


def _only(gram: Gram, prior: Prior) -> tuple[Gram, Prior]:
    """Columns of a prior alone, and the prior in their numbers."""
    inside, shared = np.concatenate([prior.shared, prior.random]).astype(int), np.arange(len(prior.shared))
    return gram.only(inside), replace(prior, shared=shared, random=len(shared) + np.arange(len(prior.random)))


def beside_form(null: Fit, scores: Sequence[Score]) -> list[Score]:
    """Scores with the information on their terms, candidates of the baseline model `null`, that is left beside a form
    error; values of single runs as they are."""
    wider = replace(Wider.of(null), columns=null.columns)
    forms = _forms(wider.lin)
    S = wider.gram(forms).reduce(null.hyper.log_force).S.sum(axis=0)
    sizes = [t.size for t in null.candidates]
    end = len(S) - 1 - sum(t.size for t in forms)
    first = end - sum(sizes)
    nuisance = np.concatenate([null.prior.shared, np.arange(end, len(S) - 1)]).astype(int)
    A = S[np.ix_(nuisance, nuisance)] + np.diag(np.append(null.prior.precision, _spreads(forms, ORDINARY) ** -2.0))
    V = S[first:end, first:end] - S[first:end, nuisance] @ np.linalg.solve(A, S[nuisance, first:end])
    at = dict(zip(null.candidates, np.cumsum(sizes, dtype=int) - np.array(sizes, dtype=int), strict=True))
    return [
        s if s.term.per_run else replace(s, beside_form=V[at[s.term] :, at[s.term] :][: s.term.size, : s.term.size])
        for s in scores
    ]


def _forms(lin: Linearisation) -> list[Tried]:
    """Columns of every form of a force in the ship's own variables, on each axis."""
    forms = {v: of for v, of in of_forces(lin).items() if v not in (*OUTSIDE, "thrusters")}
    return [t for axis in range(len(AXES)) for t in pushed(lin, axis, forms)]


def _spreads(forms: Sequence[Tried], spread: Sequence[float]) -> np.ndarray:
    """Standard deviations of the coefficients of `forms`, in units of their columns, which together have `spread` (3,)
    on the axes [force scales]."""
    axes = np.repeat([AXES.index(t.axis) for t in forms], [t.size for t in forms])
    return np.asarray(spread)[axes] / (THRESHOLDS.value("force_prior") * np.bincount(axes)[axes] ** 0.5)
