"""Closed-loop port approaches and departures: waypoints, line-of-sight steering, speed commands, stops and thrusters,
for many runs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..physics.mmg import MMGShip
from ..signals import PSI, R, U, V, X, Y, wrap_angle
from .manoeuvres import straight_state
from .simulator import Simulator

_LEGS = 24


@dataclass(frozen=True)
class Gusts:
    """Hidden wind: an Ornstein-Uhlenbeck vector with standard deviation `sigma` per axis [m/s] and time constant `tau`
    [s]."""

    sigma: float
    tau: float


@dataclass(frozen=True)
class Plan:
    """Intentions of the pilots of all runs; arrays have the run as first axis.

    waypoints (runs, legs, 2) [m]; target_speed (runs, orders) [m/s] in force from order_time (runs, orders) [s];
    engine_gain (runs,) [rpm per m/s]; stopping (runs,): the ship is brought to a stop with astern shaft speed;
    thrusters (runs,): tunnel thrusters help to steer.
    """

    waypoints: np.ndarray
    target_speed: np.ndarray
    order_time: np.ndarray
    engine_gain: np.ndarray
    stopping: np.ndarray
    thrusters: np.ndarray
    speed: np.ndarray
    course: np.ndarray


def draw_plan(rng: np.random.Generator, num: int, L: float, horizon: float, warm_up: float) -> Plan:
    """Draw the intentions of `num` runs: winding channels, speed commands every 20 to 60 s, a few stops, a few thruster
    assists."""
    speed = np.clip(np.where(rng.random(num) < 0.66, rng.normal(4.02, 0.18, num), rng.normal(5.3, 0.32, num)), 2.4, 6.3)
    course = rng.uniform(-np.pi, np.pi, num)
    turns = np.deg2rad(-4.0) + np.deg2rad(np.where(rng.random(num) < 0.08, 85.0, rng.uniform(0.0, 34.0, num)))[
        :, None
    ] * rng.standard_normal((num, _LEGS))
    turns[:, 0] = 0.0
    courses = course[:, None] + np.cumsum(np.clip(turns, -1.6, 1.6), axis=1)
    legs = rng.uniform(1.5, 3.0, (num, _LEGS)) * L
    steps = legs[..., None] * np.stack([np.cos(courses), np.sin(courses)], axis=-1)
    start = np.stack([rng.uniform(-1200, 600, num), rng.uniform(-1900, 2600, num)], axis=-1)
    orders = np.cumsum(rng.uniform(15.0, 60.0, (num, 30)), axis=1) - 40.0
    stopping = np.zeros(num, bool)
    stopping[rng.choice(num, max(1, num // 22), replace=False)] = True
    speed = np.where(stopping, rng.uniform(2.8, 3.6, num), speed)
    target = np.clip(speed[:, None] - 0.43 + rng.normal(0.0, 0.6, (num, 30)), 1.8, 6.6)
    target[stopping] = np.where(orders[stopping] > warm_up - 60.0, -0.6, target[stopping])
    assist = stopping | (rng.random(num) < 0.05)
    return Plan(
        start[:, None] + np.cumsum(steps, axis=1),
        target,
        orders,
        rng.uniform(32.0, 80.0, num),
        stopping,
        assist,
        speed,
        course,
    )


def fly(
    ship: MMGShip, plan: Plan, rng: np.random.Generator, horizon: int, warm_up: int, gusts: Gusts | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Sail the plan with the pilots' controllers at 1 s.

    Returns:
        States (runs, horizon + 1, 10) and commands (runs, horizon + 1, 4) of the recorded part, after `warm_up` seconds
        that give every run a natural initial state.
    """
    from ..physics.mmg import Environment

    sim, num = Simulator(ship), len(plan.speed)
    state = straight_state(0.0, 90.0, num)
    state[:, U], state[:, PSI] = plan.speed, plan.course
    state[:, [X, Y]] = plan.waypoints[:, 0]
    leg = np.ones(num, int)
    wind = np.zeros((num, 2))
    S, C = np.empty((num, horizon + 1, 10)), np.empty((num, horizon + 1, 4))
    for k in range(warm_up + horizon + 1):
        command, leg = _pilot(ship, plan, state, leg, float(k))
        if k >= warm_up:
            S[:, k - warm_up], C[:, k - warm_up] = state, command
        if gusts is not None:
            keep = np.exp(-1.0 / gusts.tau)
            wind = keep * wind + gusts.sigma * np.sqrt(1.0 - keep**2) * rng.standard_normal((num, 2))
        env = Environment(wind_speed=np.hypot(*wind.T), wind_from=np.arctan2(*wind.T[::-1]))
        state = sim.step(state, command, 1.0, env)
    return S, C


def _pilot(ship: MMGShip, plan: Plan, state: np.ndarray, leg: np.ndarray, t: float) -> tuple[np.ndarray, np.ndarray]:
    """Commands (runs, 4) of line-of-sight steering and the speed commands; and the leg that each run is on."""
    rows = np.arange(len(leg))
    to_go = plan.waypoints[rows, leg] - state[:, [X, Y]]
    leg = np.minimum(leg + (np.hypot(*to_go.T) < 0.75 * ship.L), _LEGS - 1)
    a, b = plan.waypoints[rows, leg - 1], plan.waypoints[rows, leg]
    along = np.arctan2(*(b - a).T[::-1])
    offset = state[:, [X, Y]] - a
    cross = -offset[:, 0] * np.sin(along) + offset[:, 1] * np.cos(along)
    wanted = along - np.arctan(cross / (1.3 * ship.L))
    drift = np.arctan2(state[:, V], np.maximum(state[:, U], 1.0))
    error = wrap_angle(wanted - drift - state[:, PSI])
    order = np.maximum((plan.order_time <= t).sum(axis=1) - 1, 0)
    target = plan.target_speed[rows, order]
    # The engine order is given once per speed order from the speed then sailed: pilots do not trim the shaft every
    # second.
    rpm = np.clip(25.0 * target + plan.engine_gain * (target - state[:, U]), -180.0, 180.0)
    rpm = np.where(plan.stopping, rpm, np.maximum(rpm, 20.0))  # dead slow ahead is the least order under way
    rpm = np.where(plan.stopping & (target < 0), np.where(state[:, U] > target, np.minimum(rpm, -100.0), 0.0), rpm)
    rpm = np.round(rpm / 10.0) * 10.0
    delta = np.clip(0.6 * error - 30.0 * state[:, R], -ship.actuators.delta_max, ship.actuators.delta_max)
    delta = np.deg2rad(np.round(np.rad2deg(delta)))
    F_max = float(ship.particulars.thrusters.max_force) if ship.particulars.thrusters else 0.0
    slow = plan.thrusters & (np.abs(error) > np.deg2rad(15.0))
    push = np.where(slow, np.clip(1.6 * error - 25.0 * state[:, R], -1.0, 1.0), 0.0) * F_max
    push = np.where(np.abs(push) < 0.1 * F_max, 0.0, push)
    return np.stack([rpm, delta, push, np.where(plan.stopping, -0.7 * push, 0.0)], axis=-1), leg
