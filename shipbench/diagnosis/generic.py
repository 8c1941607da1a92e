"""The second library: what an unexplained force depends on, where no named cause fits. It needs no simulation."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from .columns import Bend, Columns
from .forms import Feature, features
from .gram import Gram, Prior, solve
from .model import Linearisation
from .screen import evidence
from .settle import Fit, products_of, sloped

AXES = ("surge", "sway", "yaw")
_PRIOR_SD = 0.5
"""Of a form's coefficient, in units of the scales of the latent force (5 mm/s^2, 5 mm/s^2, 1e-4 rad/s^2 at 130 m)."""
_WORTH_MORE = 2.0


@dataclass(frozen=True)
class Dependence:
    """A missing force of one axis follows one variable, best in this form. score: 2 log Bayes factor, less that of the choice of the form; share: of
    the variance of that axis's latent force that it takes; size: root mean square of what it takes, in units of the scales of the latent force."""

    variable: str
    axis: str
    form: str
    score: float
    share: float
    size: float


def dependences(fit: Fit, beside: Collection[str] = ()) -> list[Dependence]:
    """Every variable on every axis, best first; judged beside the model of `fit`, and beside forces that follow the variables `beside`.

    The forces are there at every step of the trajectory: between the knots of the latent force, rudder and propeller change.
    """
    lin = Linearisation(fit.plant, fit.scales, fit.point, fit.motion)
    columns, forms = lin.columns(), features(lin)
    side = [f for v in beside for f in forms.pop(v)]
    sides = [_pushed(lin, axis, side) for axis in range(len(AXES)) if side]
    looked = [(v, f) for v, of in forms.items() for f in of]
    base = np.concatenate([fit.prior.shared, fit.prior.random]).astype(int)
    first = len(base) + sum(c.shape[-1] for c, _ in sides)
    places = np.split(first + np.arange(sum(f.size for _, f in looked)), np.cumsum([f.size for _, f in looked])[:-1])
    prior = _with(fit.prior, np.arange(len(base), first))
    plain = replace(prior, shared=np.arange(len(prior.shared)), random=len(prior.shared) + np.arange(len(prior.random)))
    inside = np.concatenate([prior.shared, prior.random]).astype(int)
    found, before, usual = [], -np.inf, fit.hyper.log_force
    for axis, name in enumerate(AXES):
        gram = _gram(fit, lin, columns, [*sides, _pushed(lin, axis, [f for _, f in looked])])
        reduced = gram.reduce(fit.hyper.log_force)
        null = solve(reduced, prior).log_evidence
        if not axis:
            before, usual, _ = evidence(gram.only(inside), plain, fit.hyper.log_force)
        for variable, of in forms.items():
            tried = [(solve(reduced, _with(prior, at)).log_evidence, f.form, at) for (v, f), at in zip(looked, places, strict=True) if v == variable]
            after, form, at = max(tried, key=lambda t: t[0])
            gain, log_force, cost = after - null, usual, float(np.log(len(of)))
            if gain - cost > _WORTH_MORE:
                after, log_force, _ = evidence(gram.only(np.append(inside, at)), _with(plain, len(inside) + np.arange(len(at))), usual)
                gain = after - before
            share = 1.0 - float(np.exp(log_force[axis] - usual[axis]))
            size = float(np.sqrt(max(share, 0.0) * np.exp(usual[axis])))
            found.append(Dependence(variable, name, form, 2.0 * (gain - cost), share, size))
    return sorted(found, key=lambda d: -d.score)


def _pushed(lin: Linearisation, axis: int, of: Sequence[Feature]) -> tuple[np.ndarray, Bend]:
    """Columns of the forms on one axis, and how they bend the motion's sensitivities."""
    on, aside = (_PRIOR_SD * np.concatenate(x) for x in ([f.on for f in of], [f.aside for f in of]))
    return lin.pushed(axis, on, aside)


def _with(prior: Prior, at: np.ndarray) -> Prior:
    return replace(prior, shared=np.append(prior.shared, at), precision=np.append(prior.precision, np.ones(len(at))))


def _gram(fit: Fit, lin: Linearisation, columns: Columns, more: Sequence[tuple[np.ndarray, Bend]]) -> Gram:
    """The Gram of a fit with more columns."""
    columns = replace(columns, candidates=tuple(c for c, _ in more), bends=(*columns.bends, *(b for _, b in more)))
    return sloped(lin, columns, products_of(fit.plant, fit.scales, fit.point, columns), fit.hyper).weigh(fit.hyper)
