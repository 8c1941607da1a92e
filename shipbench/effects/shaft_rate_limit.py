"""The shaft gains revolutions no faster than a limit (load-up programme)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..ops import minimum
from ..physics.actuators import Gear
from .base import Effect, Parameter


class ShaftRateLimit(Effect):
    family = "propulsion"
    summary = "slow shaft: rate limit"
    source = "physics reference, section 5, P32"
    parameters = (Parameter("rate", "rpm/s", 1.0, 0.02, 60.0, scaling="rpm rate"),)
    separate = "small and large steps of the revolutions"

    def gear(self, gears: dict[str, Gear], q: Sequence[float]) -> None:
        gears["n"] = replace(gears["n"], rate=minimum(gears["n"].rate, q[0]))


EFFECT = ShaftRateLimit()
