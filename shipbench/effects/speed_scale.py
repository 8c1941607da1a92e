"""The recorded speeds, surge and sway, are too large by a constant share: u and v times 1 + scale; or, of a log with
one axis, u alone."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import copy
from typing import Self

import numpy as np

from ..ops import Array
from ..signals import U, V
from .base import Effect, Parameter, per_run
from .traits import Traits


class SpeedScale(Effect):
    family = "sensor"
    summary = "scale of the speed log"
    phrase = "recorded speeds that are {scale}"
    source = "docs/theory.md#sensors"
    traits = Traits(faults_of=frozenset({"u", "v"}))
    parameters = (Parameter("scale", "1", 0.05, -0.5, 0.5, title="recorded speed", relative=True),)
    scales = ("u", "v")
    separate = "straight runs on reciprocal courses"
    sway = 1.0

    def fitted(self, L: float) -> tuple[Self, ...]:
        """Both forms: a log has one axis or two, and with one axis the sway comes from another sensor."""
        alone = copy(self)
        alone.sway, alone.way = 0.0, "surge alone is off, sway is not"
        return self, alone

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        out = S.copy()
        out[..., U] *= 1.0 + per_run(q[0])
        out[..., V] *= 1.0 + self.sway * per_run(q[0])
        return out

    def correction(self, values: Mapping[str, float]) -> str:
        recorded = f"{1.0 + values['scale']:.4g}"
        return f"[scale] u = {recorded}" + (f" and v = {recorded}" if self.sway else "")


EFFECT = SpeedScale()
