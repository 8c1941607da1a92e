"""The rudder stands at another angle than recorded (zero error of the gear or its sensor): delta + offset, positive to
starboard."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class RudderOffset(Effect):
    family = "rudder"
    summary = "zero error of the rudder angle"
    phrase = "a rudder offset of {offset}"
    source = "docs/theory.md#rudder"
    traits = Traits(in_place_of=(4,), in_place_beside_hull=(0,))
    parameters = (Parameter("offset", "rad", math.radians(2.0), -0.15, 0.15),)
    breaks_symmetry = True
    separate = (
        "vary the shaft speed at one speed: the offset acts with the race, propeller walk with the thrust, "
        "wind with neither"
    )

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.delta = e.delta + q[0]

    def correction(self, values: Mapping[str, float]) -> str:
        return f"[bias] delta = {-values['offset']:.3g}"


EFFECT = RudderOffset()
