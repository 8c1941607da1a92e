"""Actuators: a first-order lag with a rate limit, solved exactly, so that any step size may be used."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..ops import Array, absolute, clip, exp, maximum, minimum, sign


def lag_with_rate_limit(value: Array, command: Array, dt: Array, T: Array, rate: Array) -> Array:
    """The actuator after `dt` seconds of a held command.

    d(value)/dt = clip((command - value)/T, -rate, rate): it moves at `rate` while the error exceeds rate T, then decays with time constant T [s].
    `rate` is in units of `value` per second; T must be positive.
    """
    error = command - value
    size = absolute(error)
    linear = minimum(size, rate * T)
    t_limited = (size - linear) / rate
    moving = clip(dt - t_limited, 0.0, dt)
    left = maximum(size - rate * dt, linear * exp(-moving / T))
    return command - sign(error) * left


@dataclass(frozen=True)
class Gear:
    """What lies between a command and its actuator: transport delay [s], time constant T [s], rate limit, deadband of the controller and play
    (backlash) of the transmission, the last three in the actuator's units (and per second)."""

    T: Array
    rate: Array
    delay: Array = 0.0
    deadband: Array = 0.0
    backlash: Array = 0.0


def gear_path(start: np.ndarray, command: np.ndarray, dt: float, gear: Gear, substeps: int = 1) -> np.ndarray:
    """The actuator (runs, samples * substeps + 1) that follows held commands (runs, samples) from `start` (runs,).

    The controller sees the command `delay` seconds late (the first command held before) and rests while |command - position| < deadband; the motor
    moves with lag and rate limit; the actuator follows the motor once the play is taken up (it starts in the middle of it). Each value of the gear
    may be one per run.
    """
    runs, samples = command.shape
    h = dt / substeps
    motor, out = start.copy(), np.empty((runs, samples * substeps + 1))
    out[:, 0] = start
    position = start.copy()
    shift = gear.delay / h
    whole = np.floor(shift).astype(int)
    part = shift - whole
    held, rows = np.repeat(command, substeps, axis=1), np.arange(runs)
    last = samples * substeps - 1
    for j in range(last + 1):
        now, before = held[rows, np.clip(j - whole, 0, last)], held[rows, np.clip(j - whole - 1, 0, last)]
        for wanted, time in ((before, part * h), (now, (1.0 - part) * h)):
            if np.all(time <= 0.0):
                continue
            moved = lag_with_rate_limit(motor, wanted, time, gear.T, gear.rate)
            motor = _stopped_short(motor, moved, wanted, gear.deadband) if np.any(gear.deadband) else moved
        position = np.clip(position, motor - 0.5 * gear.backlash, motor + 0.5 * gear.backlash) if np.any(gear.backlash) else motor
        out[:, j + 1] = position
    return out


def _stopped_short(before: np.ndarray, after: np.ndarray, wanted: np.ndarray, deadband: Array) -> np.ndarray:
    """Where a controller with a deadband leaves the motor that would have moved from `before` to `after`: it stops the moment it is near enough."""
    side = np.sign(wanted - before)
    near = np.abs(wanted - before) <= deadband
    return np.where(near, before, side * np.minimum(side * after, side * wanted - deadband))
