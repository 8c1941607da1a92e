"""Names, units and signs of every signal (Table I of the source paper; docs/formats.md).

Heading `psi` is clockwise from north, `x` north, `y` east, `u` forward, `v` to starboard at midship, `r` bow to
starboard; a positive rudder angle `delta` turns the ship to starboard; a positive thruster force pushes the hull to
starboard. Shaft speed `n` is in rpm everywhere outside the physics formulas.
"""

from __future__ import annotations

import numpy as np

STATES = ("x", "y", "psi", "u", "v", "r", "n", "delta", "F_b", "F_s")
COMMANDS = ("n_c", "delta_c", "F_b_c", "F_s_c")
ENVIRONMENT = ("wind_speed", "wind_from", "depth")
"""Optional measured channels of a data set: true wind speed [m/s], direction it comes from [rad, from north], depth
[m]."""

UNITS = {
    "x": "m", "y": "m", "psi": "rad", "u": "m/s", "v": "m/s", "r": "rad/s", "n": "rpm", "delta": "rad", "F_b": "N",
    "F_s": "N",
    "n_c": "rpm", "delta_c": "rad", "F_b_c": "N", "F_s_c": "N", "wind_speed": "m/s", "wind_from": "rad", "depth": "m",
}  # fmt: skip

X, Y, PSI, U, V, R, N, DELTA, F_B, F_S = range(len(STATES))
VELOCITY = slice(3, 6)
ACTUATORS = slice(6, 10)
MOTION = slice(0, 6)


def wrap_angle(angle):
    """Angle(s) [rad] mapped to (-pi, pi]."""
    return -((-np.asarray(angle) + np.pi) % (2 * np.pi) - np.pi)


def move_frame(states: np.ndarray, origin: np.ndarray, rotation: float) -> np.ndarray:
    """Move states (..., 10) to another earth frame: turn its content by `rotation` [rad, clockwise] about (0, 0), then
    shift by `origin` (2,) [m].

    Predictions must commute with this map (translation and rotation equivariance) where the inputs hold no earth-fixed
    channel.
    """
    moved = np.array(states, dtype=float)
    cos, sin = np.cos(rotation), np.sin(rotation)
    moved[..., X] = origin[0] + cos * states[..., X] - sin * states[..., Y]
    moved[..., Y] = origin[1] + sin * states[..., X] + cos * states[..., Y]
    moved[..., PSI] = states[..., PSI] + rotation
    return moved
