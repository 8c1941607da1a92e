"""A barge made fast to starboard: it is dragged along, and it turns the ship towards its side."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from shipbench.effects.base import Effect, Parameter


class BargeAlongside(Effect):
    # The effect's name is that of this file. Values are zero where there is no barge.
    family = "hull"
    summary = "a barge made fast to starboard"
    source = "drag of a bluff body; lever of 0.75 B"
    # name, unit, typical size, lowest and highest value, all for a ship of 130 m
    parameters = (Parameter("drag", "1", 0.05, -0.1, 0.2),)
    separate = "turns to both sides at several speeds"

    def force(self, e: Any, s: Any, q: Sequence[Any], ship: Any) -> None:
        """Drag coefficient q[0] on rho/2 L T, at the speed through the water. `e` collects forces, `s` is the motion at
        an instant.

        Plain arithmetic only (and the functions of shipbench.ops): the same lines run on numpy, torch and casadi.
        """
        u = s.u - e.u_c
        speed = (u * u + 1e-6) ** 0.5  # smooth |u|, for casadi's derivatives
        drag = 0.5 * ship.rho * ship.L * ship.T * q[0] * u * speed
        e.push(X=-drag, N=0.75 * ship.B * drag)  # N = x Y - y X with y = 0.75 B to starboard


EFFECT = BargeAlongside()
