"""The centre of gravity lies elsewhere than the ship file says: x_G + shift, forward positive; mass and inertia about
it stay. A shift of 0.06 L trims the ship by as much, over a longitudinal metacentric height of one length: by more than
her draught."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class CenterOfGravityShift(Effect):
    family = "hull"
    summary = "longitudinal centre of gravity"
    phrase = "a centre of gravity shifted forward by {shift}"
    source = "Fossen (2021), chapter 3; docs/theory.md#hull-and-loading"
    traits = Traits(between_ships=True)
    parameters = (Parameter("shift", "m", 4.0, -15.0, 15.0, scaling="length"),)
    separate = "rudder reversals and thruster pushes at two positions"

    def plausible(self, q: Sequence[float], ship: Particulars) -> bool:
        return super().plausible(q, ship) and abs(q[0]) < 0.06 * ship.L

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.x_G = e.x_G + q[0]


EFFECT = CenterOfGravityShift()
