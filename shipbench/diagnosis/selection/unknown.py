"""Library of unknown causes: variables on which an unexplained force, or a sensor error, depends where no cause of the
library fits. It needs no simulation."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import groupby

import numpy as np

from ...estimation.budget import is_spent
from ...estimation.gauss_newton import fit
from ...estimation.gram import Gram, Prior, solve
from ...estimation.laplace import Fit, settled_evidence, sloped
from ...estimation.whitening import products_of
from ..thresholds import THRESHOLDS
from .features import OUTSIDE, of_forces, of_sensors
from .form_columns import AXES, Tried, Wider, added, pushed
from .form_error import FormError
from .screening import evidence

SENSORS = {"recorded heading": 2, "recorded surge": 3, "recorded sway": 4, "recorded yaw rate": 5}
"""Recorded quantities whose errors are searched, and their channels."""
_NAMED = ("recorded heading", "recorded yaw rate")
"""Records whose constant errors are causes of the library."""
NO_FORM = ("nothing", *OUTSIDE)
"""Variables on which no ship's form depends."""
_BY_RUN = ("heading", "position", "waves", "run")
"""Variables with a range of its own in each run. What a model lacks of a ship differs between manoeuvres, and passes
for a force that depends on these. It must explain more than a constant force of its own in each run; with the period of
waves more than a force of its own phase in each run. The latent force has no periods, and makes too much of waves that
are in step by chance."""


@dataclass(frozen=True)
class Dependence:
    """Missing force on one axis or more, or the error of a recorded channel, as a function of one variable, best in
    this form.

    score: 2 log Bayes factor, less that of the choice of the form; share: of the variance of that axis's latent force
    that it explains; size, taken: root mean square of the force itself, and of the part of the latent force that it
    explains, in units of the latent force, or of typical noise.
    """

    variable: str
    axis: str
    form: str
    score: float
    share: float
    size: float
    taken: float

    @property
    def of_sensor(self) -> bool:
        """Whether it is an error of a sensor, or of a command."""
        return self.axis.startswith(("recorded ", "ordered "))

    @property
    def has_name(self) -> bool:
        """Whether it is a cause of the library: too small to be identified, perhaps, but not unknown."""
        return self.variable == "nothing" and self.axis in _NAMED


def dependences(fit: Fit, beside: Collection[str] = ()) -> list[Dependence]:
    """Dependences that `Search` finds, best first."""
    return Search(fit, beside).found


class Search:
    """Search of every variable on every axis and channel, best first (`found`); judged beside the model of a fit, and
    beside forces that follow the variables `beside`, as on a ship that is the same to port and to starboard.

    The forces are there at every step of the trajectory: between the knots of the latent force, rudder and propeller
    change. Once the budget is spent, what is found is not all, and not to be used.
    """

    def __init__(self, fit: Fit, beside: Collection[str] = ()) -> None:
        self.fit, self.wider = fit, Wider.of(fit)
        lin = self.wider.lin
        forces, errors = of_forces(lin), of_sensors(lin)
        sides = [
            pushed(lin, axis, {v: [f for f in forces[v] if f.odd == (axis > 0)] for v in beside})
            for axis in range(len(AXES))
        ]
        self.sides = [t for of_axis in sides for t in of_axis]
        base = np.concatenate([fit.prior.shared, fit.prior.random]).astype(int)
        self.first = len(base) + sum(t.size for t in self.sides)
        self.prior = _with(fit.prior, np.arange(len(base), self.first))
        shared, random = len(self.prior.shared), len(self.prior.random)
        self.plain = replace(self.prior, shared=np.arange(shared), random=shared + np.arange(random))
        self.inside = np.concatenate([self.prior.shared, self.prior.random]).astype(int)
        self.usual = fit.hyper.log_force
        self.before = evidence(self._gram([]).only(self.inside), self.plain, self.usual)[0]
        free = {v: of for v, of in forces.items() if v not in beside}
        alone = [pair for axis in range(len(AXES)) for pair in self._best(pushed(lin, axis, free))]
        apart = {v: [pair for pair in alone if pair[0].variable == v] for v in NO_FORM}
        apart["nothing"] = [
            pair for pair in apart["nothing"] if pair[0].axis != "surge"
        ]  # where another form of resistance comes near a constant
        joined = [self._together(pairs) for pairs in apart.values()]
        often = fit.plant.seg.dt < 0.5 * THRESHOLDS.value("shortest_period") * fit.plant.froude
        channels = [(name, channel) for name, channel in SENSORS.items() if often and fit.plant.seg.seen[channel]]
        alone += self._best([t for name, channel in channels for t in added(lin, name, channel, errors)])
        self._parts = {d: parts for d, *parts in [*alone, *(pair for pair in joined if pair is not None)]}
        constant = {d.axis: t for d, t in alone if d.variable == "nothing" and d.axis in AXES}
        doubtful = [d for d in self._parts if d.variable in _BY_RUN and not d.of_sensor and d.score > 0.0]
        own = {
            d: self._parts[d] if d.variable == "waves" else [constant[axis] for axis in d.axis.split(" and ")]
            for d in doubtful
        }
        lost = [d for d in doubtful if not is_spent() and self._of_runs(own[d]) > d.score]
        told = {d: replace(d, variable="time") if d.variable == "waves" else d for d in self._parts if d not in lost}
        self._parts = {named: self._parts[d] for d, named in told.items()}
        self.found = sorted(self._parts, key=lambda d: -d.score)

    def settled(self, d: Dependence) -> Dependence:
        """Dependences judged as identified causes are, which are fitted: with the variances of the noise re-estimated,
        and a sensor error subtracted from the record. Before, the noise absorbs a large error, and biases the fit."""
        parts, usual = self._parts[d], self._settled([])
        score = 2.0 * (self._settled(parts) - usual - sum(t.cost for t in parts))
        return replace(d, score=max(score, d.score, *(self._refitted(t) for t in parts if d.of_sensor)))

    def beside_form(self, d: Dependence) -> float:
        """Score of a dependence beside an ordinary form error of the ship."""
        return self._form_error.gain(self._parts[d], self.sides)

    @cached_property
    def _form_error(self) -> FormError:
        return FormError(self.fit)

    def _of_runs(self, tried: Sequence[Tried]) -> float:
        """Twice the log Bayes factor of the forces `tried` with coefficients of its own in each run."""
        num, prior = sum(t.size for t in tried), self.plain
        at = len(self.inside) + np.arange(num)
        prior = replace(prior, random=np.append(prior.random, at), log_tau2=np.append(prior.log_tau2, np.zeros(num)))
        gram = self._gram(tried).only(np.append(self.inside, self.first + np.arange(num)))
        return 2.0 * (evidence(gram, prior, self.usual, num)[0] - self.before)

    def _refitted(self, tried: Tried) -> float:
        """Score of an error without which the plain model is fitted again, where its coefficients keep prior and
        precision. At least so much: of an error of several degrees the linear estimate leaves some."""
        now, at = self.fit, self.first + np.arange(tried.size)
        solution = solve(self._gram([tried]).reduce(self.usual), _with(self.prior, at))
        mean, cov = solution.mean[-tried.size :], solution.cov[-tried.size :, -tried.size :]
        error = (tried.columns @ mean).reshape(now.plant.seg.states[..., :6].shape)
        found = fit(now.plant.less(error), now.scales, now.model, now.point, now.hyper, now.log_tau2, guess=now.motion)
        return float(2.0 * (found.evidence - now.evidence - tried.cost) - mean @ mean + np.linalg.slogdet(cov)[1])

    def _settled(self, tried: Sequence[Tried]) -> float:
        more = [*self.sides, *tried]
        columns = self.wider.columns_with(more)
        products = products_of(self.fit.plant, self.fit.scales, self.fit.point, columns)
        return settled_evidence(
            self.fit, sloped(self.wider.lin, columns, products, self.fit.hyper), sum(t.size for t in more)
        )

    def _best(self, tried: Sequence[Tried]) -> list[tuple[Dependence, Tried]]:
        """Best form of every variable and axis."""
        if not tried or is_spent():
            return []
        gram = self._gram(tried)
        reduced = gram.reduce(self.usual)
        null = solve(reduced, self.prior).log_evidence
        places = np.split(self.first + np.arange(sum(t.size for t in tried)), np.cumsum([t.size for t in tried])[:-1])
        found = []
        for _, group in groupby(zip(tried, places, strict=True), key=lambda pair: (pair[0].axis, pair[0].variable)):
            solution, best, at = max(
                ((solve(reduced, _with(self.prior, at)), t, at) for t, at in group), key=lambda way: way[0].log_evidence
            )
            gain, log_force = solution.log_evidence - null, self.usual
            if gain > best.cost and not is_spent():
                after, log_force = self._evidence(gram, at)
                gain = after - self.before
            size, share, taken = float(np.linalg.norm(solution.mean[-best.size :])), np.nan, 0.0
            if best.axis in AXES:
                before, after = np.exp([self.usual, log_force])[:, AXES.index(best.axis)]
                share, taken = float(1.0 - after / before), float(np.sqrt(max(before - after, 0.0)))
            unit = THRESHOLDS.value("error_prior" if best.axis in SENSORS else "force_prior")
            found.append(
                (
                    Dependence(
                        best.variable, best.axis, best.form, 2.0 * (gain - best.cost), share, unit * size, taken
                    ),
                    best,
                )
            )
        return found

    def _together(self, of: Sequence[tuple[Dependence, Tried]]) -> tuple[Dependence, *tuple[Tried, ...]] | None:
        """Best forms of a variable on all axes where they have evidence, the strongest first; None where that is one
        axis alone."""
        parts = sorted((pair for pair in of if pair[0].score > 0.0), key=lambda pair: -pair[0].score)
        if len(parts) < 2 or is_spent():
            return None
        gram, size = self._gram([t for _, t in parts]), sum(t.size for _, t in parts)
        after, _ = self._evidence(gram, self.first + np.arange(size))
        score = 2.0 * (after - self.before - sum(t.cost for _, t in parts))
        return replace(parts[0][0], axis=" and ".join(t.axis for _, t in parts), score=score), *(t for _, t in parts)

    def _evidence(self, gram: Gram, at: np.ndarray) -> tuple[float, np.ndarray]:
        """Log evidence with the columns `at` as well, and re-estimated variances of the force."""
        prior = _with(self.plain, len(self.inside) + np.arange(len(at)))
        return evidence(gram.only(np.append(self.inside, at)), prior, self.usual)[:2]

    def _gram(self, tried: Sequence[Tried]) -> Gram:
        """Gram of the fit with the columns beside which it is judged, and more."""
        return self.wider.gram([*self.sides, *tried])


def _with(prior: Prior, at: np.ndarray) -> Prior:
    return replace(prior, shared=np.append(prior.shared, at), precision=np.append(prior.precision, np.ones(len(at))))
