"""The propeller gives more or less thrust than its open-water curve: times 1 + gain, in its race as well."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class ThrustGain(Effect):
    family = "propulsion"
    summary = "thrust of the propeller"
    phrase = "a propeller thrust that is {gain}"
    source = "docs/theory.md#propulsion"
    traits = Traits(between_ships=True, absorbs_misfit=True, on_card=True)
    parameters = (Parameter("gain", "1", 0.15, -0.6, 1.0, title="propeller thrust", relative=True),)
    separate = "acceleration from rest, or a bollard pull"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.thrust = e.thrust * (1.0 + q[0])


EFFECT = ThrustGain()
