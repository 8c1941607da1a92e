"""The measured wind does not push this ship as the formula says: forces times 1 + X, 1 + Y, moment times 1 + N, side
force `lever` further ahead."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter


class WindCoefficients(Effect):
    family = "environment"
    summary = "wind forces that differ from the formula"
    phrase = "wind forces that differ from the formula"
    source = "Blendermann (1994), Isherwood (1972): spread between types of ship; s_L is the centre of the lateral area"
    parameters = (
        Parameter("X", "1", 0.5, -1.5, 3.0, title="wind surge force", relative=True),
        Parameter("Y", "1", 0.3, -1.0, 2.0, title="wind side force", relative=True),
        Parameter("N", "1", 0.8, -3.0, 4.0, title="wind yaw moment", relative=True),
        Parameter("lever", "m", 13.0, -40.0, 40.0, scaling="length"),
    )
    separate = "drifting in wind from all sides, with an anemometer"
    channels = ("wind_speed", "wind_from")

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.wind_X, e.wind_Y, e.wind_N, e.wind_lever = (
            e.wind_X + q[0],
            e.wind_Y + q[1],
            e.wind_N + q[2],
            e.wind_lever + q[3],
        )


EFFECT = WindCoefficients()
