"""Actuators: a first-order lag with a rate limit, solved exactly, so that any step size may be used."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..ops import Array, absolute, clip, exp, maximum, minimum, sign, where
from .modifiers import is_neutral


def lag_with_rate_limit(value: Array, command: Array, dt: Array, T: Array, rate: Array) -> Array:
    """Actuator after `dt` seconds of a held command.

    d(value)/dt = clip((command - value)/T, -rate, rate): it moves at `rate` while the error exceeds rate T, then decays
    with time constant T [s]. `rate` is in units of `value` per second; T must be positive.
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
    """Dynamics between a command and its actuator.

    Transport delay [s], time constant T [s], rate limit, deadband of the controller and play (backlash) of the
    transmission, these three in the actuator's units (and per second); T2: time constant [s] of a second stage, such as
    the filter of a sensor, in place of play.
    """

    T: Array
    rate: Array
    delay: Array = 0.0
    deadband: Array = 0.0
    backlash: Array = 0.0
    T2: Array = 0.0


def gear_path(start: np.ndarray, command: np.ndarray, dt: float, gear: Gear, substeps: int = 1) -> np.ndarray:
    """Actuator (runs, samples * substeps + 1) that follows held commands (runs, samples) from `start` (runs,).

    The controller receives the command `delay` seconds late (the first command held before) and rests while |command -
    position| < deadband; the motor moves with lag and rate limit; the actuator follows the motor once the play is taken
    up (it starts in the middle of it). Each value of the dynamics may be one per run.
    """
    runs, samples = command.shape
    h = dt / substeps
    motor, out = start.copy(), np.empty((runs, samples * substeps + 1))
    out[:, 0] = start
    position = start.copy()
    shift = gear.delay / h
    whole = np.floor(shift).astype(int)
    part = shift - whole
    held, steps, last = (
        np.repeat(command, substeps, axis=1),
        np.arange(samples * substeps)[:, None],
        samples * substeps - 1,
    )
    seen = [
        (held[np.arange(runs), np.clip(steps - whole - late, 0, last)], time)
        for late, time in ((1, part * h), (0, (1.0 - part) * h))
    ]
    seen = [(values, time) for values, time in seen if not np.all(time <= 0.0)]
    follows = replace(gear, **{name: 0.0 for name in ("deadband", "backlash", "T2") if not np.any(getattr(gear, name))})
    for j in range(last + 1):
        motor, position = gear_step(motor, position, [(values[j], time) for values, time in seen], follows)
        out[:, j + 1] = position
    return out


def gear_step(motor: Array, position: Array, wanted: Sequence[tuple[Array, Array]], gear: Gear) -> tuple[Array, Array]:
    """Motor and actuator after commands that reach the controller one after the other, each with its duration [s]."""
    for command, time in wanted:
        before = motor
        moved = lag_with_rate_limit(motor, command, time, gear.T, gear.rate)
        motor = moved if is_neutral(gear.deadband, 0.0) else _stopped_short(motor, moved, command, gear.deadband)
        if not is_neutral(gear.T2, 0.0):
            position = _second_lag(position, before, motor, time, gear.T2)
    if not is_neutral(gear.T2, 0.0):
        return motor, position
    return motor, motor if is_neutral(gear.backlash, 0.0) else clip(
        position, motor - 0.5 * gear.backlash, motor + 0.5 * gear.backlash
    )


def _second_lag(value: Array, before: Array, after: Array, dt: Array, T: Array) -> Array:
    """Output of a lag with time constant T behind a motor that moves evenly from `before` to `after` within `dt`
    seconds."""
    behind = (after - before) * T / dt
    return after - behind + (value - before + behind) * exp(-dt / T)


def _stopped_short(before: Array, after: Array, wanted: Array, deadband: Array) -> Array:
    """Motor position under a deadband: it would have moved from `before` to `after`, and stops the moment it is near
    enough."""
    side = sign(wanted - before)
    near = absolute(wanted - before) <= deadband
    return where(near, before, side * minimum(side * after, side * wanted - deadband))
