"""Input features of the models, and poses from velocities; for numpy arrays and torch tensors alike."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import numpy as np

from ..ops import Array, cos, sin
from ..signals import PSI, U, X, Y

CHANNELS = slice(U, None)
"""The channels y = u, v, r, n, delta, F_b, F_s of a state that networks predict; the pose follows from them."""


def joined(parts: Sequence[Array], axis: int = -1) -> Array:
    """Arrays, or tensors, concatenated along `axis`."""
    return (
        np.concatenate(parts, axis)
        if isinstance(parts[0], np.ndarray)
        else sys.modules["torch"].cat(tuple(parts), axis)
    )


class InputFeatures:
    """Input features of a network: wind as its components from ahead and from starboard, invariant to a rotation of the
    axes.

    Args:
        names: columns of U.
    """

    def __init__(self, names: Sequence[str]) -> None:
        self.wind = names.index("wind_from") if "wind_from" in names else None
        self.speed = names.index("wind_speed") if "wind_speed" in names else None
        special = {self.wind, self.speed} if self.wind is not None else set()
        self.plain = [i for i in range(len(names)) if i not in special]
        self.count = len(self.plain) + (0 if self.wind is None else 2)

    def __call__(self, held: Array, psi: Array) -> Array:
        """Features (..., count) of inputs (..., inputs) at heading psi (...)."""
        if self.wind is None:
            return held
        speed = held[..., self.speed] if self.speed is not None else 1.0
        angle = held[..., self.wind] - psi
        return joined([held[..., self.plain], (speed * cos(angle))[..., None], (speed * sin(angle))[..., None]])


def dead_reckoning(s0: Array, y: Array, dt: float) -> Array:
    """Pose (..., K, 3) from velocities at the ends of the steps.

    Args:
        s0: (..., 10) initial states; y: (..., K, 7) channels at t_1 .. t_K.

    Source: paper, eq. (10) to (14): p_k+1 = p_k + dt [u' cos psi - v' sin psi, u' sin psi + v' cos psi, r'], u', v', r'
    at k + 1, psi at k.
    """
    u, v, r = y[..., 0], y[..., 1], y[..., 2]
    psi = s0[..., None, PSI] + dt * r.cumsum(-1)
    before = joined([s0[..., None, PSI], psi[..., :-1]])
    x = s0[..., None, X] + dt * (u * cos(before) - v * sin(before)).cumsum(-1)
    east = s0[..., None, Y] + dt * (u * sin(before) + v * cos(before)).cumsum(-1)
    return joined([part[..., None] for part in (x, east, psi)])
