"""The thrusters follow their order with a longer time constant: T + lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..ops import Array
from ..physics.actuators import Gear
from .base import Effect, Parameter
from .traits import Traits


class ThrusterLag(Effect):
    family = "thruster"
    summary = "slow thrusters"
    phrase = "an additional thruster lag of {lag}"
    source = "docs/theory.md#thrusters"
    traits = Traits(least_size=0.42, gear_field="T")
    parameters = (Parameter("lag", "s", 6.0, 0.0, 60.0, scaling="time"),)
    separate = "steps of the thruster order"

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears["F"] = replace(gears["F"], T=gears["F"].T + q[0])


EFFECT = ThrusterLag()
