"""The rudder turns no faster than a limit below the 2.3 deg/s that SOLAS asks for: rate = min(rate of the gear, limit);
zero means no limit."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from ..ops import Array, minimum, where
from ..physics.actuators import Gear
from .base import Effect, Parameter
from .traits import Traits


class RudderRateLimit(Effect):
    family = "rudder"
    summary = "slow steering gear: rate limit"
    phrase = "a rudder rate limit of {rate}"
    source = "docs/theory.md#actuators; SOLAS II-1, regulation 29 (65 deg in 28 s)"
    traits = Traits(search="record", gear_field="rate")
    parameters = (Parameter("rate", "rad/s", math.radians(1.2), 0.0017, 0.2, scaling="rate"),)
    separate = "small and large rudder steps: a rate limit takes longer for the large one"

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears["delta"] = replace(
            gears["delta"], rate=where(q[0] > 0.0, minimum(gears["delta"].rate, q[0]), gears["delta"].rate)
        )


EFFECT = RudderRateLimit()
