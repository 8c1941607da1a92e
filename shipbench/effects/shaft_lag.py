"""The shaft follows its order with a longer time constant: T + lag."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..ops import Array
from ..physics.actuators import Gear
from .base import Effect, Parameter
from .traits import Traits


class ShaftLag(Effect):
    family = "propulsion"
    summary = "slow first-order shaft"
    phrase = "an additional shaft lag of {lag}"
    source = "docs/theory.md#actuators"
    traits = Traits(between_ships=True, gear_field="T")
    parameters = (Parameter("lag", "s", 10.0, 0.0, 120.0, scaling="time"),)
    unrecorded = True
    separate = "small and large steps of the shaft speed"

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        gears["n"] = replace(gears["n"], T=gears["n"].T + q[0])


EFFECT = ShaftLag()
