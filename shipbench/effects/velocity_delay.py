"""The recorded surge and sway velocities are old (a slow filter acts alike): u and v at t - delay."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..ops import Array
from ..signals import U, V
from .base import Effect, Parameter, delayed


class VelocityDelay(Effect):
    family = "sensor"
    summary = "latency of the velocities"
    source = "physics reference, section 5, S64"
    parameters = (Parameter("delay", "s", 2.0, -10.0, 10.0, scaling="time"),)
    separate = "changes of speed and quick turns"

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        return delayed(S, (U, V), q[0], dt)


EFFECT = VelocityDelay()
