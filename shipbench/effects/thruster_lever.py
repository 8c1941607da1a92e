"""The bow thruster stands elsewhere than the ship file says: its lever + shift, forward positive. It acts within three
quarters of the length from midship, whatever the hull makes of its jet."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class ThrusterLever(Effect):
    family = "thruster"
    summary = "lever of the bow thruster"
    phrase = "a bow thruster shifted forward by {shift}"
    source = "docs/theory.md#thrusters"
    traits = Traits(between_ships=True, absorbs_misfit=True)
    parameters = (Parameter("shift", "m", -20.0, -60.0, 60.0, scaling="length"),)
    separate = "bow and stern thruster alone, at rest"

    def plausible(self, q: Sequence[float], ship: Particulars) -> bool:
        return super().plausible(q, ship) and abs(ship.x_bow + q[0]) < 0.75 * ship.L

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.lever = e.lever + q[0]


EFFECT = ThrusterLever()
