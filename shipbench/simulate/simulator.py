"""Batched simulation of an MMG ship under commands: fixed-step RK4 for the motion, exact steps for the actuators."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..integrate import motion_rhs, rk4_step
from ..ops import Array, clip
from ..physics.actuators import lag_with_rate_limit
from ..physics.mmg import CALM, Environment, MMGShip, accelerations
from ..signals import COMMANDS, STATES

if TYPE_CHECKING:
    from ..compiled import Rollout

_COMMANDS = len(COMMANDS)


@dataclass(frozen=True)
class Simulator:
    """Simulator of a ship with the greatest internal step [s].

    The default, 0.25 s, keeps the RK4 error of the 130 m ship's 120 s rollouts below 1 mm; shorter ships need steps
    shorter by sqrt(L).
    """

    ship: MMGShip
    max_step: float = 0.25

    def actuators(self, actuators: np.ndarray, commands: np.ndarray, dt: float) -> np.ndarray:
        """Actuator states (batch, 4) after `dt` seconds of held `commands` (batch, 4) [rpm, rad, N, N]."""
        now, wanted = (list(np.moveaxis(a, -1, 0)) for a in (actuators, commands))
        return np.stack(_actuators_after(self.ship, now, wanted, dt), axis=-1)

    def step(self, states: np.ndarray, commands: np.ndarray, dt: float, env: Environment = CALM) -> np.ndarray:
        """States (batch, 10) after `dt` seconds of held commands (batch, 4) and environment."""
        num = self._substeps(dt)
        h = dt / num
        motion, act = tuple(states[:, :6].T), states[:, 6:]
        for _ in range(num):
            stages = [act, self.actuators(act, commands, 0.5 * h), self.actuators(act, commands, h)]

            def acc(psi, u, v, r, stage, stages=stages):
                n, delta, F_b, F_s = stages[stage].T
                return accelerations(self.ship, psi, u, v, r, n, delta, F_b, F_s, env)

            motion = rk4_step(motion_rhs(acc), motion, h)
            act = stages[2]
        return np.concatenate([np.stack(motion, axis=-1), act], axis=-1)

    def rollout(self, s0: np.ndarray, U: np.ndarray, dt: float, env: Environment = CALM) -> np.ndarray:
        """States S (batch, K, 10) under commands U (batch, K, 4); S[:, k] is the state at t_k+1.

        A run that leaves the finite numbers stays non-finite from there on; the others are not disturbed.
        """
        S = np.empty((*U.shape[:2], len(STATES)))
        state = s0
        with np.errstate(all="ignore"):
            for k in range(U.shape[1]):
                state = self.step(state, U[:, k, :4], dt, env)
                S[:, k] = state
        return S

    def fast_rollout(self, s0: np.ndarray, U: np.ndarray, dt: float, env: Environment = CALM) -> np.ndarray:
        """Rollout for planning and Monte Carlo: the formula of `rollout` as machine code (`shipbench.compiled`), the
        same numbers to rounding.

        Data sets are made with `rollout`, whose bits do not depend on a compiler. The first call for a ship compiles,
        about 1 s, and keeps the code.

        Raises:
            InputError: the water is shallow, which this path does not support.
        """
        if env.depth is not None:
            raise InputError(f"fast_rollout knows deep water only; depth = {env.depth}. Use rollout.")
        around = (env.current_speed, env.current_to, env.wind_speed, env.wind_from)
        runs, samples = U.shape[:2]
        w = np.empty((runs, samples, _COMMANDS + len(around)))
        w[:, :, :_COMMANDS] = U[:, :, :_COMMANDS]
        for i, value in enumerate(around, start=_COMMANDS):
            w[:, :, i] = np.reshape(value, (-1, 1))
        num = self._substeps(dt)
        return _machine_code(self.ship)(s0, w, np.array([dt / num]), num)

    def _substeps(self, dt: float) -> int:
        return max(1, int(np.ceil(dt / self.max_step - 1e-9)))


def _actuators_after(ship: MMGShip, actuators: Sequence[Array], commands: Sequence[Array], dt: Array) -> list[Array]:
    """n, delta, F_b, F_s after `dt` seconds of held commands. Numbers or symbols."""
    a, F_max = ship.actuators, ship.particulars.thrusters.max_force if ship.particulars.thrusters else 0.0
    n, delta, F_b, F_s = actuators
    n_c, delta_c, F_b_c, F_s_c = commands
    return [
        lag_with_rate_limit(n, n_c, dt, a.T_n, 60.0 * a.rate_n),
        lag_with_rate_limit(delta, clip(delta_c, -a.delta_max, a.delta_max), dt, a.T_delta, a.rate_delta),
        lag_with_rate_limit(F_b, clip(F_b_c, -F_max, F_max), dt, a.T_F, a.rate_F),
        lag_with_rate_limit(F_s, clip(F_s_c, -F_max, F_max), dt, a.T_F, a.rate_F),
    ]


_made: dict[str, Rollout] = {}


def _machine_code(ship: MMGShip) -> Rollout:
    """One integration step: x the ten states; w commands, current speed and direction, wind speed and direction; p the
    step [s]."""
    import casadi as ca

    from ..compiled import Rollout

    if (key := repr(ship)) in _made:
        return _made[key]
    x, w, h = ca.SX.sym("x", len(STATES)), ca.SX.sym("w", _COMMANDS + 4), ca.SX.sym("h")
    now, commands = ca.vertsplit(x[6:]), ca.vertsplit(w[:_COMMANDS])
    env = Environment(*ca.vertsplit(w[_COMMANDS:]))
    stages = (now, _actuators_after(ship, now, commands, 0.5 * h), _actuators_after(ship, now, commands, h))

    def acc(psi: Array, u: Array, v: Array, r: Array, stage: int) -> tuple[Array, Array, Array]:
        n, delta, F_b, F_s = stages[stage]
        return accelerations(ship, psi, u, v, r, n, delta, F_b, F_s, env)

    after = rk4_step(motion_rhs(acc), tuple(ca.vertsplit(x[:6])), h)
    _made[key] = Rollout(ca.Function("step", [x, w, h], [ca.vertcat(*after, *stages[2])], {"cse": True}))
    return _made[key]
