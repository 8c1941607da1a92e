"""Effects in the fitted physics model: parts that a spec adds (`physics+current`), their fitted values, and the place
where each effect enters.

The formulas are those of `shipbench.effects`. Forces act in the rollout, actuator dynamics between command and
actuator. Sensor errors are removed from s0 and added to the prediction again, since both are sensor readings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ..effects.base import EFFECTS, Effect, Parameter, flow_first
from ..errors import InputError, unknown_parameter
from ..integrate import kinematics, rk4_step
from ..ops import Array
from ..physics import eq2
from ..physics.actuators import Gear, gear_path
from ..physics.modifiers import Flow, Modifiers, is_neutral
from ..physics.wind import apparent_wind
from ..ship import Particulars
from ..signals import MOTION, PSI, R, X, Y
from ..specs import EffectSpec


class Active(NamedTuple):
    """An effect and its values."""

    effect: Effect
    q: tuple[Array, ...]


ACTUATOR_OF = ("n", "delta", "F", "F")
_INVERSE_STEPS = 30


@dataclass(frozen=True)
class Term:
    """Effect of a spec; `given` holds the values (of `Effect.parameters`) that the spec sets, None where they are
    fitted."""

    spec: EffectSpec
    effect: Effect
    given: tuple[float | None, ...]

    @property
    def name(self) -> str:
        return self.spec.name


@dataclass(frozen=True)
class Slot:
    """Fitted value: the `at`-th of the `term`-th effect."""

    term: int
    at: int
    parameter: Parameter

    @property
    def scale(self) -> float:
        return abs(self.parameter.typical)


@dataclass
class Extension:
    """Effects of one model, their values and 95 % intervals (one row per value; NaN where it was given, chosen or sits
    at a bound).

    A predictor does not distinguish runs: an effect that differs between runs has one value, the one that fits all
    training runs best. A new run gets the same value.
    """

    terms: tuple[Term, ...]
    values: list[tuple[float, ...]] = field(default_factory=list)
    ci95: np.ndarray = field(default_factory=lambda: np.empty((0, 2)))

    def __post_init__(self) -> None:
        if not self.values:
            self.values = [tuple(0.0 if v is None else v for v in t.given) for t in self.terms]
            self.ci95 = np.full((sum(map(len, self.values)), 2), np.nan)

    def active(self, enters: str) -> list[Active]:
        return [Active(t.effect, q) for t, q in zip(self.terms, self.values, strict=True) if t.effect.enters == enters]

    def slots(self, L: float, *enters: str) -> list[Slot]:
        """Fitted values of the effects that enter there, for a ship of length L [m]."""
        return [
            Slot(i, j, parameter)
            for i, t in enumerate(self.terms)
            for j, parameter in enumerate(t.effect.sized(L))
            if t.effect.enters in enters and t.given[j] is None and not parameter.shape
        ]

    def check(self, L: float) -> None:
        """Check that a ship of length L [m] may have the values that the spec gives.

        Raises:
            InputError: a value lies outside the bounds of its parameter.
        """
        for t in self.terms:
            for parameter, value in zip(t.effect.sized(L), t.given, strict=True):
                if value is not None and not parameter.low <= value <= parameter.high:
                    unit = "" if parameter.unit == "1" else f" {parameter.unit}"
                    accepted = f"{parameter.low:.4g} to {parameter.high:.4g}{unit} on a ship of {L:.4g} m"
                    raise InputError(f"effect '{t.name}': {parameter.name} = {value:.4g}{unit}; accepted: {accepted}.")

    def with_values(self, slots: Sequence[Slot], q: Sequence[float]) -> Extension:
        """The same effects with `q` in the slots."""
        values = [list(v) for v in self.values]
        for slot, value in zip(slots, q, strict=True):
            values[slot.term][slot.at] = float(value)
        return replace(self, values=[tuple(v) for v in values], ci95=self.ci95.copy())

    def set_intervals(self, slots: Sequence[Slot], ci95: np.ndarray) -> None:
        starts = np.cumsum([0, *map(len, self.values)])
        for slot, interval in zip(slots, ci95, strict=True):
            self.ci95[starts[slot.term] + slot.at] = (
                interval if interval[1] > interval[0] else np.nan
            )  # no width: the data say nothing of it

    def held(self) -> dict[int, str]:
        """Indices of p that stay at zero, and the fitted effect with which each is confounded.

        With the hull's derivatives free, p0 and a rudder offset push the stern alike wherever the shaft speed follows
        the ship's speed; p0 stays zero then.
        """
        fitted = [t for t in self.terms if None in t.given]
        held = {p: t.name for t in fitted for p in t.effect.traits.in_place_of}
        if any(t.effect.traits.search == "hull" for t in fitted):
            for t in fitted:
                for p in t.effect.traits.in_place_beside_hull:
                    held.setdefault(p, t.name)
        return held

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[Extension]:
        """Copies of the extension, one per choice of the shape parameters that the spec leaves open, given the
        positions (.., 2) that the ship visited.

        Beside a given one, an effect that is absent by default (the other bank of a channel) stays absent: it was
        placed for another value.
        """
        choices: list[list[tuple[float, ...]]] = []
        for t, now in zip(self.terms, self.values, strict=True):
            shapes = [j for j, p in enumerate(t.effect.parameters) if p.shape]
            absent = [
                j
                for j in shapes
                if t.effect.parameters[j].typical == 0.0 and any(t.given[i] is not None for i in shapes)
            ]
            found: list[tuple[float, ...]] = []
            for setting in t.effect.settings(positions, ship):
                chosen = {j: v for j, v in zip(shapes, setting, strict=True) if t.given[j] is None and j not in absent}
                values = tuple(chosen.get(j, v) for j, v in enumerate(now))
                found += [values] if values not in found else []
            choices.append(found)
        return [replace(self, values=list(values), ci95=self.ci95.copy()) for values in product(*choices)]

    def describe(self) -> list[str]:
        """Lines with the values, units and intervals, for the printed equations."""
        lines, row = ["  effects beside eq. (2) to (8):"], 0
        for t, q in zip(self.terms, self.values, strict=True):
            lines.append(f"  {t.name}: {t.effect.summary}" + (" (one value for all runs)" if t.effect.per_run else ""))
            for parameter, value, given in zip(t.effect.parameters, q, t.given, strict=True):
                low, high = self.ci95[row]
                open_ended = "chosen among settings" if parameter.shape else "at its bound or not determined"
                interval = "given" if given is not None else open_ended if np.isnan(low) else f"[{low:.4g}, {high:.4g}]"
                lines.append(f"    {parameter.name} = {value:.4g} {parameter.unit} {interval}")
                row += 1
            if t.effect.vector is not None:
                units = t.effect.units()
                lines.append("    " + ", ".join(f"{k} = {v:.4g} {units[k]}" for k, v in t.effect.public(q).items()))
        return lines


def extension_of(specs: Sequence[EffectSpec]) -> Extension:
    """Extension that a spec names, before it is fitted.

    Raises:
        InputError: an effect or a parameter is unknown, named twice, no number, or cannot be part of a predictor.
    """
    names = [s.name for s in specs]
    for name in names:
        if names.count(name) > 1 and not EFFECTS.get(name).traits.wraps:
            raise InputError(f"effect '{name}' is named {names.count(name)} times; name it once.")
    return Extension(tuple(_term(s) for s in specs))


def _term(spec: EffectSpec) -> Term:
    effect: Effect = EFFECTS.get(spec.name)
    params = dict(spec.params)
    if effect.traits.wraps:
        inner, begins = params.pop("effect", None), params.pop("time", None)
        if not isinstance(inner, str) or not _is_number(begins):
            raise InputError(
                f"effect '{spec.name}' needs an effect and the time [s] within every run from which it acts; given: "
                f"{spec.params or 'nothing'}. "
                f"Write {spec.name}[effect=rudder_offset,time=60]. A change from one run to another cannot extend a "
                "model: it knows no runs."
            )
        of = _term(EffectSpec(inner, params))
        return Term(spec, effect.of(of.effect, from_time=float(begins)), of.given)  # type: ignore[attr-defined]
    if effect.traits.describes_data:
        raise InputError(
            f"effect '{spec.name}' cannot extend a model: it is mended in the data. Set [units] or [signs] in "
            "dataset.toml."
        )
    return Term(spec, effect, _given(effect, params))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _given(effect: Effect, params: dict[str, Any]) -> tuple[float | None, ...]:
    """Values that the spec sets, in the order of the effect's parameters."""
    known = list(effect.units())
    for key, value in params.items():
        if key not in known:
            raise unknown_parameter(f"effect '{effect.name}'", key, known)
        if not _is_number(value):
            raise InputError(f"effect '{effect.name}': {key} = {value}; accepted: a number [{effect.units()[key]}].")
    if effect.vector is None:
        return tuple(float(params[p.name]) if p.name in params else None for p in effect.parameters)
    if params and len(params) < len(known):
        raise InputError(
            f"effect '{effect.name}': only {', '.join(params)} is given; give both {' and '.join(known)}, or neither."
        )
    return effect.internal(params) if params else (None,) * len(effect.parameters)


def accelerations(
    active: Sequence[Active],
    flow: Flow,
    wind: tuple[Array, Array] | None,
    c: eq2.Coefficients,
    p: Sequence[Array],
    ship: Particulars,
) -> tuple[Array, Array, Array]:
    """Accelerations (du, dv, dr) of eq. (2) with the force effects `active`; `wind` is the measured wind (speed, from)
    or None. Numbers or symbols."""
    e = Modifiers()
    for effect, q in flow_first(active):
        effect.force(e, flow, q, ship)
    air: tuple[Array, Array] | None
    if wind is not None:
        air = apparent_wind(flow.psi, flow.u, flow.v, *wind)
    else:
        air = None if is_neutral(e.air_u, 0.0) and is_neutral(e.air_v, 0.0) else (flow.u, flow.v)
    return eq2.accelerations(flow.u, flow.v, flow.r, flow.n, flow.delta, flow.F_b, flow.F_s, air, c, p, e)


def roll(
    active: Sequence[Active], s0: np.ndarray, path: np.ndarray, wind: np.ndarray | None, h: float, substeps: int,
    c: eq2.Coefficients,
    p: Sequence[float], ship: Particulars,
) -> np.ndarray:  # fmt: skip
    """Motion (batch, K, 6) at t_1..t_K from s0 (batch, 10), which is at t = 0.

    path: actuators (batch, K * substeps, 3, 4) at the stages of every integration step of `h` seconds; wind (batch, K,
    2) or None.
    """
    motion = tuple(s0[:, MOTION].T)
    out = np.empty((len(s0), path.shape[1] // substeps, len(motion)))
    with np.errstate(all="ignore"):  # a diverged run becomes non-finite and is reported as such by the runner
        for j in range(path.shape[1]):
            k = j // substeps

            def rhs(state: tuple[Array, ...], stage: int, j: int = j, k: int = k) -> tuple[Array, ...]:
                x, y, psi, u, v, r = state
                flow = Flow(x, y, (j + 0.5 * stage) * h, psi, u, v, r, *path[:, j, stage].T)
                air = None if wind is None else (wind[:, k, 0], wind[:, k, 1])
                return (*kinematics(psi, u, v, r), *accelerations(active, flow, air, c, p, ship))

            motion = rk4_step(rhs, motion, h)
            out[:, k] = np.stack(motion, axis=-1)
    return out


def measured(S: np.ndarray, sensors: Sequence[Active], dt: float) -> np.ndarray:
    """Sensor readings of the true states S (batch, samples, 10)."""
    for effect, q in sensors:
        S = effect.measure(S, q, dt)
    return S


def true_start(s0: np.ndarray, sensors: Sequence[Active], dt: float) -> np.ndarray:
    """True state (batch, 10) whose sensor readings are s0: a fixed point of `measured`.

    For a delay the ship is taken to have arrived at s0's velocities.
    """
    if not sensors:
        return s0
    x = s0.copy()
    for _ in range(_INVERSE_STEPS):
        ahead = x.copy()
        dx, dy, dpsi = kinematics(x[:, PSI], x[:, 3], x[:, 4], x[:, R])
        ahead[:, X], ahead[:, Y], ahead[:, PSI] = x[:, X] + dt * dx, x[:, Y] + dt * dy, x[:, PSI] + dt * dpsi
        x = x + (s0 - measured(np.stack([x, ahead], axis=1), sensors, dt)[:, 0])
    return x


def no_gear(h: float) -> Gear:
    """Actuator dynamics where only commands are recorded: a lag of a quarter of the integration step `h` [s].

    Without a lag the actuator would jump, and a small change of a delay would have no effect.
    """
    return Gear(0.25 * h, 1e12)


def geared(
    path: np.ndarray,
    s0: np.ndarray,
    U: np.ndarray,
    base: dict[str, Gear],
    active: Sequence[Active],
    dt: float,
    substeps: int,
) -> np.ndarray:
    """Path (batch, K * substeps, 3, 4) with the actuators whose dynamics the effects `active` change, from s0 (batch,
    10)."""
    gears = dict(base)
    for effect, q in active:
        effect.gear(gears, q)
    changed = [i for i, key in enumerate(ACTUATOR_OF) if gears[key] != base[key]]
    if changed:
        path = path.copy()
    for i in changed:
        fine = gear_path(s0[:, 6 + i], U[:, :, i], dt, gears[ACTUATOR_OF[i]], 2 * substeps)
        path[:, :, :, i] = np.stack([fine[:, stage : stage + 2 * path.shape[1] - 1 : 2] for stage in range(3)], axis=-1)
    return path
