"""Simulation of the MMG ship with hidden causes: effects on the hull, in the actuator dynamics and in the sensors,
under unrecorded gusts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..effects.base import Effect, flow_first
from ..integrate import kinematics, rk4_step
from ..ops import Array
from ..physics.actuators import Gear, gear_path
from ..physics.mmg import CALM, Environment, MMGActuators, MMGShip, accelerations
from ..physics.modifiers import Flow, Modifiers
from ..ship import Ship, complete


class Vessel(Protocol):
    """Ship that can be sailed in trials."""

    @property
    def name(self) -> str: ...
    @property
    def L(self) -> float: ...
    @property
    def particulars(self) -> Ship: ...
    @property
    def actuators(self) -> MMGActuators: ...


@dataclass(frozen=True)
class Hidden:
    """Effect and its values `q`: numbers, or one per run."""

    effect: Effect
    q: tuple[Array, ...]


def gears_of(ship: Vessel, hidden: Sequence[Hidden]) -> dict[str, Gear]:
    """Dynamics of shaft [rpm], rudder [rad] and thrusters [N], as built and then as changed by the hidden effects."""
    a = ship.actuators
    gears = {"n": Gear(a.T_n, 60.0 * a.rate_n), "delta": Gear(a.T_delta, a.rate_delta), "F": Gear(a.T_F, a.rate_F)}
    for h in hidden:
        h.effect.gear(gears, h.q)
    return gears


def actuator_paths(
    ship: Vessel, s0: np.ndarray, U: np.ndarray, dt: float, num: int, hidden: Sequence[Hidden] = ()
) -> np.ndarray:
    """Actuators (runs, 2 K num + 1, 4) under commands U (runs, K, 4), at the ends and the middle of `num` integration
    steps per sample."""
    gears, limit = gears_of(ship, hidden), ship.particulars.thrusters.max_force if ship.particulars.thrusters else 0.0
    command = [U[..., 0], np.clip(U[..., 1], -ship.actuators.delta_max, ship.actuators.delta_max)]
    command += [np.clip(U[..., i], -limit, limit) for i in (2, 3)]
    kinds = ("n", "delta", "F", "F")
    return np.stack([gear_path(s0[:, 6 + i], command[i], dt, gears[k], 2 * num) for i, k in enumerate(kinds)], axis=-1)


def integrate(
    acceleration: Callable[[Flow, int], tuple[Array, ...]], s0: np.ndarray, actuators: np.ndarray, dt: float, num: int
) -> np.ndarray:
    """States (runs, K + 1, 10) from `s0` (runs, 10) along `actuators` (of `actuator_paths`); `acceleration(flow, k)`
    gives (du, dv, dr) in step k."""
    h, K = dt / num, (actuators.shape[1] - 1) // (2 * num)
    motion = tuple(s0[:, :6].T)
    S = np.empty((len(s0), K + 1, 10))
    S[:, 0], S[:, :, 6:] = s0, actuators[:, :: 2 * num]
    with np.errstate(all="ignore"):  # a run that leaves the finite numbers stays non-finite
        for j in range(K * num):

            def rhs(state: tuple[Array, ...], stage: int, j: int = j) -> tuple[Array, ...]:
                x, y, psi, u, v, r = state
                flow = Flow(x, y, (j + 0.5 * stage) * h, psi, u, v, r, *actuators[:, 2 * j + stage].T)
                return (*kinematics(psi, u, v, r), *acceleration(flow, j // num))

            motion = rk4_step(rhs, motion, h)
            if (j + 1) % num == 0:
                S[:, (j + 1) // num, :6] = np.stack(motion, axis=-1)
    return S


def sail(
    ship: MMGShip,
    s0: np.ndarray,
    U: np.ndarray,
    dt: float,
    hidden: Sequence[Hidden] = (),
    wind: np.ndarray | None = None,
    max_step: float = 0.25,
) -> np.ndarray:
    """True states (runs, K + 1, 10) from `s0` (runs, 10) under commands U (runs, K, 4), `s0` included.

    Args:
        wind: true wind as (speed [m/s], from [rad]) per run and step, (runs, K, 2).
        max_step: greatest integration step [s]; shorter ships need steps shorter by sqrt(L).
    """
    num = max(1, int(np.ceil(dt / max_step - 1e-9)))
    particulars, forces = complete(ship.particulars), flow_first(hidden)

    def acceleration(s: Flow, k: int) -> tuple[Array, ...]:
        env = CALM if wind is None else Environment(wind_speed=wind[:, k, 0], wind_from=wind[:, k, 1])
        e = Modifiers()
        for item in forces:
            item.effect.force(e, s, item.q, particulars)
        return accelerations(ship, s.psi, s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, env, e)

    return integrate(acceleration, s0, actuator_paths(ship, s0, U, dt, num, hidden), dt, num)


def record(
    S: np.ndarray, dt: float, hidden: Sequence[Hidden], noise: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Sensor readings of the true states S (runs, samples, 10): sensor errors, then white noise.

    `noise` (10,) are standard deviations; those of the thruster forces are relative to the reading.
    """
    for item in hidden:
        S = item.effect.measure(S, item.q, dt)
    scale = np.broadcast_to(noise, S.shape).copy()
    scale[..., 8:] *= np.abs(S[..., 8:])
    return S + scale * rng.standard_normal(S.shape)
