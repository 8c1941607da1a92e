"""Rollouts of eq. (2) to (8) without effects, and their derivatives with respect to p0..p10: the formula as machine
code for any number of runs.

The ship's coefficients are inputs of that code, so that one compilation serves all ships.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from ..integrate import kinematics, rk4_step
from ..ops import Array
from ..physics import eq2
from ..physics.actuators import lag_with_rate_limit
from ..physics.wind import apparent_wind
from ..signals import COMMANDS, STATES

if TYPE_CHECKING:
    import casadi

    from ..compiled import Rollout

_P, _MOTION = eq2.NUM_PARAMETERS, 6
_ACTUATORS = 6
_built: dict[tuple[bool, bool, bool], Rollout] = {}


def actuators_after(
    actuators: Sequence[Array], commands: Sequence[Array], dt: Array, values: Sequence[Array]
) -> list[Array]:
    """n, delta, F_b, F_s after `dt` seconds of held commands; `values` as in `DEFAULT_ACTUATORS`. Numbers or
    symbols."""
    T_n, rate_n, T_d, rate_d, T_F, rate_F = values
    pairs = ((T_n, rate_n), (T_d, rate_d), (T_F, rate_F), (T_F, rate_F))
    return [lag_with_rate_limit(a, c, dt, T, rate) for a, c, (T, rate) in zip(actuators, commands, pairs, strict=True)]


def parameter_scale(c: eq2.Coefficients) -> np.ndarray:
    """Typical sizes of p0..p10 for this ship; resistance terms scale with rho L T and the speed sqrt(g L)/10 (130 m:
    3.6 m/s)."""
    area = 0.5 * c.rho * c.L * c.T
    speed = 0.1 * np.sqrt(9.81 * c.L)
    return np.array(
        [0.05, 0.01 * area * speed, 0.015 * area, 0.005 * area / speed, 0.05, 2.5, 0.5, 2.0, 0.03, 0.1, 1.5]
    )


@dataclass(frozen=True)
class Rolling:
    """Inputs of a rollout beside p0..p10.

    Attributes:
        c: left side and geometry.
        actuators: (6,) as in `DEFAULT_ACTUATORS`, or None where the commands are the actuators.
        columns: columns of U that hold the commands, then wind speed and direction if there is wind.
        dt: sample time [s].
        substeps: integration steps a sample.
    """

    c: eq2.Coefficients
    actuators: np.ndarray | None
    columns: tuple[int, ...]
    dt: float
    substeps: int

    def states(self, s0: np.ndarray, U: np.ndarray, p: np.ndarray) -> np.ndarray:
        """S (batch, K, 10) at t_1..t_K from s0 (batch, 10) under U (batch, K, inputs); a run that diverges is not
        finite from there on."""
        return self._rollout(False)(s0, self._inputs(U), self._values(p), self.substeps)

    def linearised(self, s0: np.ndarray, U: np.ndarray, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """S and the derivatives (batch, K, 6, 11) of its motion with respect to p0..p10."""
        x0 = np.concatenate([s0, np.zeros((len(s0), _P * _MOTION))], axis=1)
        found = self._rollout(True)(x0, self._inputs(U), self._values(p), self.substeps)
        size = len(STATES)
        return found[..., :size], found[..., size:].reshape(*found.shape[:2], _MOTION, _P)

    def _inputs(self, U: np.ndarray) -> np.ndarray:
        return U if self.columns == tuple(range(U.shape[2])) else U[:, :, list(self.columns)]

    def _values(self, p: np.ndarray) -> np.ndarray:
        actuators = np.ones(_ACTUATORS) if self.actuators is None else self.actuators
        return np.concatenate([p, actuators, [self.dt / self.substeps], _numbers(self.c)])

    def _rollout(self, sensitivities: bool) -> Rollout:
        kind = (self.actuators is None, len(self.columns) > len(COMMANDS), sensitivities)
        if kind not in _built:
            from ..compiled import Rollout

            _built[kind] = Rollout(_step(self.c, *kind))
        return _built[kind]


@lru_cache(maxsize=64)
def _numbers(c: eq2.Coefficients) -> np.ndarray:
    return np.array(numbers_of(c))


def numbers_of(value: Any) -> list[float]:
    """Numbers in a dataclass, in order."""
    if is_dataclass(value):
        return [number for f in fields(value) for number in numbers_of(getattr(value, f.name))]
    return [number for item in value for number in numbers_of(item)] if isinstance(value, tuple) else [value]


def with_numbers(like: Any, numbers: Iterator[Array]) -> Any:
    """Copy of the dataclass `like` with other numbers in the same places."""
    if is_dataclass(like):
        values = {f.name: with_numbers(getattr(like, f.name), numbers) for f in fields(like)}
        return replace(like, **values)  # type: ignore[type-var]
    return tuple(with_numbers(item, numbers) for item in like) if isinstance(like, tuple) else next(numbers)


def _step(like: eq2.Coefficients, commanded: bool, wind: bool, sensitivities: bool) -> casadi.Function:
    """Integration step (x, w, p) -> x': x the ten states, then, with `sensitivities`, d(motion)/d(p0..p10) row by
    row."""
    import casadi as ca

    x, w = ca.SX.sym("x", len(STATES)), ca.SX.sym("w", len(COMMANDS) + 2 * wind)
    p, values, h = ca.SX.sym("p", _P), ca.SX.sym("values", _ACTUATORS), ca.SX.sym("h")
    numbers = ca.SX.sym("c", len(numbers_of(like)))
    c = with_numbers(like, iter(ca.vertsplit(numbers)))
    now, commands = ca.vertsplit(x[_MOTION:]), ca.vertsplit(w[: len(COMMANDS)])
    middle, end = (
        commands if commanded else actuators_after(now, commands, dt, ca.vertsplit(values)) for dt in (0.5 * h, h)
    )
    stages = (commands if commanded else now, middle, end)

    def rhs(state: tuple[Array, ...], stage: int) -> tuple[Array, ...]:
        _, _, psi, u, v, r = state
        n, delta, F_b, F_s = stages[stage]
        air = apparent_wind(psi, u, v, w[4], w[5]) if wind else None
        return (*kinematics(psi, u, v, r), *eq2.accelerations(u, v, r, n, delta, F_b, F_s, air, c, ca.vertsplit(p)))

    after = ca.vertcat(*rk4_step(rhs, tuple(ca.vertsplit(x[:_MOTION])), h))
    following = ca.vertcat(after, *end)
    given = ca.vertcat(p, values, h, numbers)
    if not sensitivities:
        return ca.Function("step", [x, w, given], [following], {"cse": True})
    S = ca.SX.sym("S", _P, _MOTION).T
    S_after = ca.jacobian(after, x[:_MOTION]) @ S + ca.jacobian(after, p)
    return ca.Function(
        "step", [ca.vertcat(x, ca.vec(S.T)), w, given], [ca.vertcat(following, ca.vec(S_after.T))], {"cse": True}
    )
