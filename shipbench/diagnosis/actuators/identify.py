"""Identification of effects between command and actuator where both are recorded: every actuator alone, without the
ship's motion."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from ...estimation.budget import is_spent
from ...estimation.forward import Plant, Segments, ordinary_gears
from ...ops import where
from ...physics.actuators import Gear, gear_path, gear_step
from ..thresholds import THRESHOLDS
from .kinds import ORDINARY, GearFinding, Kind, kinds_of, least_rate
from .record_error import CHANNELS, FORMS, RecordError, readings

if TYPE_CHECKING:
    from ...compiled import Lanes

_SCAN, _STEP, _PARTS = (4, 12, 24), 0.02, 4
"""Points of the grid per parameter; step of finite differences; parts of a sample in which a second stage runs."""


def find_in_gears(plant: Plant) -> tuple[list[GearFinding], dict[str, Gear], list[RecordError]]:
    """Findings on every actuator that moves, best first, its best default dynamics, and the errors of the records;
    empty where only commands are recorded (then the default dynamics of the motion's fit)."""
    if plant.seg.commanded:
        return [], plant.ordinary, []
    seg, gears = plant.long, ordinary_gears(plant.c.L)
    found: list[GearFinding] = []
    errors: list[RecordError] = []
    for name, channels in CHANNELS.items():
        if is_spent():
            break
        rows = range(len(seg.run))
        picked = [(b, c) for c in channels for b in rows if np.ptp(seg.commands[b, seg.mask[b], c]) > 0]
        if len({seg.run[b] for b, _ in picked}) > 1:
            record = _Record.of(seg, plant.c.L, name, np.array(picked))
            findings, gears[name], error = record.findings(ordinary_gears(plant.c.L)[name])
            found += findings
            errors += [] if error is None else [error]
    return sorted(found, key=lambda f: -f.score), gears, errors


@dataclass(frozen=True)
class _Record:
    """Commands (P, K) and positions (P, K + 1) of one actuator over P segments; judged (P, K): real samples, after the
    longest delay searched: earlier commands are unknown."""

    name: str
    scale: float
    dt: float
    command: np.ndarray
    measured: np.ndarray
    judged: np.ndarray
    run: np.ndarray
    runs: int

    @classmethod
    def of(cls, seg: Segments, L: float, name: str, picked: np.ndarray) -> _Record:
        scale, (b, c) = (L / 130.0) ** 0.5, picked.T
        longest = min(THRESHOLDS.value("longest_delay") * scale, 0.25 * seg.states.shape[1] * seg.dt)
        late = np.arange(seg.states.shape[1] - 1) * seg.dt >= longest
        return cls(
            name,
            scale,
            seg.dt,
            seg.commands[b, :-1, c],
            seg.states[b, :, 6 + c],
            seg.mask[b, 1:] & late,
            seg.run[b],
            seg.runs,
        )

    def paths(self, z: np.ndarray, kind: Kind | None) -> np.ndarray:
        """Positions (M, P, K) for M sets of dynamics; z (M, values): logarithms of time constant, rate[, the value of
        `kind`]."""
        code = _follower(kind and kind.field)
        if code is not None:
            return np.swapaxes(self._followed(code, z, kind, self.command.shape[1])[..., 1], 1, 2)
        tiled = np.repeat(np.exp(z), len(self.command), axis=0).T
        gear = Gear(tiled[0], tiled[1])
        if kind is not None:
            gear = replace(gear, **{kind.field: tiled[kind.at]})
        parts = _PARTS if kind is not None and kind.field == "T2" else 1
        path = gear_path(np.tile(self.measured[:, 0], len(z)), np.tile(self.command, (len(z), 1)), self.dt, gear, parts)
        return path[:, parts::parts].reshape(len(z), *self.command.shape)

    def errors(self, z: np.ndarray, kind: Kind | None) -> np.ndarray:
        """Residuals (M, P, K), record less path, zero where it is not judged."""
        return np.where(self.judged, self.measured[:, 1:] - self.paths(z, kind), 0.0)

    def costs(self, z: np.ndarray, kind: Kind | None) -> np.ndarray:
        """Sums of the squared errors (M,)."""
        code = _follower(kind and kind.field)
        if code is not None:
            return self._followed(code, z, kind, 1)[:, 0, :, 2].sum(axis=1)
        parts = np.array_split(z, len(z) // 200 + 1)  # keeps the arrays small
        return np.concatenate([np.sum(self.errors(part, kind) ** 2, axis=(1, 2)) for part in parts])

    def _followed(self, code: Lanes, z: np.ndarray, kind: Kind | None, kept: int) -> np.ndarray:
        """Motor, position and cumulative sum of squared errors, (M, kept, P, 3): at every sample or, if 1 is kept, at
        the end."""
        (P, K), values = self.command.shape, np.exp(z)
        whole = np.zeros(len(z), dtype=int)
        if kind is not None and kind.field == "delay":
            shift = values[:, kind.at] / self.dt
            whole = np.floor(shift).astype(int)
            values[:, kind.at] = shift - whole
        most, out = int(whole.max()) + 1, np.empty((len(z), kept, P, 3))
        held = np.concatenate([np.repeat(self.command[:, :1], most, axis=1), self.command], axis=1)
        start = np.stack([self.measured[:, 0], self.measured[:, 0], np.zeros(P)], axis=-1)[:, None]
        for late in np.unique(whole):
            rows, first = np.flatnonzero(whole == late), most - late
            record = np.stack(
                [held[:, first : first + K], held[:, first - 1 : first - 1 + K], self.measured[:, 1:], self.judged],
                axis=-1,
            )
            found = np.empty((len(rows), kept, P, 3))
            bundles = [
                start,
                values[rows, None, None, None],
                np.array([self.dt]),
                np.swapaxes(record, 0, 1)[:, :, None],
            ]
            code(bundles, (len(rows), K, P, 1), found, carried=True)
            out[rows] = found
        return out

    def findings(self, usual: Gear) -> tuple[list[GearFinding], Gear, RecordError | None]:
        """Findings of every effect beside the best default dynamics, these dynamics, and the error of the record.

        An actuator whose record reads too little seems to stop short of its commands, as with a deadband: where an
        error of the record explains more than every effect, the effects are judged without it.
        """
        found, ordinary, error = self._judged(usual)
        if error is None:
            return found, ordinary, None
        found, ordinary, _ = replace(self, measured=error.taken_out(self.measured))._judged(usual)
        return found, ordinary, error if error.size > THRESHOLDS.value("reported_share") else None

    def _judged(self, usual: Gear) -> tuple[list[GearFinding], Gear, RecordError | None]:
        """Findings of the record as it is, with an error that explains more than every effect.

        Two stages look like a delay, end stops like an error: they are fitted only where a residual is to be explained,
        since that takes as long as all the others.
        """
        kinds = kinds_of(self.name, self.scale, float(np.percentile(np.abs(self.command), 98)), usual)
        asked = THRESHOLDS.value("evidence")
        ordinary, fits = self._fitted(None), [self._fitted(kind) for kind in kinds]
        gear, plain = Gear(*(float(v) for v in np.exp(ordinary))), self.errors(ordinary[None], None)[0]
        found = [self._finding(kind, z, ordinary, plain) for kind, z in zip(kinds, fits, strict=True)]
        stops, _ = self._ended(ordinary, None, float(np.sum(plain**2)))
        if max(stops, self._misread(ordinary, None, plain).score, *(f.score for f in found)) < asked:
            return found, gear, None
        second = self._second
        z = self._fitted(second, [ordinary, *fits])
        plain = min(plain, self.errors(z[None], second)[0], key=lambda e: float(np.sum(e**2)))
        found = [self._finding(kind, fit, ordinary, plain) for kind, fit in zip(kinds, fits, strict=True)]
        error = self._misread(z, second, plain)
        least, before = max(asked, *(f.score for f in found)), float(np.sum(plain**2))
        # record and actuator are corrected in turn where that may make the error the best explanation
        for _ in range(3 if error.score > THRESHOLDS.value("minor_share") * least else 0):
            z = replace(self, measured=error.taken_out(self.measured))._fitted(second, [ordinary, *fits])
            error = self._misread(z, second, plain)
        worth, record = max(
            (self._ended(fit, kind, before) for fit, kind in zip((ordinary, *fits), (None, *kinds), strict=True)),
            key=lambda x: x[0],
        )
        if worth > max(least, error.score):
            return record._judged(usual)
        return found, gear, error if error.score > least else None

    def _ended(self, z: np.ndarray, kind: Kind | None, before: float) -> tuple[float, _Record]:
        """Score of end stops where the record shows them (and of `kind`), and its record."""
        from scipy.optimize import minimize_scalar

        def ended(limit: float) -> _Record:
            return replace(self, command=np.clip(self.command, -limit, limit))

        most, record = float(np.max(np.abs(self.command))), self
        for _ in range(2):
            best = minimize_scalar(
                lambda limit, z=z: ended(limit).costs(z[None], kind)[0], bounds=(0.2 * most, most), method="bounded"
            )
            record = ended(float(best.x))
            if self._worth(float(self.costs(z[None], kind)[0]), record.errors(z[None], kind)[0], 1) < 0.0:
                return -np.inf, self
            z = record._fitted(kind)
        return self._worth(before, record.errors(z[None], kind)[0], 1 + (kind is not None)), record

    def _misread(self, z: np.ndarray, kind: Kind | None, plain: np.ndarray) -> RecordError:
        """Error of the record beside the positions of the dynamics; score: against the errors `plain`."""
        at = self.paths(z[None], kind)[0]
        off, forms = np.where(self.judged, self.measured[:, 1:] - at, 0.0), np.where(self.judged, readings(at), 0.0)
        factors = np.linalg.lstsq(forms.reshape(len(forms), -1).T, off.ravel(), rcond=None)[0]
        score = self._worth(float(np.sum(plain**2)), off - np.tensordot(factors, forms, 1), len(factors))
        told = (factors[:, None] * forms[:, self.judged])[1:]
        best = FORMS[1 + int(np.argmax(np.linalg.norm(told, axis=1)))].format(self.name)
        size = np.sqrt(np.mean(told.sum(axis=0) ** 2) / max(np.mean(self.measured[:, 1:][self.judged] ** 2), 1e-300))
        return RecordError(self.name, best, score, float(size), factors)

    def _worth(self, before: float, rest: np.ndarray, values: int) -> float:
        """Score of `values` more parameters with residuals `rest` (P, K) of errors whose squares were `before`
        together."""
        samples, after = float(self.judged.sum()), max(float(np.sum(rest**2)), 1e-300)
        return float(
            samples * _discount(rest) * np.log(max(before, 1e-300) / after)
            - values * np.log(10.0 * len(np.unique(self.run)))
        )

    def _fitted(self, kind: Kind | None, near: Sequence[np.ndarray] = ()) -> np.ndarray:
        """Logarithms of the time constant, the rate[, the value of `kind`] of the best dynamics; near: starting values
        of the first two."""
        span = float(np.percentile(np.abs(self.command), 98))
        rate = max(least_rate(self.name, self.scale), 0.01 * span / self.scale)
        most = max(10.0 * span / self.dt, 2.0 * rate)
        low, high = np.log([0.02 * self.scale, rate]), np.log([ORDINARY[self.name].T * self.scale, most])
        if kind is not None:
            low, high = np.resize(low, max(2, kind.at + 1)), np.resize(high, max(2, kind.at + 1))
            low[kind.at], high[kind.at] = np.log(kind.low), np.log(kind.high)
        return self._least(kind, low, high, near)

    def _finding(self, kind: Kind, z: np.ndarray, ordinary: np.ndarray, plain: np.ndarray) -> GearFinding:
        rest = self.errors(z[None], kind)[0]
        variance = max(float(np.sum(rest**2)) / float(self.judged.sum()), 1e-300)
        discount, per_run = _discount(rest), np.zeros(self.runs)
        np.add.at(per_run, self.run, discount * np.sum(plain**2 - rest**2, axis=1) / (2.0 * variance))
        score = self._worth(float(np.sum(plain**2)), rest, 1)
        steps = _STEP * np.eye(len(z))
        slopes = ((self.errors(z + steps, kind) - self.errors(z - steps, kind)) / (2.0 * _STEP)).reshape(len(z), -1)
        relative = np.linalg.inv(discount / variance * slopes @ slopes.T + np.eye(len(z)))[kind.at, kind.at] ** 0.5
        size = float(np.exp(z[kind.at]))
        clock = THRESHOLDS.value("record_uncertainty") * self.dt if kind.field in ("T", "delay") else 0.0
        relative = np.hypot(relative, THRESHOLDS.value("record_uncertainty"))
        own = THRESHOLDS.value("ordinary_spread") * kind.beyond
        spread = 1.96 * float(np.sqrt((size * relative) ** 2 + own**2 + clock**2))
        value = size - kind.beyond
        gear = replace(Gear(*(float(v) for v in np.exp(z[:2]))), **{kind.field: size})
        least = self._detectable(kind, ordinary, plain) - (float(np.exp(ordinary[0])) if kind.field == "T" else 0.0)
        return GearFinding(kind.effect, score, value, (value - spread, value + spread), per_run, self.name, gear, least)

    @property
    def _second(self) -> Kind:
        """Default second stage."""
        longest = THRESHOLDS.value("second_stage") * ORDINARY[self.name].T * self.scale
        return Kind("", "T2", 0.02 * self.scale, longest)

    def _detectable(self, kind: Kind, ordinary: np.ndarray, plain: np.ndarray) -> float:
        """Detection limit of `kind` for dynamics that are otherwise the `ordinary` ones, with errors `plain`: its time
        constant, rate and a second stage are nuisance parameters. NaN beyond the bounds."""
        least, most = (kind.high, kind.low) if kind.field == "rate" else (kind.low, kind.high)
        begins = ordinary if kind.at == 2 else kind.like(ordinary, least)
        free = _STEP * np.eye(2)[[at for at in (0, 1) if at != kind.at]]
        at_first, squares = self.errors(begins[None], None).ravel(), max(float(np.sum(plain**2)), 1e-300)
        stages = self.errors(
            np.stack([self._second.like(begins, part * self._second.low) for part in (1.0, 5.0)]), self._second
        )
        slopes = np.concatenate(
            [self.errors(begins + free, None) - self.errors(begins - free, None), np.diff(stages, axis=0)]
        )
        slopes = slopes.reshape(len(slopes), -1).T

        def is_seen(size: float) -> bool:
            off = self.errors(kind.like(ordinary, size)[None], kind).ravel() - at_first
            off -= slopes @ np.linalg.lstsq(slopes, off, rcond=None)[0]
            return self._worth(squares + float(off @ off), plain, 1) > THRESHOLDS.value("evidence")

        if not is_seen(most):
            return np.nan
        for _ in range(8):
            middle = float(np.sqrt(least * most))
            least, most = (least, middle) if is_seen(middle) else (middle, most)
        return most

    def _least(self, kind: Kind | None, low: np.ndarray, high: np.ndarray, near: Sequence[np.ndarray]) -> np.ndarray:
        """Minimum of the squared error inside a box: a grid, then a pattern of neighbours of its best point.

        The pattern shrinks when no neighbour is much better. Otherwise it would follow a valley where the time constant
        hardly changes the cost. Deadband and play leave the cost without a usable slope. The valley is narrow in the
        rate and in the value of `kind`: these are scanned closely.
        """
        grid = [np.linspace(a, b, n) for a, b, n in zip(low, high, _SCAN, strict=False)]
        points = np.clip([(*z[:2], *rest) for z in near for rest in product(*grid[2:])] or [*product(*grid)], low, high)
        half = (high - low) / np.array(_SCAN[: len(low)])
        pattern = np.array(list(product((-1.0, 0.0, 1.0), repeat=len(low))))
        best, center = np.inf, points[0]
        for _ in range(150):
            costs = self.costs(points, kind)
            least, before = float(costs.min()), best
            if least < best:
                best, center = least, points[int(costs.argmin())]
            if least > (1.0 - 3e-5) * before:
                half = 0.5 * half
                if np.all(half < 1e-3):
                    break
            points = np.unique(np.clip(center + half * pattern, low, high), axis=0)
        return center


def _discount(rest: np.ndarray) -> float:
    """Weight of a sample of errors (P, K) that are correlated from one to the next."""
    rho = min(max(float(np.sum(rest[:, 1:] * rest[:, :-1]) / np.sum(rest**2)), 0.0), 0.98) if np.any(rest) else 0.0
    return (1.0 - rho) / (1.0 + rho)


@cache
def _follower(field: str | None) -> Lanes | None:
    """Machine code of a sample of `gear_step`. Outputs: motor, position, cost. Inputs: time constant, rate[, value of
    `field`, of a delay the part of a sample]; dt; command, the one before it, record, whether it is judged. None where
    there is no compiler."""
    import casadi as ca

    from ...compiled import Lanes

    beside = field if field not in ("T", "rate") else None
    sizes = {"state": 3, "values": 2 + (beside is not None), "dt": 1, "record": 4}
    whole = [ca.SX.sym(name, num) for name, num in sizes.items()]
    (motor, position, cost), (T, rate, *value), (dt,), (now, before, measured, judged) = (
        ca.vertsplit(v) for v in whole
    )
    gear, wanted = Gear(T, rate), [(now, dt)]
    if beside == "delay":
        wanted = [(before, value[0] * dt), (now, (1.0 - value[0]) * dt)]
    elif beside is not None:
        wanted = [(now, dt / _PARTS)] * _PARTS if beside == "T2" else wanted
        gear = replace(gear, **{beside: value[0]})
    motor, position = gear_step(motor, position, wanted, gear)
    after = ca.vertcat(motor, position, cost + where(judged, (measured - position) ** 2, 0.0))
    return Lanes.of(ca.Function("follower", whole, [after], {"cse": True}))
