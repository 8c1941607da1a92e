"""The compass reads too much by a constant: psi recorded = psi + bias. Surge and sway are of a sensor in the ship's own
axes (a log), or velocities over ground from satellites that the same compass turned into the ship's axes: u cos + v
sin, v cos - u sin of the bias. Those agree with the track and the heading, so that only the forces tell: they act along
the ship."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..ops import Array
from ..ship import Particulars
from ..signals import PSI, U, V
from .base import Effect, Parameter, body_axes, per_run


class HeadingBias(Effect):
    family = "sensor"
    summary = "compass error, the velocities turned by it or not"
    phrase = "a heading error of {bias}"
    source = "docs/theory.md#sensors"
    parameters = (
        Parameter("bias", "rad", math.radians(2.0), -0.3, 0.3),
        Parameter("turned_velocities", "1", 0.0, 0.0, 1.0, shape=True, other=True),
    )
    separate = "straight runs on one course at two speeds"

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        """Measurement as by `Effect.measure`; without a second value the velocities are not rotated."""
        bias, *turned = (per_run(value) for value in q)
        out = S.copy()
        out[..., PSI] += bias
        if turned:
            out[..., U], out[..., V] = body_axes(S[..., U], S[..., V], bias * turned[0])
        return out

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        return [(0.0,), (1.0,)]

    def correction(self, values: Mapping[str, float]) -> str:
        """Line with the bias of psi, where the velocities are not rotated with it."""
        return "" if values.get("turned_velocities") else f"[bias] psi = {values['bias']:.3g}"


EFFECT = HeadingBias()
