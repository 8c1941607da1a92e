"""Play between steering gear and rudder: the rudder stays behind after each reversal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..physics.actuators import Gear
from .base import Effect, Parameter


class RudderBacklash(Effect):
    family = "rudder"
    summary = "play of the steering gear"
    source = "physics reference, section 5, A24"
    parameters = (Parameter("play", "rad", 0.03490658503988659, 0.0, 0.15),)
    separate = "slow rudder reversals: play leaves a constant difference, a lag none"

    def gear(self, gears: dict[str, Gear], q: Sequence[float]) -> None:
        gears["delta"] = replace(gears["delta"], backlash=gears["delta"].backlash + q[0])


EFFECT = RudderBacklash()
