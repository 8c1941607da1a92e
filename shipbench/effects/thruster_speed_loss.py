"""The thrusters lose force at forward speed: moment times 1 - loss q exp(1 - q), force with 0.6 of the loss, q = (u/2.1 m/s)^2.

The worst speed is that of the ship's own tunnels (`physics.thruster`)."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter


class ThrusterSpeedLoss(Effect):
    family = "thruster"
    summary = "loss of thruster force at speed"
    source = "shape after Int. Shipbuild. Progress 1967 (physics reference, section 5, T41)"
    parameters = (Parameter("loss", "1", 0.5, -0.5, 1.2),)
    separate = "thruster pushes at 0, 1 and 2 m/s"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.loss = e.loss + q[0]


EFFECT = ThrusterSpeedLoss()
