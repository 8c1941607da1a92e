"""The compass reads too much by a constant: psi recorded = psi + bias."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..ops import Array
from ..signals import PSI
from .base import Effect, Parameter, per_run


class HeadingBias(Effect):
    family = "sensor"
    summary = "compass error"
    source = "physics reference, section 5, S58"
    parameters = (Parameter("bias", "rad", math.radians(2.0), -0.3, 0.3),)
    separate = "straight runs on one course at two speeds"

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        out = S.copy()
        out[..., PSI] += per_run(q[0])
        return out


EFFECT = HeadingBias()
