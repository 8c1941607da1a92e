"""Steps of eq. (2) with effects over many lanes at once: the formula, and machine code of it for each set of effects.

Lanes are (D, K, B): changed directions, samples, segments. The code takes the ship's numbers and the effects' values as
inputs: one compilation serves all ships and all fits with the same effects. Without a compiler numpy evaluates the
formula.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..effects.base import Effect
from ..integrate import kinematics, rk4_step
from ..ops import Array
from ..physics import eq2
from ..physics.modifiers import Flow, Modifiers
from ..physics.wind import apparent_wind
from ..ship import Particulars
from .eq2_rollout import numbers_of, with_numbers

if TYPE_CHECKING:
    import casadi

    from ..compiled import Lanes

_built: dict[tuple[Any, ...], Lanes | None] = {}
_VALUES = 1
"""Bundle of the values of p and effects, of which sensitivities change one after the other."""


@dataclass(frozen=True)
class Active:
    """Effect in the model and its values: arrays that broadcast over (directions, segments)."""

    effect: Effect
    q: tuple[Array, ...]

    @property
    def own(self) -> tuple[float, ...]:
        """Numbers of the effect itself, which differ between the forms in which it is fitted (`Effect.fitted`)."""
        numbers = numbers_of(tuple(vars(self.effect).values()))
        return tuple(numbers) if all(isinstance(number, float) for number in numbers) else ()

    def with_own(self, numbers: Iterator[Array]) -> Effect:
        """The effect with other numbers in their place."""
        effect, attributes = copy(self.effect), vars(self.effect)
        vars(effect).update(zip(attributes, with_numbers(tuple(attributes.values()), numbers), strict=True))
        return effect


@dataclass(frozen=True)
class Vessel:
    """Ship as its particulars, for the effects, and as the coefficients of eq. (2)."""

    ship: Particulars
    c: eq2.Coefficients


@dataclass(frozen=True)
class Course:
    """Times and steps of the lanes: t (K, B, S, 3) [s] since the run began and wind (K, B, 2) or None, S integration
    steps of h [s] a sample; the stages of a step are its beginning, middle and end."""

    vessel: Vessel
    h: float
    t: np.ndarray
    wind: np.ndarray | None

    @property
    def midway(self) -> tuple[slice, slice, int, int]:
        """Index of the middle of every sample in arrays given at the stages of every integration step."""
        S = self.t.shape[2]
        return slice(None), slice(None), S // 2, S % 2

    def rolled(
        self, x0: np.ndarray, p: Sequence[Array], active: Sequence[Active], act: np.ndarray, push: np.ndarray
    ) -> np.ndarray:
        """Motion (B, K + 1, 6) from x0 (B, 6), with p0..p10, effects, actuators act (K, B, S, 3, 4) and accelerations
        push (K, B, S, 3, 3)."""
        K, B, S = self.t.shape[:3]
        out = np.empty((B, K + 1, 6))
        out[:, 0] = x0
        code = self._code(active, steps=True)
        if code is not None:
            code(
                self._bundles(x0[:, None], p, active, act, self.t, push),
                (1, K, B, S),
                np.swapaxes(out[:, 1:], 0, 1)[None],
                carried=True,
            )
            return out
        x = tuple(x0.T)
        with np.errstate(all="ignore"):
            for k in range(K):
                x = self._sample(x, p, active, act[k], push[k], self.t[k], None if self.wind is None else self.wind[k])
                out[:, k + 1] = np.stack(x, axis=-1)
        return out

    def ends(
        self, states: np.ndarray, p: Sequence[Array], active: Sequence[Active], act: np.ndarray, push: np.ndarray
    ) -> np.ndarray:
        """States one sample ahead of every state at once, (D, K, B, 6), from states (D or 1, K, B, 6)."""
        code = self._code(active, steps=True)
        if code is None:
            with np.errstate(all="ignore"):
                return _stacked(
                    self._sample(tuple(np.moveaxis(states, -1, 0)), p, active, act, push, self.t, self.wind)
                )
        return self._evaluated(code, 6, self._bundles(states[..., None, :], p, active, act, self.t, push))

    def rates(
        self, middle: np.ndarray, p: Sequence[Array], active: Sequence[Active], act: np.ndarray, often: bool = True
    ) -> np.ndarray:
        """Accelerations (D, K, B, 3) by forces in the middle of every sample, from the states there (1, K, B, 6).

        often: whether these effects are evaluated so often that compiled code pays.
        """
        at, code = self.midway, self._code(active, steps=False) if often else None
        if code is not None:
            return self._evaluated(
                code,
                3,
                self._bundles(middle[..., None, :], p, active, act[at][:, :, None], self.t[at][:, :, None, None]),
            )
        wind = None if self.wind is None else np.moveaxis(self.wind, -1, 0)
        with np.errstate(all="ignore"):
            return _stacked(
                accelerations(
                    tuple(np.moveaxis(middle, -1, 0)),
                    np.moveaxis(act[at], -1, 0),
                    self.t[at],
                    wind,
                    p,
                    active,
                    self.vessel,
                )
            )

    def _sample(
        self, x: tuple[Array, ...], p: Sequence[Array], active: Sequence[Active], act: np.ndarray, push: np.ndarray,
        t: np.ndarray,
        wind: np.ndarray | None,
    ) -> tuple[Array, ...]:  # fmt: skip
        """State one sample after x; act (.., S, 3, 4), push (.., S, 3, 3), t (.., S, 3)."""
        air = None if wind is None else np.moveaxis(wind, -1, 0)
        for s in range(t.shape[-2]):
            stages = [
                (np.moveaxis(act[..., s, i, :], -1, 0), np.moveaxis(push[..., s, i, :], -1, 0), t[..., s, i])
                for i in range(3)
            ]
            x = step(x, stages, air, p, active, self.vessel, self.h)
        return x

    def _bundles(
        self,
        x: np.ndarray,
        p: Sequence[Array],
        active: Sequence[Active],
        act: np.ndarray,
        t: np.ndarray,
        *push: np.ndarray,
    ) -> list[Any]:
        """Arguments of the machine code, each broadcast over (D, K, B, S, its numbers)."""
        values = np.stack(np.broadcast_arrays(*p, *(v for a in active for v in a.q)), axis=-1)[..., None, :]
        stages = [a.reshape(*self.t.shape[:2], a.shape[2], -1) for a in (act, t, *push)]
        return [
            x,
            values,
            np.array([self.h, *_numbers(active, self.vessel)]),
            *stages,
            *([] if self.wind is None else [self.wind[:, :, None]]),
        ]

    def _evaluated(self, code: Lanes, num: int, bundles: Sequence[np.ndarray]) -> np.ndarray:
        """Values (D, K, B, num) of the machine code; D is that of the states or of the values."""
        D = max(a.shape[0] for a in bundles[:2] if a.ndim == 5)
        out = np.moveaxis(
            np.empty((*self.t.shape[:2], num, D)), -1, 0
        )  # as matrices over the directions, which sensitivities are
        code(bundles, (*out.shape[:3], bundles[3].shape[2]), out)
        return out

    def _code(self, active: Sequence[Active], steps: bool) -> Lanes | None:
        """Machine code of the step, or of the accelerations; None where there is none."""
        kind = (self.wind is not None, steps)
        key = (tuple((type(a.effect) if a.own else a.effect, len(a.q), len(a.own)) for a in active), *kind)
        if key not in _built:
            if len(_built) >= 256:  # bounds the memory
                _built.clear()
            _built[key] = _compiled(active, self.vessel, *kind, any_ship=True)
        if _built[key] is not None:
            return _built[key]
        own = (
            *key,
            self.h,
            *_numbers(active, self.vessel),
        )  # a formula that asks for the ship's proportions is traced for every ship
        if own not in _built:
            _built[own] = _compiled(active, self.vessel, *kind, any_ship=False)
        return _built[own]


@dataclass(frozen=True)
class Slopes:
    """Machine code of the accelerations by forces and of their derivatives with respect to psi, u, v, r, for gradients
    through a rollout.

    Args:
        code: of both, over lanes.
        numbers: of the ship and of the effects themselves.
    """

    code: Lanes
    numbers: np.ndarray

    @classmethod
    def of(cls, active: Sequence[Active], vessel: Vessel, wind: bool) -> Slopes | None:
        """Code for these effects, with or without measured wind; None where there is none: use the formula itself."""
        numbers = np.array([0.0, *_numbers(active, vessel)])
        key = ("slopes", wind, *((a.effect, len(a.q)) for a in active), *numbers)
        if key not in _built:
            _built[key] = _sloped(active, vessel, wind)
        code = _built[key]
        return None if code is None else cls(code, numbers)

    def __call__(
        self, state: np.ndarray, values: np.ndarray, act: np.ndarray, wind: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Accelerations (D, B, 3), and their derivatives (D, B, 3, 4).

        Args:
            state: psi, u, v, r (D, B, 4).
            values: p0..p10 and those of the effects (D, num).
            act: n, delta, F_b, F_s (D, B, 4).
            wind: speed and direction (D, B, 2), or None.
        """
        D, B = state.shape[:2]
        x = np.concatenate([np.zeros((D, B, 2)), state], axis=-1)
        lanes = [a[:, None, :, None] for a in (x, act, *(() if wind is None else (wind,)))]
        out = np.empty((D, 1, B, 15))
        time = np.zeros(1)
        self.code([lanes[0], values[:, None, None, None], self.numbers, lanes[1], time, *lanes[2:]], (D, 1, B, 1), out)
        return out[:, 0, :, :3], out[:, 0, :, 3:].reshape(D, B, 3, 4)


def accelerations(
    state: Sequence[Array],
    act: Array,
    t: Array,
    wind: Array | None,
    p: Sequence[Array],
    active: Sequence[Active],
    vessel: Vessel,
) -> tuple[Array, ...]:
    """Accelerations (du, dv, dr) [m/s^2, m/s^2, rad/s^2] by forces at one instant.

    act: n, delta, F_b, F_s; wind: speed and direction, or None.
    """
    px, py, psi, u, v, r = state
    n, delta, F_b, F_s = act
    air = (u, v) if wind is None else apparent_wind(psi, u, v, wind[0], wind[1])
    e = None
    if active:
        e = Modifiers()
        flow = Flow(px, py, t, psi, u, v, r, n, delta, F_b, F_s)
        for a in active:
            a.effect.force(e, flow, a.q, vessel.ship)
    return eq2.accelerations(u, v, r, n, delta, F_b, F_s, air, vessel.c, p, e)


def step(
    x: tuple[Array, ...], stages: Sequence[tuple[Array, Array, Array]], wind: Array | None, p: Sequence[Array],
    active: Sequence[Active],
    vessel: Vessel, h: Array,
) -> tuple[Array, ...]:  # fmt: skip
    """State after one integration step of h [s]; stages: actuators, pushes (accelerations to add) and time at its
    beginning, middle and end."""

    def rhs(state: tuple[Array, ...], stage: int) -> tuple[Array, ...]:
        act, push, t = stages[stage]
        forces = accelerations(state, act, t, wind, p, active, vessel)
        _, _, psi, u, v, r = state
        return (*kinematics(psi, u, v, r), *(a + b for a, b in zip(forces, push, strict=True)))

    return rk4_step(rhs, x, h)


def _stacked(values: Sequence[Array]) -> np.ndarray:
    return np.stack(np.broadcast_arrays(*values), axis=-1)


def _fields(vessel: Vessel) -> tuple[Any, ...]:
    """Coefficients and the numeric fields of the particulars."""
    return (vessel.c, *(getattr(vessel.ship, name) for name in _names(vessel)))


def _numbers(active: Sequence[Active], vessel: Vessel) -> list[float]:
    """Inputs of the code besides the step: numbers of the ship and of the effects themselves."""
    return [*numbers_of(_fields(vessel)), *(number for a in active for number in a.own)]


def _names(vessel: Vessel) -> list[str]:
    return [name for name in type(vessel.ship).model_fields if name != "notes"]


def _compiled(active: Sequence[Active], vessel: Vessel, wind: bool, steps: bool, any_ship: bool) -> Lanes | None:
    """Compile the step or the accelerations; None where there is no compiler, or an effect that takes no symbols."""
    from ..compiled import Lanes

    try:
        return Lanes.of(_traced(active, vessel, wind, steps, any_ship), None if steps else _VALUES)
    except (RuntimeError, TypeError, ValueError):
        return None


def _sloped(active: Sequence[Active], vessel: Vessel, wind: bool) -> Lanes | None:
    """Compile the accelerations with their derivatives; None as of `_compiled`."""
    import casadi as ca

    from ..compiled import Lanes

    try:
        rates = _traced(active, vessel, wind, steps=False, any_ship=False)
    except (RuntimeError, TypeError, ValueError):
        return None
    given = rates.sx_in()
    found = rates(*given)
    both = ca.vertcat(found, ca.vec(ca.jacobian(found, given[0])[:, 2:].T))
    return Lanes.of(ca.Function("slopes", given, [ca.densify(both)], {"cse": True}))  # zeros have their place


def _traced(active: Sequence[Active], vessel: Vessel, wind: bool, steps: bool, any_ship: bool) -> casadi.Function:
    """Symbolic step, or accelerations. Inputs: state, values of p and effects, h and `_numbers`, actuators, times[,
    pushes][, wind].

    Raises:
        RuntimeError, TypeError, ValueError: an effect takes no symbols.
    """
    import casadi as ca

    stages, numbers = 3 if steps else 1, _numbers(active, vessel)
    sizes = {
        "x": 6,
        "values": eq2.NUM_PARAMETERS + sum(len(a.q) for a in active),
        "numbers": 1 + len(numbers),
        "act": 4 * stages,
        "t": stages,
    }
    sizes |= ({"push": 9} if steps else {}) | ({"wind": 2} if wind else {})
    whole = {name: ca.SX.sym(name, num) for name, num in sizes.items()}
    x, values, (h, *symbols), act, t, *_ = (ca.vertsplit(v) for v in whole.values())
    air = ca.vertsplit(whole["wind"]) if wind else None
    known, rest = iter(symbols if any_ship else numbers), iter(values)
    c, *fields = with_numbers(_fields(vessel), known)
    named = Vessel(vessel.ship.model_copy(update=dict(zip(_names(vessel), fields, strict=True))), c)
    p = [next(rest) for _ in range(eq2.NUM_PARAMETERS)]
    effects = [Active(a.with_own(known) if a.own else a.effect, tuple(next(rest) for _ in a.q)) for a in active]
    if steps:
        push = ca.vertsplit(whole["push"])
        ends = step(
            tuple(x),
            [(act[4 * i : 4 * i + 4], push[3 * i : 3 * i + 3], t[i]) for i in range(3)],
            air,
            p,
            effects,
            named,
            h,
        )
    else:
        ends = accelerations(x, act, t[0], air, p, effects, named)
    if any(ca.SX(value).numel() != 1 for value in ends):
        raise ValueError("an effect whose values belong to certain lanes")
    return ca.Function("steps", list(whole.values()), [ca.vertcat(*ends)], {"cse": True})
