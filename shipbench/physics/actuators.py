"""Actuators: a first-order lag with a rate limit, solved exactly, so that any step size may be used."""

from __future__ import annotations

from ..ops import Array, absolute, clip, exp, maximum, minimum, sign


def lag_with_rate_limit(value: Array, command: Array, dt: float, T: Array, rate: Array) -> Array:
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
