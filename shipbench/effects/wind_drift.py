"""The water near the surface drifts with the measured wind: a current of `share` times its velocity."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class WindDrift(Effect):
    family = "environment"
    summary = "water that drifts with the wind"
    phrase = "a water drift of {share}"
    source = "Wu (1975), J. Fluid Mech. 68, 49-70: some 3 % of the wind at the surface, less over the draught"
    traits = Traits(least_size=0.3)
    parameters = (Parameter("share", "1", 0.01, -0.1, 0.1, title="water drift", share_of="wind speed"),)
    moves_flow = True
    separate = "drifting with the shaft stopped, in wind of several strengths"
    channels = ("wind_speed", "wind_from")

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.drift = e.drift + q[0]


EFFECT = WindDrift()
