"""Play between steering gear and rudder: after each reversal the rudder stays until the play is taken up; half of it on
either side."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..ops import Array
from ..physics.actuators import Gear
from .base import Effect, Parameter
from .traits import Traits


class RudderBacklash(Effect):
    family = "rudder"
    summary = "play of the steering gear"
    phrase = "a play of {play} in the steering gear"
    source = "docs/theory.md#rudder"
    traits = Traits(between_ships=True, least_unrecorded=0.4, gear_field="backlash")
    parameters = (Parameter("play", "rad", math.radians(2.0), 0.0, 0.15),)
    unrecorded = True
    separate = "slow rudder reversals: play leaves a constant difference, a lag none"

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears["delta"] = replace(gears["delta"], backlash=gears["delta"].backlash + q[0])


EFFECT = RudderBacklash()
