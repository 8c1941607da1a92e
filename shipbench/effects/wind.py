"""A mean wind that is not measured; the components say where it comes from, as the signal `wind_from` does."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter, body_axes


class Wind(Effect):
    family = "environment"
    summary = "mean wind, the same in all runs"
    source = "Blendermann (1994) in the simulator, lowest harmonics in the fitted model (physics reference, section 5, E03)"
    parameters = (Parameter("north", "m/s", 7.0, -30.0, 30.0, scaling="speed"), Parameter("east", "m/s", 7.0, -30.0, 30.0, scaling="speed"))
    vector = ("speed", "from")
    separate = "the same manoeuvre at two speeds and on reciprocal courses: wind forces do not grow with the ship's speed"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        air_u, air_v = body_axes(q[0], q[1], s.psi)
        e.air_u, e.air_v = e.air_u - air_u, e.air_v - air_v


EFFECT = Wind()
