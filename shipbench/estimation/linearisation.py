"""Linearisation of the model about a point: parameters, effects, initial states, latent force."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ..effects.base import flow_first
from ..ops import Array
from .between_ships import STRUCTURE
from .coefficients import NUM_BASE, parameters
from .columns import ASIDE, AWAY, Bend, Columns
from .eq2_rollout import parameter_scale
from .forward import Plant
from .gram import Hyper
from .noise import Colour
from .rollout import Active
from .term import Term


@dataclass
class Point:
    """Values, all in units of their scales.

    base (15,): free parameters of eq. (2) and relative changes of the hull, as differences from their prior means.
    terms: effects in the model, with values (amplitudes,) or (runs, amplitudes). eta (B, 6): initial state beside the
    first sample. w (B, knots, 3): latent acceleration.
    """

    base: np.ndarray
    eta: np.ndarray
    w: np.ndarray
    terms: tuple[Term, ...] = ()
    values: tuple[np.ndarray, ...] = field(default=())


class Scales:
    """Units of all free values, for one ship: one unit is a typical size.

    background: variances of the nuisance parameters. With them, all fits that are compared use the same part of the log
    determinant that belongs to initial states. None before the first fit.
    """

    background: Hyper | None = None

    def __init__(self, plant: Plant) -> None:
        froude = plant.froude
        self.p = parameter_scale(plant.c)
        self.eta = np.array([0.5 * froude**2, 0.5 * froude**2, 5e-3, 0.05 * froude, 0.05 * froude, 1e-3 / froude])
        self.w = np.array([5e-3, 5e-3, 1e-4 / froude**2])  # accelerations do not scale; yaw acceleration goes with 1/L
        self.structure = STRUCTURE.spreads(plant.ship, measured_wind=plant.seg.wind is not None)
        self.noise = np.array([0.3 * froude**2, 0.3 * froude**2, 4e-3, 0.04 * froude, 0.04 * froude, 7e-4 / froude])
        self.colour = Colour.white(plant.steps + 1)
        self.centre = plant.seg.centre

    def coloured(self, colour: Colour) -> Scales:
        """Return them with another noise model."""
        new = copy(self)
        new.colour = colour
        return new

    def with_background(self, background: Hyper) -> Scales:
        """Return them with the variances of the nuisance parameters, for fits that are compared."""
        new = copy(self)
        new.background = background
        return new

    def alike(self, other: Scales) -> Scales:
        """Return them with the noise model and the variances of the nuisance parameters of a fit that is compared."""
        new = self.coloured(other.colour)
        new.background = other.background
        return new

    def amplitudes(self, term: Term, L: float) -> np.ndarray:
        """Typical sizes of a term's amplitudes."""
        return np.array([abs(p.typical) for p in term.effect.sized(L) if not p.shape])


def predict(plant: Plant, scales: Scales, point: Point) -> np.ndarray:
    """Predict the sensors' record at `point`, (B, K + 1, 6)."""
    return Linearisation(plant, scales, point).predicted


def actives(plant: Plant, scales: Scales, point: Point) -> list[Active]:
    """Effects of a point with their values, one per segment where they differ between runs."""
    found = []
    for term, value in zip(point.terms, point.values, strict=True):
        amplitude = scales.amplitudes(term, plant.c.L) * value
        q = tuple(
            amplitude[plant.seg.run, i] if term.per_run else _since(plant, term, amplitude[i]) for i in range(term.size)
        )
        found.append(Active(term.effect, (*q, *term.setting)))
    return found


def _since(plant: Plant, term: Term, value: Array) -> Array:
    return value if term.since is None else np.where(plant.seg.run >= term.since, value, 0.0)


_STEP = 1e-4
"""Finite difference in units of the scales."""
_quiet = np.errstate(over="ignore", invalid="ignore")
"""Silence overflow: a trial whose trajectory diverges is judged by its cost, which is not finite."""


class Linearisation:
    """Trajectory and its sensitivities: forward differences of all single steps at once, chained by the steps'
    Jacobians.

    The trajectory may be a guess with gaps between its steps (lifted Newton, multiple shooting). The gaps are chained
    into `predicted`, and close as the iterations converge. Without a guess the model is rolled out.

    `coarse`: vectors in the model are moved by half their typical size. A fine step converges to the optimum, but does
    not leave the place where a vector is zero.
    """

    @_quiet
    def __init__(
        self, plant: Plant, scales: Scales, point: Point, guess: np.ndarray | None = None, coarse: bool = True
    ) -> None:
        self.plant, self.scales, self.point, self.coarse = plant, scales, point, coarse
        self.now = actives(plant, scales, point)
        self.p, self.ship = parameters(scales, point.base)
        self.forces = [a for a in self.now if a.effect.enters == "force"]
        self.path = plant.path_of(self.now)
        w = plant.hat @ (scales.w * point.w)
        x0 = plant.seg.states[:, 0, :6] + scales.eta * point.eta
        self.motion = (
            plant.roll(x0, self.p, [*flow_first(self.forces), *self.ship], w, self.path) if guess is None else guess
        )
        self.push = plant.pushes(w)
        self.states = np.swapaxes(self.motion[:, :-1], 0, 1)[None]
        self.here = self._steps()[0]
        moved = self._steps(states=self.states + _STEP * np.eye(6)[:, None, None, :] * scales.eta) - self.here
        self.jacobian = np.moveaxis(moved, 0, -1) / (_STEP * scales.eta)  # (K, B, 6, 6)
        half = np.eye(6) + self.jacobian
        self.reach = (
            0.5 * plant.seg.dt * half[..., 3:]
        )  # (K, B, 6, 3): end of a step from an acceleration that lasts it
        self.middle = 0.5 * (self.states + self.here)
        self.rates = self._rates()
        self.aside: np.ndarray | None = None
        self.gaps = self.here - np.swapaxes(self.motion[:, 1:], 0, 1)
        self.predicted = plant.measured(self.motion, self.now)
        if guess is not None:
            closed = self._chain(self.gaps[..., None], (x0 - guess[:, 0])[..., None])[..., 0]
            self.predicted = plant.measured(self.motion + closed, self.now)

    def columns(self, candidates: Sequence[Term] = ()) -> Columns:
        """All sensitivities."""
        self._look_aside()
        base, own = self.parameter_columns()
        return Columns(
            self.predicted, self.latent, base, own, tuple(self._of_candidates(candidates)), tuple(self.bends)
        )

    @cached_property
    def pulses(self) -> np.ndarray:
        """Change of each step's end by each knot of the latent acceleration, (K, B, 6, 3 knots)."""
        middle = 0.5 * (self.plant.hat[:-1] + self.plant.hat[1:])
        ends = (self.reach * self.scales.w)[..., None] * middle[:, None, None, None, :]
        return np.asarray(ends.reshape(*self.here.shape, -1))

    @cached_property
    def latent(self) -> np.ndarray:
        """Sensitivities (B, T, 6 + 3 knots) to initial states and latent force."""
        first = np.zeros((self.here.shape[1], 6, 6 + self.pulses.shape[-1]))
        first[..., :6] = np.diag(self.scales.eta)
        return self._chained(np.concatenate([np.zeros((*self.here.shape, 6)), self.pulses], axis=-1), first)

    @_quiet
    def parameter_columns(self, free: Sequence[int] = range(NUM_BASE)) -> tuple[np.ndarray, tuple[np.ndarray, ...]]:
        """Sensitivities of the `free` base parameters and of the terms in the model alone."""
        p, ship = parameters(self.scales, self.point.base + _STEP * np.eye(NUM_BASE)[list(free), None, None, :])
        changed, bent = self._changed(_STEP, p=p, ship=ship)
        self.base_sources, self.bends = self._ends(changed), [Bend(bent)]
        self.own_sources: list[np.ndarray | None] = []
        own = tuple(self._of_term(i, term) for i, term in enumerate(self.point.terms))
        return self._chained(self.base_sources), own

    def pushed(self, axis: int, on: np.ndarray, aside: np.ndarray) -> tuple[np.ndarray, Bend]:
        """Columns (B, T, F) of accelerations (F, K, B) along one axis in the middle of every step, in units of the
        latent force's scales, and their change of the motion's sensitivities. `aside`: the same accelerations beside
        the trajectory. Call it after `columns`."""
        along = self.scales.w * (np.arange(3) == axis)
        return self._chained(self._ends(on[..., None] * along)), Bend((aside - on)[..., None] * along)

    def towards(self, target: Point) -> np.ndarray:
        """Trajectory that the linear model expects at another point, gaps closed: the guess for the next iteration.
        Call it after `columns`."""
        here = self.point
        w = np.moveaxis(target.w - here.w, -1, 1).reshape(len(here.w), -1)
        sources = self.gaps + self.base_sources @ (target.base - here.base) + (self.pulses @ w[..., None])[..., 0]
        run = self.plant.seg.run
        for i, source in enumerate(self.own_sources):
            if source is not None:
                change = target.values[i] - here.values[i]
                change = change[run] if here.terms[i].per_run else np.broadcast_to(change, (len(run), len(change)))
                sources = sources + (source @ change[..., None])[..., 0]
        x0 = self.plant.seg.states[:, 0, :6] + self.scales.eta * target.eta
        return self.motion + self._chain(sources[..., None], (x0 - self.motion[:, 0])[..., None])[..., 0]

    def _steps(
        self, states: np.ndarray | None = None, forces: Sequence[Active] | None = None, path: np.ndarray | None = None
    ) -> np.ndarray:
        """Ends of all single steps (D, K, B, 6) with something changed."""
        active = [*flow_first(self.forces if forces is None else forces), *self.ship]
        return self.plant.steps_from(
            self.states if states is None else states, self.p, active, self.push, self.path if path is None else path
        )

    def _rates(
        self, p: Sequence[Array] | None = None, ship: Sequence[Active] | None = None,
        forces: Sequence[Active] | None = None,
        path: np.ndarray | None = None, often: bool = True, states: np.ndarray | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Accelerations (D, K, B, 3) in the middle of all single steps with something changed."""
        active = [*flow_first(self.forces if forces is None else forces), *(self.ship if ship is None else ship)]
        at, way = self.middle if states is None else states, self.path if path is None else path
        return self.plant.rates_from(at, self.p if p is None else p, active, way, often)

    def _look_aside(self) -> None:
        """Set points beside the middle of every step, in one direction after the other, for second derivatives of the
        forces."""
        K, B = self.middle.shape[1:3]
        self.turn = np.take(ASIDE, np.add.outer(np.arange(K), np.arange(B)) % len(ASIDE))
        self.away = AWAY * self.scales.eta[self.turn]
        self.aside = self.middle + self.away[..., None] * (self.turn[..., None] == np.arange(6))
        self.rates_aside = self._rates(states=self.aside)

    def _changed(self, unit: float, **change: Any) -> tuple[np.ndarray, np.ndarray]:
        """Changes (D, K, B, 3) of the accelerations by a change of something, per unit: on the trajectory, and beside
        it less those on it. The second is empty where the derivatives of the log determinant are not needed."""
        on = self._rates(**change) - self.rates
        aside = on if self.aside is None else self._rates(**change, states=self.aside) - self.rates_aside
        return on / unit, (aside - on) / unit

    def _ends(self, rates: np.ndarray) -> np.ndarray:
        """Changes (K, B, 6, D) of the steps' ends by changes of the acceleration (D, K, B, 3). It takes one evaluation
        of the forces instead of the four of a step."""
        return np.asarray(self.reach @ np.moveaxis(rates, 0, -1))

    def _chain(self, sources: np.ndarray, first: np.ndarray | None = None) -> np.ndarray:
        """Change of the motion (B, K + 1, 6, D) from changes of the steps' ends (K, B, 6, D) and of the initial states
        (B, 6, D)."""
        K, B, _, D = sources.shape
        S, now = np.empty((B, K + 1, 6, D)), np.zeros((B, 6, D)) if first is None else first
        S[:, 0] = now
        with np.errstate(all="ignore"):
            for k in range(K):
                now = self.jacobian[k] @ now
                now += sources[k]
                S[:, k + 1] = now
        return S

    def _chained(self, sources: np.ndarray, first: np.ndarray | None = None) -> np.ndarray:
        """Columns (B, T, D) of the measurement, by the same changes."""
        S = self._chain(sources, first)
        if any(a.effect.enters == "sensor" for a in self.now):
            moved = self.plant.measured(self.motion + _STEP * np.moveaxis(S, -1, 0), self.now)
            S = np.moveaxis((moved - self.plant.measured(self.motion, self.now)) / _STEP, 0, -1)
        return S.reshape(len(S), -1, S.shape[-1])

    def _of_term(self, index: int, term: Term) -> np.ndarray:
        """Columns of a term of the model."""
        if not term.size:  # all its values are given
            self.own_sources.append(None)
            self.bends.append(Bend(None))
            return np.zeros((len(self.motion), 6 * self.motion.shape[1], 0))
        # a vector near zero, where its force has no slope, would else stay there
        step = 0.5 if term.effect.vector and self.coarse else 0.02
        steps = step * self.scales.amplitudes(term, self.plant.c.L)
        columns, sources, bend = self._moved(index, term, steps, step)
        if term.effect.vector and sources is not None and bend.rates is not None:
            back, sources_back, bend_back = self._moved(index, term, -steps, -step)
            columns, sources, bend = (
                0.5 * (columns + back),
                0.5 * (sources + sources_back),
                Bend(0.5 * (bend.rates + bend_back.rates)),
            )
        self.own_sources.append(sources)
        self.bends.append(bend)
        return columns

    @_quiet
    def _of_candidates(self, candidates: Sequence[Term]) -> list[np.ndarray]:
        """Columns (B, T, size) of terms outside the model; those that act as forces share one batch."""
        found: dict[int, np.ndarray] = {}
        self.candidate_sources: list[np.ndarray | None] = []
        for i, term in enumerate(candidates):
            # finite: some effects (wind, deadband) act with the square of their size, or not at all when small
            step = 1.0 if term.effect.vector else 0.5
            unit = step * self.scales.amplitudes(term, self.plant.c.L)
            if term.effect.enters != "force":
                found[i], source, bend = self._moved(None, term, unit, step)
                self.candidate_sources.append(source)
                self.bends.append(bend)
                continue
            own = [np.where(np.arange(term.size) == a, unit[a], 0.0)[:, None, None] for a in range(term.size)]
            q = [_since(self.plant, term, value) for value in own]
            sides = (1.0, -1.0) if term.effect.vector else (1.0,)  # its sign differs between headings
            change, bent = np.mean(
                [self._changed(side * step, forces=self._beside(term, q, side), often=False) for side in sides], axis=0
            )
            self.candidate_sources.append(self._ends(change))
            self.bends.append(Bend(bent))
        forces = [source for i, source in enumerate(self.candidate_sources) if i not in found and source is not None]
        if forces:
            columns = self._chained(np.concatenate(forces, axis=-1))
            at = 0
            for i, term in enumerate(candidates):
                if i not in found:
                    found[i] = columns[..., at : at + term.size]
                    at += term.size
        return [found[i] for i in range(len(candidates))]

    def holding(self, index: int, term: Term) -> Linearisation:
        """Return it with the index-th candidate of `columns` as a term of the model, of size zero."""
        new, runs = copy(self), self.plant.seg.runs
        value = np.zeros((runs, term.size)) if term.per_run else np.zeros(term.size)
        new.point = replace(self.point, terms=(*self.point.terms, term), values=(*self.point.values, value))
        new.own_sources = [*self.own_sources, self.candidate_sources[index]]
        return new

    def _beside(self, term: Term, q: Sequence[np.ndarray], side: float) -> list[Active]:
        """Forces of the model and of one term outside it."""
        return [*self.forces, Active(term.effect, (*(side * v for v in q), *term.setting))]

    @_quiet
    def _moved(
        self, index: int | None, term: Term, steps: np.ndarray, unit: float
    ) -> tuple[np.ndarray, np.ndarray | None, Bend]:
        """Columns (B, T, size) of one term, the index-th of the model or one outside it, and its sources where it acts
        on the motion."""
        columns, sources, bends, sensors = [], [], [], []
        seen = self.plant.measured(self.motion, self.now)
        for a in range(term.size):
            old = (*(0.0 for _ in range(term.size)), *term.setting) if index is None else self.now[index].q
            active = Active(
                term.effect, tuple(v + _since(self.plant, term, steps[a]) if i == a else v for i, v in enumerate(old))
            )
            changed = [*self.now, active] if index is None else [*self.now[:index], active, *self.now[index + 1 :]]
            if term.effect.enters == "sensor":
                moved = self.plant.measured(self.motion, changed) - seen
                columns.append((moved / unit).reshape(len(moved), -1, 1))
                sensors.append(
                    None if term.effect.late else tuple(changed)
                )  # it tells as much of a force, but where a piece was cut
                continue
            if term.effect.enters == "gear":
                path = self.plant.path_of(changed)
                sources.append(((self._steps(path=path)[0] - self.here) / unit)[..., None])
                bends.append(self._changed(unit, path=path)[1])
            else:
                change, bent = self._changed(unit, forces=[x for x in changed if x.effect.enters == "force"])
                sources.append(self._ends(change))
                bends.append(bent)
            columns.append(self._chained(sources[-1]))
        bend = Bend(np.concatenate(bends)) if bends else Bend(None, tuple(sensors), unit)
        return np.concatenate(columns, axis=-1), np.concatenate(sources, axis=-1) if sources else None, bend
