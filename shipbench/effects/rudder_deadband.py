"""The steering gear rests while the rudder is within a band of its command."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..physics.actuators import Gear
from .base import Effect, Parameter


class RudderDeadband(Effect):
    family = "rudder"
    summary = "deadband of the steering gear"
    source = "physics reference, section 5, A23"
    parameters = (Parameter("band", "rad", 0.026179938779914945, 0.0, 0.12),)
    separate = "rudder steps smaller than the suspected band"

    def gear(self, gears: dict[str, Gear], q: Sequence[float]) -> None:
        gears["delta"] = replace(gears["delta"], deadband=gears["delta"].deadband + q[0])


EFFECT = RudderDeadband()
