"""More resistance than the model has (fouling, damage, a towed body): that of the hull times 1 + share."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class AddedResistance(Effect):
    family = "propulsion"
    summary = "resistance of the hull"
    phrase = "a hull resistance that is {share}"
    source = "Townsin (2003), The ship hull fouling penalty, Biofouling 19, 9-15; docs/theory.md#propulsion"
    traits = Traits(between_ships=True)
    acts_through = ()  # a towed ship has it, too
    parameters = (Parameter("share", "1", 0.3, -0.6, 3.0, title="hull resistance", relative=True),)
    separate = "coast down with the shaft stopped, from two speeds"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.scale_hull(resistance=1.0 + q[0])


EFFECT = AddedResistance()
