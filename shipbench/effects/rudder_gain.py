"""The rudder gives more or less lift than its size says, at all speeds and loadings: times 1 + gain."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class RudderGain(Effect):
    family = "rudder"
    summary = "lift of the rudder"
    phrase = "a rudder lift that is {gain}"
    source = "docs/theory.md#rudder"
    traits = Traits(between_ships=True)
    parameters = (Parameter("gain", "1", 0.25, -0.7, 1.0, title="rudder lift", relative=True),)
    separate = "kick ahead at zero speed with the rudder over: it isolates the rudder from the hull"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.rudder = e.rudder * (1.0 + q[0])


EFFECT = RudderGain()
