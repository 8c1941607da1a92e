"""The recorded position is old: x and y at t - delay; a negative delay means that they run ahead of the other
channels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..ops import Array
from ..signals import X, Y
from .base import Effect, Parameter, delayed
from .traits import Traits


class PositionDelay(Effect):
    family = "sensor"
    late = True
    summary = "latency of the position"
    phrase = "positions that are {delay} late"
    source = "docs/theory.md#sensors"
    traits = Traits(faults_of=frozenset({"x", "y"}))
    parameters = (Parameter("delay", "s", 2.0, -10.0, 10.0, scaling="time"),)
    separate = "changes of speed and course"

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        return delayed(S, (X, Y), q[0], dt)

    def correction(self, values: Mapping[str, float]) -> str:
        return f"[delay] x = {values['delay']:.3g} and y = {values['delay']:.3g}"


EFFECT = PositionDelay()
