"""The propeller's race reaches the rudder faster or slower: its speed beyond the wake's, times 1 + gain."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class RaceGain(Effect):
    family = "rudder"
    summary = "speed of the propeller race at the rudder"
    phrase = "a propeller race that is {gain} at the rudder"
    source = "kappa of Yasukawa & Yoshimura (2015), eq. 38"
    traits = Traits(between_ships=True, persistent=True, on_card=True, ordinary=(-0.45, 0.1))
    parameters = (Parameter("gain", "1", 0.3, -0.9, 1.5, title="race speed", relative=True),)
    separate = "turns at low and high shaft speed from one speed"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.race = e.race * (1.0 + q[0])


EFFECT = RaceGain()
