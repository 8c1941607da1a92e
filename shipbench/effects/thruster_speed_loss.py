"""The thrusters lose force at forward speed: moment times 1 - loss q exp(1 - q), force with 0.6 of the loss, q = (u/2.1
m/s)^2, and both times 1 - fading (1 - exp(-|u| / (0.1 sqrt(g L)))), which does not come back at higher speed.

The worst speed is that of the ship's own tunnels (`physics.thruster`)."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..physics.thruster import fading
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class ThrusterSpeedLoss(Effect):
    family = "thruster"
    summary = "loss of thruster force at speed"
    phrase = "thrusters that lose force at speed"
    source = (
        "Int. Shipbuilding Progress (1967), doi 10.3233/ISP-1967-1415601, and k = exp(-|u|/u_0); "
        "docs/theory.md#thrusters"
    )
    traits = Traits(between_ships=True, ordinary=(0.25, 0.12))
    parameters = (Parameter("loss", "1", 0.5, -0.5, 1.2), Parameter("fading", "1", 0.5, -0.2, 1.2, other=True))
    separate = "thruster pushes at 0, 1 and 2 m/s"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        left = 1.0 - q[1] * fading(s.u - e.u_c, ship.L)
        e.loss, e.bow, e.stern = e.loss + q[0], e.bow * left, e.stern * left


EFFECT = ThrusterSpeedLoss()
