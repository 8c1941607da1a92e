"""A mean wind that is not measured and differs from run to run."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter, body_axes


class WindPerRun(Effect):
    family = "environment"
    summary = "mean wind, another one in each run"
    source = "as wind"
    parameters = (Parameter("north", "m/s", 7.0, -30.0, 30.0, scaling="speed"), Parameter("east", "m/s", 7.0, -30.0, 30.0, scaling="speed"))
    per_run = True
    vector = ("speed", "from")
    separate = "an anemometer, or reciprocal courses within one run"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        air_u, air_v = body_axes(q[0], q[1], s.psi)
        e.air_u, e.air_v = e.air_u - air_u, e.air_v - air_v


EFFECT = WindPerRun()
