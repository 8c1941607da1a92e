"""Batched simulation of an MMG ship under commands: fixed-step RK4 for the motion, exact steps for the actuators."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..integrate import motion_rhs, rk4_step
from ..physics.actuators import lag_with_rate_limit
from ..physics.mmg import CALM, Environment, MMGShip, accelerations
from ..signals import STATES


@dataclass(frozen=True)
class Simulator:
    """The ship and the greatest internal step [s].

    The default, 0.25 s, keeps the RK4 error of the 130 m ship's 120 s rollouts below 1 mm; shorter ships need steps shorter by sqrt(L).
    """

    ship: MMGShip
    max_step: float = 0.25

    def actuators(self, actuators: np.ndarray, commands: np.ndarray, dt: float) -> np.ndarray:
        """Actuator states (batch, 4) after `dt` seconds of held `commands` (batch, 4) [rpm, rad, N, N]."""
        a, F_max = self.ship.actuators, self.ship.particulars.thrusters.max_force if self.ship.particulars.thrusters else 0.0
        n, delta, F_b, F_s = np.moveaxis(actuators, -1, 0)
        n_c, delta_c, F_b_c, F_s_c = np.moveaxis(commands, -1, 0)
        return np.stack(
            [
                lag_with_rate_limit(n, n_c, dt, a.T_n, 60.0 * a.rate_n),
                lag_with_rate_limit(delta, np.clip(delta_c, -a.delta_max, a.delta_max), dt, a.T_delta, a.rate_delta),
                lag_with_rate_limit(F_b, np.clip(F_b_c, -F_max, F_max), dt, a.T_F, a.rate_F),
                lag_with_rate_limit(F_s, np.clip(F_s_c, -F_max, F_max), dt, a.T_F, a.rate_F),
            ],
            axis=-1,
        )

    def step(self, states: np.ndarray, commands: np.ndarray, dt: float, env: Environment = CALM) -> np.ndarray:
        """States (batch, 10) after `dt` seconds of held commands (batch, 4) and environment."""
        num = max(1, int(np.ceil(dt / self.max_step - 1e-9)))
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
