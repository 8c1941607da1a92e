"""The rudder follows its command with a longer time constant: T + lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..ops import Array
from ..physics.actuators import Gear
from .base import Effect, Parameter
from .traits import Traits


class RudderLag(Effect):
    family = "rudder"
    summary = "slow first-order steering gear"
    phrase = "an additional rudder lag of {lag}"
    source = "docs/theory.md#actuators"
    traits = Traits(between_ships=True, least_size=0.4, gear_field="T")
    parameters = (Parameter("lag", "s", 3.0, 0.0, 30.0, scaling="time"),)
    unrecorded = True
    separate = "small and large rudder steps: a lag takes the same time for both"

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears["delta"] = replace(gears["delta"], T=gears["delta"].T + q[0])


EFFECT = RudderLag()
