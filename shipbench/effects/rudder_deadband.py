"""The steering gear rests while |command - rudder| is below a band."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..ops import Array
from ..physics.actuators import Gear
from .base import Effect, Parameter
from .traits import Traits


class RudderDeadband(Effect):
    family = "rudder"
    summary = "deadband of the steering gear, or play before it"
    phrase = "a rudder deadband of {band}"
    source = "docs/theory.md#rudder"
    traits = Traits(gear_field="deadband")
    parameters = (Parameter("band", "rad", math.radians(1.5), 0.0, 0.12),)
    separate = "rudder steps smaller than the suspected band"

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears["delta"] = replace(gears["delta"], deadband=gears["delta"].deadband + q[0])


EFFECT = RudderDeadband()
