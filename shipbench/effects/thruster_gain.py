"""Both thrusters push more or less than recorded: times 1 + gain."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class ThrusterGain(Effect):
    family = "thruster"
    summary = "force of the thrusters"
    phrase = "thruster forces that are {gain}"
    source = "docs/theory.md#thrusters"
    traits = Traits(between_ships=True, on_card=True)
    parameters = (Parameter("gain", "1", -0.4, -1.0, 1.0, title="thruster force", relative=True),)
    separate = "thruster pushes at rest"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.bow, e.stern = e.bow * (1.0 + q[0]), e.stern * (1.0 + q[0])


EFFECT = ThrusterGain()
