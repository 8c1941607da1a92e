"""The rudder follows its command late by a fixed time; a negative delay means that its record is late."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..ops import Array
from ..physics.actuators import Gear
from .base import Effect, Parameter
from .traits import Traits


class RudderDelay(Effect):
    family = "rudder"
    summary = "transport delay of the steering gear or of its record"
    phrase = "a rudder delay of {delay}"
    source = "docs/theory.md#rudder"
    traits = Traits(between_ships=True, least_size=0.6, gear_field="delay")
    parameters = (Parameter("delay", "s", 1.5, -10.0, 10.0, scaling="time"),)
    unrecorded = True
    separate = "quick rudder reversals, sampled faster"

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears["delta"] = replace(gears["delta"], delay=gears["delta"].delay + q[0])


EFFECT = RudderDelay()
