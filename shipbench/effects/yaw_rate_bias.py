"""The rate gyro reads too much by a constant: r recorded = r + bias."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..ops import Array
from ..signals import R
from .base import Effect, Parameter, per_run
from .traits import Traits


class YawRateBias(Effect):
    family = "sensor"
    summary = "offset of the rate gyro"
    phrase = "a rate gyro offset of {bias}"
    source = "docs/theory.md#sensors"
    traits = Traits(faults_of=frozenset({"r"}))
    parameters = (Parameter("bias", "rad/s", math.radians(0.1), -0.1, 0.1, scaling="rate"),)
    separate = "any straight run: heading and integrated yaw rate part"

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        out = S.copy()
        out[..., R] += per_run(q[0])
        return out

    def correction(self, values: Mapping[str, float]) -> str:
        return f"[bias] r = {values['bias']:.3g}"


EFFECT = YawRateBias()
