"""The rudder gives more lift to one side: times 1 + a where it turns the ship to starboard, 1 - a where to port (smooth
over 0.05 rad)."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class RudderAsymmetry(Effect):
    family = "rudder"
    summary = "unequal lift to port and starboard"
    phrase = "a rudder lift to starboard that is {asymmetry}"
    source = "gamma_R of Yasukawa & Yoshimura (2015), eq. 33"
    traits = Traits(persistent=True, least_size=0.25, in_place_of=(4,))
    parameters = (Parameter("asymmetry", "1", 0.2, -0.8, 0.8, title="lift to starboard", relative=True),)
    breaks_symmetry = True
    separate = "turns of equal amplitude to both sides, small and large: an offset matters most at small angles"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.rudder_asymmetry = e.rudder_asymmetry + q[0]


EFFECT = RudderAsymmetry()
