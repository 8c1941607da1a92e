"""The recorded position is that of an antenna, ahead and to starboard of midship: p + R(psi) (forward, starboard)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..ops import Array
from ..signals import PSI, X, Y
from .base import Effect, Parameter, per_run


class AntennaOffset(Effect):
    family = "sensor"
    summary = "lever arm of the position sensor"
    source = "physics reference, section 5, S61"
    parameters = (Parameter("forward", "m", 12.0, -80.0, 80.0, scaling="length"), Parameter("starboard", "m", 12.0, -40.0, 40.0, scaling="length"))
    separate = "a turn on the spot: the antenna draws a circle"

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        out = S.copy()
        forward, starboard = per_run(q[0]), per_run(q[1])
        c, s = np.cos(S[..., PSI]), np.sin(S[..., PSI])
        out[..., X] += forward * c - starboard * s
        out[..., Y] += forward * s + starboard * c
        return out


EFFECT = AntennaOffset()
