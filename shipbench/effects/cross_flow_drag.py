"""Drag of the flow across the hull beyond the model's own: Y = -rho/2 T C int w|w| dx, N = -rho/2 T C int x w|w| dx, w
= v + x r."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.hull import cross_flow
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class CrossFlowDrag(Effect):
    family = "hull"
    summary = "cross-flow drag at large drift and yaw rate"
    phrase = "a cross-flow drag coefficient that differs by {coefficient}"
    source = "Faltinsen (1990), Sea Loads on Ships and Offshore Structures; docs/theory.md#hull-and-loading"
    traits = Traits(between_ships=True, persistent=True, on_card=True)
    parameters = (Parameter("coefficient", "1", 0.5, -0.6, 2.0),)
    separate = "thruster pushes sideways at rest, and hard turns"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        I_Y, I_N = cross_flow(s.v - e.v_c, s.r, ship.L, 1.0, 1.0)
        unit = -0.5 * ship.rho * ship.L * ship.T * q[0]
        e.push(0.0, unit * I_Y, unit * ship.L * I_N)


EFFECT = CrossFlowDrag()
