"""One point of the model (parameters, effects, initial states, latent force) and its linearisation about that point."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..effects.base import Effect, Parameter
from ..effects.race_gain import EFFECT as RACE
from ..effects.thruster_gain import EFFECT as THRUSTERS
from ..effects.thruster_speed_loss import EFFECT as LOSS
from ..effects.wake_variation import EFFECT as WAKE
from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..predictors._physics_fit import parameter_scale
from ..ship import Particulars
from .plant import HULL, NUM_HULL, Active, Plant

FREE = (1, 2, 5, 7, 8, 10)
"""Of p0..p10 what a symmetric ship has: resistance, lift and drag of the rudder. A side force at zero rudder is an effect with a name."""
_CENTRE = np.array([0.2, 1.0, 1.0, -0.8, 1.0, 1.0])
_SPREAD = np.array([1.0, 1.5, 0.5, 0.8, 1.0, 1.0])
"""Mean and standard deviation of the free parameters before any data, in units of `parameter_scale`."""
HULL_SPREAD = 0.3
"""Standard deviation of the relative error of the regressions (10 to 50 % is what comparisons with tests find; physics reference, section 3.3)."""


class Structure(Effect):
    """What differs between one ordinary ship and another beyond hull and rudder lift: race at the rudder, wake in turns, thrusters at speed.

    Without it every ship's own race or thruster tunnel would be reported as missing physics. Centres and spreads: kappa 0.3 to 0.8 (physics
    reference, R16), C_2 - 1 of the wake 0.1 to 0.6 (Yasukawa & Yoshimura 2015), loss of the thrusters' moment up to 50 % (T41),
    gamma_R 0.4 to 0.64, by side (Yasukawa & Yoshimura 2015, table 3).
    """

    family = "hull"
    summary = "ordinary differences between ships"
    source = "see above"
    parameters = (
        Parameter("race", "1", 0.2, -0.9, 1.0),
        Parameter("wake_variation", "1", 0.25, -1.0, 2.0),
        Parameter("thruster_loss", "1", 0.25, -0.5, 1.2),
        Parameter("thruster_gain", "1", 0.1, -0.5, 0.5),
        Parameter("straightening", "1", 0.3, -0.9, 1.0),
        Parameter("straightening_asymmetry", "1", 0.25, -0.9, 0.9),
    )
    parts = ((RACE, -0.45), (WAKE, 0.35), (LOSS, 0.25), (THRUSTERS, 0.0))

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        for (effect, centre), value in zip(self.parts, q[:4], strict=True):
            effect.force(e, s, (centre + value,), ship)
        e.straightening, e.straightening_asymmetry = 1.0 + q[4], q[5]


STRUCTURE = Structure()
NUM_BASE = len(FREE) + NUM_HULL + len(STRUCTURE.parameters)


@dataclass(frozen=True)
class Term:
    """An effect in the model: shape parameters fixed, amplitudes free; one set of amplitudes, or one per run."""

    effect: Effect
    setting: tuple[float, ...] = ()
    per_run: bool = False

    @property
    def size(self) -> int:
        """Number of free amplitudes."""
        return len(self.effect.parameters) - len(self.setting)

    @property
    def label(self) -> str:
        return self.effect.name


@dataclass
class Point:
    """Values, all in units of their scales.

    base (15,): free parameters of eq. (2) and relative changes of the hull, as differences from their prior means. terms: effects in the model, with
    values (amplitudes,) or (runs, amplitudes). eta (B, 6): initial state beside the first sample. w (B, knots, 3): latent acceleration.
    """

    base: np.ndarray
    eta: np.ndarray
    w: np.ndarray
    terms: tuple[Term, ...] = ()
    values: tuple[np.ndarray, ...] = field(default=())

    def with_term(self, term: Term, value: np.ndarray) -> Point:
        return replace(self, terms=(*self.terms, term), values=(*self.values, value))


class Scales:
    """Units of everything that is free, for one ship: chosen so that one unit is a typical size."""

    def __init__(self, plant: Plant) -> None:
        L = plant.c.L
        froude = (L / 130.0) ** 0.5
        self.p = parameter_scale(plant.c)
        self.eta = np.array([0.5 * froude**2, 0.5 * froude**2, 5e-3, 0.05 * froude, 0.05 * froude, 1e-3 / froude])
        self.w = np.array([5e-3, 5e-3, 1e-4 / froude**2])  # accelerations do not scale; yaw acceleration goes with 1/L
        self.noise = np.array([0.3 * froude**2, 0.3 * froude**2, 4e-3, 0.04 * froude, 0.04 * froude, 7e-4 / froude])

    def amplitudes(self, term: Term, L: float) -> np.ndarray:
        """Typical sizes of a term's amplitudes."""
        return np.array([abs(p.typical) for p in term.effect.sized(L) if not p.shape])


def parameters(scales: Scales, base: np.ndarray) -> tuple[list[np.ndarray | float], list[Active]]:
    """p0..p10, and the changes of the hull and of the structure, from `base` (..., 15); leading axes are kept, so that (D, 1) spreads over segments."""
    p: list[np.ndarray | float] = [0.0] * 11
    for i, index in enumerate(FREE):
        p[index] = (_CENTRE[i] + _SPREAD[i] * base[..., i]) * scales.p[index]
    at = len(FREE) + NUM_HULL
    hull = tuple(HULL_SPREAD * base[..., len(FREE) + i] for i in range(NUM_HULL))
    structure = tuple(item.typical * base[..., at + i] for i, item in enumerate(STRUCTURE.parameters))
    return p, [Active(HULL, hull), Active(STRUCTURE, structure)]


def predict(plant: Plant, scales: Scales, point: Point, extra: Sequence[Active] = ()) -> np.ndarray:
    """What the sensors would have recorded at `point`, (B, K + 1, 6)."""
    p, hull = parameters(scales, point.base)
    active = [*hull, *actives(plant, scales, point), *extra]
    x0 = plant.seg.states[:, 0, :6] + scales.eta * point.eta
    forces = [a for a in active if a.effect.enters == "force"]
    return plant.measured(plant.roll(x0, p, forces, scales.w * point.w, plant.path_of(active)), active)


def actives(plant: Plant, scales: Scales, point: Point) -> list[Active]:
    """The effects of a point with their values, one per segment where they differ between runs."""
    found = []
    for term, value in zip(point.terms, point.values, strict=True):
        amplitude = scales.amplitudes(term, plant.c.L) * value
        q = tuple(amplitude[plant.seg.run, i] if term.per_run else amplitude[i] for i in range(term.size))
        found.append(Active(term.effect, (*q, *term.setting)))
    return found


@dataclass(frozen=True)
class Columns:
    """Sensitivities about a point, T = 6 (K + 1) with the channel last: eta (B, T, 6), w (B, T, 3 knots), base (B, T, NUM_BASE), one (B, T, size) per
    term of the point (`own`) and per candidate; predicted (B, K + 1, 6)."""

    predicted: np.ndarray
    eta: np.ndarray
    w: np.ndarray
    base: np.ndarray
    own: tuple[np.ndarray, ...]
    candidates: tuple[np.ndarray, ...]


_STEP, _OWN_STEP, CANDIDATE_STEP = 1e-3, 0.02, 0.25
"""Steps in units of the scales. A candidate's is finite: some (wind, deadband) act with the square of their size or not at all below one."""


class Linearisation:
    """Forward differences about a point; all force-side directions of one kind share one rollout."""

    def __init__(self, plant: Plant, scales: Scales, point: Point) -> None:
        self.plant, self.scales, self.point = plant, scales, point
        self.now = actives(plant, scales, point)
        self.p, self.hull = parameters(scales, point.base)
        self.forces = [a for a in self.now if a.effect.enters == "force"]
        self.path = plant.path_of(self.now)
        self.x0, self.w = plant.seg.states[:, 0, :6] + scales.eta * point.eta, scales.w * point.w
        self.motion = plant.roll(self.x0, self.p, [*self.hull, *self.forces], self.w, self.path)
        self.predicted = plant.measured(self.motion, self.now)

    def _columns(self, moved: np.ndarray, step: float) -> np.ndarray:
        """Measured (D, B, K + 1, 6) -> (B, T, D)."""
        return np.moveaxis(((moved - self.predicted) / step).reshape(len(moved), len(self.x0), -1), 0, -1)

    def _moved(self, x0: np.ndarray, p: Sequence, hull: Sequence[Active], w: np.ndarray) -> np.ndarray:
        return self.plant.measured(self.plant.roll(x0, p, [*hull, *self.forces], w, self.path), self.now)

    def columns(self, candidates: Sequence[Term] = ()) -> Columns:
        """All sensitivities."""
        knots, scales = self.plant.knots, self.scales
        eta = self._moved(self.x0 + _STEP * np.eye(6)[:, None, :] * scales.eta, self.p, self.hull, self.w)
        pulses = np.zeros((3 * knots, 1, knots, 3))
        for j in range(3):
            pulses[j * knots + np.arange(knots), 0, np.arange(knots), j] = _STEP * scales.w[j]
        latent = self._moved(self.x0, self.p, self.hull, self.w + pulses)
        p, hull = parameters(scales, self.point.base + _STEP * np.eye(NUM_BASE)[:, None, :])
        base = self._moved(self.x0, p, hull, self.w)
        own = [self._of_term(i, term) for i, term in enumerate(self.point.terms)]
        return Columns(self.predicted, self._columns(eta, _STEP), self._columns(latent, _STEP), self._columns(base, _STEP), tuple(own),
                       tuple(self.of_candidates(candidates)))  # fmt: skip

    def _of_term(self, index: int, term: Term) -> np.ndarray:
        """Columns of a term that is in the model."""
        unit = self.scales.amplitudes(term, self.plant.c.L)
        steps = _OWN_STEP * unit
        found = []
        for a in range(term.size):
            q = list(self.now[index].q)
            q[a] = q[a] + steps[a]
            found.append(self._measured_with([*self.now[:index], Active(term.effect, tuple(q)), *self.now[index + 1 :]], term.effect.enters))
        return self._columns(np.stack(found), _OWN_STEP)

    def of_candidates(self, candidates: Sequence[Term]) -> list[np.ndarray]:
        """Columns (B, T, size) of terms that are not in the model."""
        found: dict[int, np.ndarray] = {}
        batch: list[tuple[int, int, float]] = []
        for i, term in enumerate(candidates):
            unit = CANDIDATE_STEP * self.scales.amplitudes(term, self.plant.c.L)
            if term.effect.enters == "force":
                batch += [(i, a, unit[a]) for a in range(term.size)]
                continue
            moved = []
            for a in range(term.size):
                q = (*(unit[a] if k == a else 0.0 for k in range(term.size)), *term.setting)
                moved.append(self._measured_with([*self.now, Active(term.effect, q)], term.effect.enters))
            found[i] = self._columns(np.stack(moved), CANDIDATE_STEP)
        if batch:
            acts = [*self.hull, *self.forces]
            for i in sorted({i for i, _, _ in batch}):
                term = candidates[i]
                q = [np.array([[unit if (j, k) == (i, a) else 0.0] for j, k, unit in batch]) for a in range(term.size)]
                acts.append(Active(term.effect, (*q, *term.setting)))
            columns = self._columns(self.plant.measured(self.plant.roll(self.x0, self.p, acts, self.w, self.path), self.now), CANDIDATE_STEP)
            for i in {i for i, _, _ in batch}:
                found[i] = columns[..., [k for k, item in enumerate(batch) if item[0] == i]]
        return [found[i] for i in range(len(candidates))]

    def _measured_with(self, active: Sequence[Active], enters: str) -> np.ndarray:
        """The measurement under other effects; the motion is rolled out again only where they touch it."""
        if enters == "sensor":
            return self.plant.measured(self.motion, active)
        forces = [a for a in active if a.effect.enters == "force"]
        path = self.plant.path_of(active)
        return self.plant.measured(self.plant.roll(self.x0, self.p, [*self.hull, *forces], self.w, path), active)
