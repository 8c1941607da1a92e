"""Effects on actuator dynamics, fitted where command and actuator are both recorded: every actuator alone, without the
ship's motion."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from ..ops import Array
from ..physics.actuators import Gear, gear_path
from ..records import Batch
from ..ship import Particulars
from .actuator_fit import DEFAULT_ACTUATORS
from .extension import Extension, Slot
from .intervals import intervals

CHANNELS = {"n": (0,), "delta": (1,), "F": (2, 3)}
_POINTS, _ROUNDS, _SHRINK, _MOST_RUNS = 6, 9, 0.6, 24
_NO_LIMIT = 1e3


def gears_of(actuators: np.ndarray) -> dict[str, Gear]:
    """Dynamics of shaft, rudder and thrusters from the six values of `DEFAULT_ACTUATORS`."""
    T_n, rate_n, T_delta, rate_delta, T_F, rate_F = (float(v) for v in actuators)
    return {"n": Gear(T_n, rate_n), "delta": Gear(T_delta, rate_delta), "F": Gear(T_F, rate_F)}


def fit_gears(
    batch: Batch, dt: float, substeps: int, extension: Extension, actuators: np.ndarray, ship: Particulars
) -> tuple[np.ndarray, Extension]:
    """Fit the values of the actuator effects, with time constant and rate limit of the actuators that they change.

    The data identify T + lag, and the smaller of two rate limits. Beside a fitted lag the time constant is held at the
    default (`DEFAULT_ACTUATORS`, Froude-scaled; or the one found without the effect, where that is smaller). Beside a
    fitted rate limit there is no other.

    Args:
        actuators: (6,) as `fit_actuators` found them without the effects.

    Returns:
        The six values and the extension with values and intervals. An actuator that never moves keeps its values, with
        its effects at zero (or their bound).
    """
    actuators = actuators.copy()
    for g, (name, channels) in enumerate(CHANNELS.items()):
        slots = [s for s in extension.slots(ship.L, "gear") if _changes(extension, s.term, name)]
        given = any(_changes(extension, i, name) for i, t in enumerate(extension.terms) if t.effect.enters == "gear")
        if given or slots:
            problem = _Actuator(batch, dt, substeps, extension, slots, name, channels)
            if problem.moves:
                pair = slice(2 * g, 2 * g + 2)
                actuators[pair], extension = problem.fit(
                    actuators[pair], DEFAULT_ACTUATORS[2 * g] * (ship.L / 130.0) ** 0.5
                )
            else:
                extension = extension.with_values(slots, [max(s.parameter.low, 0.0) for s in slots])
    return actuators, extension


def _changed(extension: Extension, term: int) -> tuple[str, str]:
    """Actuator and field of `Gear` that an effect changes."""
    t = extension.terms[term]
    before = {name: Gear(1e3, 1e3) for name in CHANNELS}
    after = dict(before)
    t.effect.gear(after, tuple(p.typical for p in t.effect.parameters))
    name = next(n for n in CHANNELS if after[n] != before[n])
    return name, next(
        f for f in ("T", "rate", "delay", "deadband", "backlash") if getattr(after[name], f) != getattr(before[name], f)
    )


def _changes(extension: Extension, term: int, name: str) -> bool:
    return extension.terms[term].effect.enters == "gear" and _changed(extension, term)[0] == name


class _Actuator:
    """Records of one actuator, and its dynamics as a function of z = (log T, log rate, values of the effects)."""

    def __init__(
        self,
        batch: Batch,
        dt: float,
        substeps: int,
        extension: Extension,
        slots: Sequence[Slot],
        name: str,
        channels: tuple[int, ...],
    ) -> None:
        self.dt, self.num, self.extension, self.slots, self.name = dt, 2 * substeps, extension, slots, name
        self.start = np.concatenate([batch.s0[:, 6 + c] for c in channels])
        self.command = np.concatenate([batch.U[:, :, c] for c in channels])
        self.truth = np.concatenate([batch.truth[:, :, 6 + c] for c in channels])
        self.runs, self.channels = len(batch.s0), len(channels)
        self.scale = float(np.std(self.truth))
        self.moves = self.scale >= 1e-9 * (1.0 + float(np.max(np.abs(self.command))))

    def gear(self, z: np.ndarray) -> Gear:
        """Dynamics for z (values,) or (values, rows)."""
        gears = {name: Gear(np.exp(z[0]), np.exp(z[1])) for name in CHANNELS}
        at = {(s.term, s.at): z[2 + i] for i, s in enumerate(self.slots)}
        for i, (t, q) in enumerate(zip(self.extension.terms, self.extension.values, strict=True)):
            if _changes(self.extension, i, self.name):
                values: tuple[Array, ...] = tuple(at.get((i, j), v) for j, v in enumerate(q))
                t.effect.gear(gears, values)
        return gears[self.name]

    def residual(self, z: np.ndarray) -> np.ndarray:
        path = gear_path(self.start, self.command, self.dt, self.gear(z), self.num)[:, self.num :: self.num]
        return (path - self.truth) / self.scale

    def fit(self, before: np.ndarray, ordinary_T: float) -> tuple[np.ndarray, Extension]:
        """Fit (T, rate) and the extension, from the pair `before` that serves without the effects."""
        from scipy.optimize import least_squares

        T = [0.02 * self.dt, 100.0 * self.dt]
        rate = [1e-3 * self.scale / self.dt, _NO_LIMIT * self.scale / self.dt]
        fields = [_changed(self.extension, s.term)[1] for s in self.slots]
        if "T" in fields:
            T = [min(ordinary_T, before[0])] * 2
        if "rate" in fields:
            rate = [rate[1]] * 2
        low = np.array([*np.log([T[0], rate[0]]), *(s.parameter.low for s in self.slots)])
        high = np.array([*np.log([T[1], rate[1]]), *(s.parameter.high for s in self.slots)])
        free = high > low
        z = self._zoom(low, high)

        def whole(part: np.ndarray) -> np.ndarray:
            out = z.copy()
            out[free] = part
            return out

        if free.any():
            inside = np.clip(z[free], low[free] + 1e-9 * (high - low)[free], high[free] - 1e-9 * (high - low)[free])
            found = least_squares(
                lambda part: self.residual(whole(part)).ravel(),
                inside,
                bounds=(low[free], high[free]),
                x_scale=(high - low)[free],
                max_nfev=30,
            )
            if 2.0 * found.cost < np.sum(self.residual(z) ** 2):
                z = whole(found.x)
        extension = self.extension.with_values(self.slots, [float(v) for v in z[2:]])
        step = 1e-3 * (high - low)
        J = np.stack(
            [(self.residual(z + d) - self.residual(z - d)) / (2.0 * max(d.sum(), 1e-300)) for d in np.diag(step)],
            axis=-1,
        )
        shape = (self.channels, self.runs, -1)
        e, J = np.moveaxis(self.residual(z).reshape(shape), 0, -1), np.moveaxis(J.reshape(*shape, len(z)), 0, 2)
        extension.set_intervals(self.slots, intervals(z, e, J, low, high)[2:])
        return np.exp(z[:2]), extension

    def _zoom(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Best point of a grid that shrinks about it round by round: deadband and play leave the cost without a usable
        slope."""
        rows = np.unique(np.linspace(0, len(self.start) - 1, min(_MOST_RUNS, len(self.start))).round().astype(int))
        center, half, best = 0.5 * (low + high), 0.5 * (high - low), np.inf
        for _ in range(_ROUNDS):
            axes = [
                np.unique(np.clip(np.linspace(c - h, c + h, _POINTS), a, b))
                for c, h, a, b in zip(center, half, low, high, strict=True)
            ]
            points = np.array(list(product(*axes)))
            tiled = np.repeat(points.T, len(rows), axis=1)
            start, command = np.tile(self.start[rows], len(points)), np.tile(self.command[rows], (len(points), 1))
            path = gear_path(start, command, self.dt, self.gear(tiled))[:, 1:].reshape(len(points), len(rows), -1)
            costs = np.sum((path - self.truth[rows]) ** 2, axis=(1, 2))
            if costs.min() < best:
                best, center = float(costs.min()), points[int(costs.argmin())]
            half = _SHRINK * half
        return center
