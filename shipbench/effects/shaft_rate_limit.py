"""The shaft gains revolutions no faster than a limit (load-up programme): rate = min(rate of the shaft, limit); zero
means no limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..ops import Array, minimum, where
from ..physics.actuators import Gear
from .base import Effect, Parameter
from .traits import Traits


class ShaftRateLimit(Effect):
    family = "propulsion"
    summary = "slow shaft: rate limit"
    phrase = "a shaft rate limit of {rate}"
    source = "docs/theory.md#actuators"
    traits = Traits(search="record", gear_field="rate")
    parameters = (Parameter("rate", "rpm/s", 1.0, 0.02, 60.0, scaling="rpm rate"),)
    separate = "small and large steps of the shaft speed"

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears["n"] = replace(gears["n"], rate=where(q[0] > 0.0, minimum(gears["n"].rate, q[0]), gears["n"].rate))


EFFECT = ShaftRateLimit()
