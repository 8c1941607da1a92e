"""Forward model of the diagnosis: batches of segments, rolled out with a latent force, for many changed directions at
once."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from ..effects.base import EFFECTS
from ..ops import Array
from ..physics import eq2
from ..physics.actuators import Gear, gear_path
from ..records import Dataset
from ..ship import Particulars, complete
from ..signals import ACTUATORS, MOTION, STATES
from .actuator_fit import DEFAULT_ACTUATORS
from .beside import PUSHES, centre_of
from .resampling import averaged
from .rollout import Active, Course, Vessel
from .thresholds import THRESHOLDS

NO_GEAR = Gear(1e-3, 1e12)
SEGMENT = THRESHOLDS.value("segment_length")
MOST_STEPS = THRESHOLDS.count("most_steps")
FOLD_STEPS = MOST_STEPS // 4
THOROUGH_STEPS = 2 * MOST_STEPS
"""Integration steps of all segments together, per stage."""
DEEP = THRESHOLDS.value("deep_water")
FEW_PIECES = THRESHOLDS.count("segments_for_noise")


def ordinary_gears(L: float) -> dict[str, Gear]:
    """Default dynamics of shaft [rpm], steering gear [rad] and thrusters [N] of a ship of length L [m].

    They serve where no actuator is recorded: time constants and rates of `actuator_fit.DEFAULT_ACTUATORS`,
    Froude-scaled.
    """
    T_n, rate_n, T_delta, rate_delta, T_F, _ = (float(v) for v in DEFAULT_ACTUATORS)
    scale = (L / 130.0) ** 0.5
    return {
        "n": Gear(T_n * scale, rate_n / scale**2),
        "delta": Gear(T_delta * scale, rate_delta / scale),
        "F": Gear(T_F * scale, 1e12),
    }


@dataclass(frozen=True)
class Segments:
    """Segments of runs, of at most `steps` transitions, padded to equal length.

    Shapes: states (B, K + 1, 10); commands (B, K + 1, 4); wind (B, K + 1, 2) or None; mask (B, K + 1) of real samples;
    run (B,), index of the run; start (B,), time since the run began [s].

    earlier (B, P, 4): commands before the segment (the first one, before the run); empty where actuators are recorded.
    kinds: manoeuvre by run, "" where not given. seen (6,): which motion channels were measured. depth (B,): mean
    recorded depth [m]; None where none is recorded, in deep water, or where it is less than the draught. working: names
    of the actuators that work in any run. known (B, K + 1, 3), centre: of `BesideSimulation`.
    """

    dt: float
    commanded: bool
    states: np.ndarray
    commands: np.ndarray
    earlier: np.ndarray
    wind: np.ndarray | None
    mask: np.ndarray
    run: np.ndarray
    start: np.ndarray
    runs: int
    kinds: tuple[str, ...]
    seen: np.ndarray = field(default_factory=lambda: np.ones(6, dtype=bool))
    depth: np.ndarray | None = None
    working: frozenset[str] = frozenset(STATES[ACTUATORS])
    known: np.ndarray | None = None
    centre: np.ndarray | None = None

    def thinned(self, most: int) -> Segments:
        """Segments evenly spread, at most `most`; every run keeps at least one."""
        if len(self.run) <= most:
            return self
        first = np.flatnonzero(np.diff(self.run, prepend=-1))
        spread = np.linspace(0, len(self.run) - 1, max(most - len(first), 1)).round().astype(int)
        return self._of(np.unique(np.concatenate([first, spread])))

    def where(self, wanted: np.ndarray) -> Segments:
        """The `wanted` segments, with the runs that have any."""
        found = self._of(np.flatnonzero(wanted))
        runs, run = np.unique(found.run, return_inverse=True)
        return replace(found, run=run, runs=len(runs), kinds=tuple(self.kinds[i] for i in runs))

    def _of(self, rows: np.ndarray) -> Segments:
        wind, depth, known = (None if v is None else v[rows] for v in (self.wind, self.depth, self.known))
        return replace(
            self, states=self.states[rows], commands=self.commands[rows], earlier=self.earlier[rows], wind=wind,
            mask=self.mask[rows],
            run=self.run[rows], start=self.start[rows], depth=depth, known=known,
        )  # fmt: skip

    def without(self, pieces: np.ndarray) -> Segments:
        """Return them with all samples of some segments masked."""
        mask = self.mask.copy()
        mask[pieces] = False
        return replace(self, mask=mask)

    def turned(self, actuators: Sequence[int]) -> Segments:
        """Return them with the sign of some actuators (of n, delta, F_b, F_s) reversed."""
        sign = np.where(np.isin(np.arange(4), actuators), -1.0, 1.0)
        states = np.concatenate([self.states[..., :6], self.states[..., 6:] * sign], axis=-1)
        return replace(self, states=states, commands=self.commands * sign, earlier=self.earlier * sign)


def cut(dataset: Dataset, steps: int, still: Collection[str] = ()) -> Segments:
    """Cut every run into equal segments of at most `steps` transitions; neighbours share the sample between them."""
    pieces = []
    for index, run in enumerate(dataset.runs):
        num = max(1, int(np.ceil((len(run) - 1) / steps)))
        edges = np.linspace(0, len(run) - 1, num + 1).round().astype(int)
        pieces += [(index, run, a, b) for a, b in pairwise(edges)]
    K = max(b - a for _, _, a, b in pieces)
    wind_columns, pushed = (
        [dataset.inputs.index(n) for n in names] if set(names) <= set(dataset.inputs) else None
        for names in (("wind_speed", "wind_from"), PUSHES)
    )
    at = [np.minimum(np.arange(a, a + K + 1), b) for _, _, a, b in pieces]
    states = np.stack([run.states[i] for (_, run, _, _), i in zip(pieces, at, strict=True)])
    inputs = np.stack([run.inputs[i] for (_, run, _, _), i in zip(pieces, at, strict=True)])
    ship, commanded = complete(dataset.ship), dataset.actuators == "commanded"
    scale = (ship.L / 130.0) ** 0.5
    depth = (
        inputs[..., dataset.inputs.index("depth")].mean(axis=1)
        if ship.T < least_depth(dataset) < DEEP * ship.T
        else None
    )
    back = np.arange(-round(SEGMENT * scale / dataset.dt) if commanded else 0, 0)
    return Segments(
        dt=dataset.dt, commanded=commanded, states=states, commands=inputs[..., :4],
        earlier=np.stack([run.inputs[np.maximum(a + back, 0), :4] for _, run, a, _ in pieces]),
        wind=None if wind_columns is None else inputs[..., wind_columns],
        mask=np.stack([np.arange(K + 1) <= b - a for _, _, a, b in pieces]),
        run=np.array([p[0] for p in pieces]), start=np.array([p[2] * dataset.dt for p in pieces]), runs=len(dataset),
        kinds=tuple(run.kind for run in dataset.runs),
        seen=~np.isin(STATES[MOTION], dataset.derived), depth=depth, working=working(dataset) - set(still),
        known=None if pushed is None else inputs[..., pushed], centre=centre_of(dataset),
    )  # fmt: skip


def working(dataset: Dataset) -> frozenset[str]:
    """Names of actuators that are not zero throughout."""
    ever = np.any([np.any(run.states[:, ACTUATORS], axis=0) for run in dataset.runs], axis=0)
    return frozenset(np.array(STATES[ACTUATORS])[ever].tolist())


def least_depth(dataset: Dataset) -> float:
    """Least recorded depth [m]; infinite where none is recorded."""
    if "depth" not in dataset.inputs:
        return np.inf
    return float(min(np.min(run.inputs[:, dataset.inputs.index("depth")]) for run in dataset.runs))


def _substeps(dt: float, L: float) -> int:
    return max(1, int(np.ceil(dt / (0.15 * L**0.5) - 1e-9)))


def known_effects(inputs: Mapping[str, np.ndarray], ship: Particulars) -> list[Active]:
    """Effects whose values follow from the measured `inputs`."""
    return [
        Active(e, e.known(inputs, ship))
        for e in map(EFFECTS.get, EFFECTS.names())
        if e.known_with and set(e.known_with) <= set(inputs)
    ]


class Plant:
    """Forward model: rollouts of eq. (2) over all segments.

    The recorded actuators (interpolated) drive the motion, so that actuator dynamics cannot be mistaken for a force.
    Where only commands are recorded, the held commands drive it.
    """

    def __init__(
        self, dataset_ship: Particulars, segments: Segments, long: Segments | None = None,
        gears: dict[str, Gear] | None = None,
        froude: float | None = None, recorded: bool = False,
    ) -> None:  # fmt: skip
        self.recorded = recorded
        """Whether the outputs of `gears` are recorded actuators, though commands drive them here."""
        self.ship, self.seg, self.long = dataset_ship, segments, segments if long is None else long
        self.c = eq2.coefficients(dataset_ship)
        self.froude = (self.c.L / 130.0) ** 0.5 if froude is None else froude
        """Factor of times and speeds relative to those of a ship of 130 m."""
        self.substeps = _substeps(segments.dt, self.c.L)
        self.steps = segments.states.shape[1] - 1
        self.knot_time = 5.0 * self.froude
        self.knots = int(np.ceil(self.steps * segments.dt / self.knot_time)) + 1
        at = np.minimum(np.arange(self.steps + 1) * segments.dt / self.knot_time, self.knots - 1 - 1e-9)
        self.hat = np.maximum(1.0 - np.abs(at[:, None] - np.arange(self.knots)), 0.0)
        """Interpolation matrix (K + 1, knots) of the latent acceleration from its knots to the samples, piecewise
        linear."""
        self.parts = (np.arange(self.substeps)[:, None] + 0.5 * np.arange(3)) / self.substeps
        """Times (substeps, 3) of the integration stages within a sample, as shares of the sample time."""
        k = np.arange(self.steps)[:, None, None]
        t = segments.start[:, None, None] + np.minimum(k + self.parts, k + 1.0 - 1e-9)[:, None] * segments.dt
        wind = None if segments.wind is None else np.swapaxes(segments.wind[:, :-1], 0, 1)
        self.course = Course(Vessel(dataset_ship, self.c), segments.dt / self.substeps, t, wind)
        self.water = known_effects({} if segments.depth is None else {"depth": segments.depth}, dataset_ship)
        """Effects whose values follow from a measured input."""
        self.inputs = frozenset(("wind_speed", "wind_from") * (wind is not None) + ("depth",) * bool(self.water))
        """Measured inputs that the model takes into account."""
        self.ordinary: dict[str, Gear] = {}
        self.drive(
            (ordinary_gears(self.c.L) if segments.commanded else dict.fromkeys(("n", "delta", "F"), NO_GEAR))
            | (gears or {})
        )

    def drive(self, gears: dict[str, Gear]) -> None:
        """Use these actuator dynamics as the default between commands and actuators."""
        self.ordinary = gears
        self.path = np.stack([self._stages(i, gears[k]) for i, k in enumerate(("n", "delta", "F", "F"))], axis=-1)

    def driven(self, gears: dict[str, Gear]) -> Plant:
        """Return the same runs with some other default actuator dynamics."""
        plant = copy(self)
        plant.drive(self.ordinary | gears)
        return plant

    def without(self, pieces: np.ndarray) -> Plant:
        """Return the same runs with all samples of some segments masked."""
        plant = copy(self)
        plant.seg = self.seg.without(pieces)
        return plant

    def less(self, error: np.ndarray) -> Plant:
        """Return the same runs with an error (B, K + 1, 6) subtracted from the recorded motion."""
        plant, states = copy(self), self.seg.states.copy()
        states[..., :6] -= error
        plant.seg = replace(self.seg, states=states)
        return plant

    def thinned(self, most: int) -> Plant:
        """Forward model of `Segments.thinned`."""
        if len(self.seg.run) <= most:
            return self
        return Plant(self.ship, self.seg.thinned(most), self.long, self.ordinary, recorded=self.recorded)

    def where(self, wanted: np.ndarray) -> Plant:
        """The `wanted` segments, with the runs that have any."""
        return Plant(self.ship, self.seg.where(wanted), self.long, self.ordinary, self.froude)

    def resized(self, factor: float) -> Plant:
        """Return the same runs of a geometrically similar ship, with the same units, so that evidence compares."""
        return Plant(self.ship.resized(factor), self.seg, self.long, froude=self.froude)

    def turned(self, actuators: Sequence[int]) -> Plant:
        """Return the same runs with the sign of some actuators (of n, delta, F_b, F_s) reversed."""
        return Plant(self.ship, self.seg.turned(actuators), self.long.turned(actuators), self.ordinary, self.froude)

    def with_actuators(self, actuators: np.ndarray) -> Plant:
        """Return the same runs with other records (B, K + 1, 4) of the actuators."""
        seg = replace(self.seg, states=np.concatenate([self.seg.states[..., MOTION], actuators], axis=-1))
        return Plant(self.ship, seg, self.long, self.ordinary, self.froude)

    @classmethod
    def of(cls, dataset: Dataset, most_steps: int = MOST_STEPS, still: Collection[str] = ()) -> Plant:
        """Forward model of a data set, cut into segments of about 60 s at 130 m (Froude-scaled).

        Over longer segments the motion is far from linear in its parameters, and the initial state of the next segment
        adds little. Fast records are averaged; long ones are thinned to `most_steps` integration steps. `long` holds
        longer segments with every sample, for the actuator dynamics, which have no such limit. still: actuators whose
        record does not follow the ship.
        """
        ship, motion, longer = complete(dataset.ship), averaged(dataset), THRESHOLDS.count("long_segment")
        length = SEGMENT * (ship.L / 130.0) ** 0.5
        segments = cut(motion, max(20, round(length / motion.dt)), still)
        long = cut(dataset, longer * max(20, round(length / dataset.dt)), still)
        steps = (segments.states.shape[1] - 1) * _substeps(segments.dt, ship.L)
        most = max(len(dataset), most_steps // steps)
        return cls(ship, segments.thinned(most), long.thinned(max(len(dataset), most // longer)))

    def path_of(self, active: Sequence[Active]) -> np.ndarray:
        """Actuators at the three stages of every integration step, (B, steps * substeps, 3, 4): n, delta, F_b, F_s.

        Recorded actuators are interpolated and pass through the added actuator dynamics. Where only commands are
        recorded, these pass through the default actuator dynamics as well.
        """
        gears = dict(self.ordinary)
        for a in active:
            if a.effect.enters == "gear":
                a.effect.gear(gears, a.q)
        if self.recorded:  # what the motion shows is behind the record, and so behind the motor that these are
            gears = {k: replace(g, T=self.ordinary[k].T, T2=g.T2 + g.T - self.ordinary[k].T) for k, g in gears.items()}
        if gears == self.ordinary:
            return self.path
        path = self.path.copy()
        for i, name in enumerate(("n", "delta", "F", "F")):
            if gears[name] != self.ordinary[name]:
                path[..., i] = self._stages(i, gears[name])
        return path

    def _stages(self, i: int, gear: Gear) -> np.ndarray:
        """Output of one actuator's dynamics, (B, steps * substeps, 3). A negative delay means that the record is late.

        Recorded actuators are read at the time to which a delay points: dynamics without lag move from stage to stage,
        and would give a delay no gradient.
        """
        seg, n, before = self.seg, 2 * self.substeps, self.seg.earlier.shape[1]
        fine = np.arange(-before * n, self.steps * n + 1) / n
        if seg.commanded:
            # between stages linear: else a record that is late by less than the next stage would have no slope to find
            # it by
            whole, part = divmod(-min(gear.delay, 0.0) / seg.dt * n, 1.0)
            orders = np.concatenate([seg.earlier[..., i], seg.commands[..., i]], axis=1)
            at = [np.clip(np.floor(fine + (whole + k) / n + 1e-9).astype(int), -before, self.steps - 1) for k in (0, 1)]
            values = orders[:, before + at[0]] * (1.0 - part) + orders[:, before + at[1]] * part
            follow = replace(gear, delay=max(gear.delay, 0.0))
        else:
            at = np.clip(fine - gear.delay / seg.dt, 0, self.steps)
            low = np.minimum(at.astype(int), self.steps - 1)
            values = seg.states[:, low, 6 + i] * (1.0 - (at - low)) + seg.states[:, low + 1, 6 + i] * (at - low)
            follow = replace(gear, delay=0.0)
        if follow != NO_GEAR:
            # recorded actuators: the value at the end of the step is what the gear follows; commands are held from its
            # beginning
            wanted = values[:, :-1] if seg.commanded else values[:, 1:]
            begins = values[:, 0] if before or not seg.commanded else seg.states[:, 0, 6 + i]
            if np.any(wanted != begins[:, None]):  # thrusters are often at rest
                values = gear_path(begins, wanted, seg.dt / n, follow)
        values = values[:, before * n :]
        return np.stack([values[:, stage : stage + n * self.steps - 1 : 2] for stage in range(3)], axis=-1)

    def roll(
        self,
        x0: np.ndarray,
        p: Sequence[Array],
        active: Sequence[Active],
        w: np.ndarray,
        path: np.ndarray | None = None,
    ) -> np.ndarray:
        """Motion (B, K + 1, 6) from x0 (B, 6), with p0..p10, effects, and a latent acceleration w (B, K + 1, 3)."""
        return self.course.rolled(x0, p, [*active, *self.water], self._by_sample(path), self.pushes(w))

    def steps_from(
        self,
        states: np.ndarray,
        p: Sequence[Array],
        active: Sequence[Active],
        push: np.ndarray,
        path: np.ndarray | None = None,
    ) -> np.ndarray:
        """States one sample ahead of every state at once: (D, K, B, 6) from states (D or 1, K, B, 6) and `pushes`.

        Along a known trajectory this replaces the loop over time: the sensitivities of the single steps are chained
        afterwards.
        """
        return self.course.ends(states, p, [*active, *self.water], self._by_sample(path), push)

    def rates_from(
        self,
        middle: np.ndarray,
        p: Sequence[Array],
        active: Sequence[Active],
        path: np.ndarray | None = None,
        often: bool = True,
    ) -> np.ndarray:
        """Accelerations (D, K, B, 3) by forces in the middle of every step, from the states there (1, K, B, 6); `often`
        as in `Course.rates`."""
        return self.course.rates(middle, p, [*active, *self.water], self._by_sample(path), often)

    def midway(self, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Actuators (K, B, 4) and times since the runs began (K, B) in the middle of every sample."""
        at = self.course.midway
        return self._by_sample(path)[at], self.course.t[at]

    def pushes(self, w: np.ndarray) -> np.ndarray:
        """The latent acceleration w (B, K + 1, 3) and the known one at the stages, (K, B, substeps, 3, 3)."""
        part = self.parts[..., None]
        ends = np.swapaxes(w, 0, 1)[:, :, None, None]
        latent = (1.0 - part) * ends[:-1] + part * ends[1:]
        known = self.seg.known
        return latent if known is None else latent + np.swapaxes(known[:, :-1], 0, 1)[:, :, None, None]

    def _by_sample(self, path: np.ndarray | None) -> np.ndarray:
        """Path by sample (K, B, substeps, 3, 4) from a path (B, steps * substeps, 3, 4)."""
        path = self.path if path is None else path
        return np.moveaxis(path.reshape(len(path), self.steps, self.substeps, 3, 4), 1, 0)

    def measured(self, motion: np.ndarray, active: Sequence[Active]) -> np.ndarray:
        """Predict the sensors' record of `motion` (..., B, K + 1, 6)."""
        sensors = [a for a in active if a.effect.enters == "sensor"]
        if not sensors:
            return motion
        flat = np.zeros((*motion.shape[:-1], 10)).reshape(-1, motion.shape[-2], 10)
        flat[..., MOTION] = motion.reshape(-1, *motion.shape[-2:])
        for a in sensors:
            q = tuple(np.broadcast_to(v, motion.shape[:-2]).reshape(-1) for v in a.q)
            flat = a.effect.measure(flat, q, self.seg.dt)
        return flat[..., MOTION].reshape(motion.shape)
