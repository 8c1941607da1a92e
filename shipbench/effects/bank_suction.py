"""A straight bank: suction towards it and a moment that turns the bow away, falling with distance.

Y = rho/2 L T u|u| c phi towards the bank, N = -0.2 L Y away from it, phi = (B/2)/d, d the distance from the bank (at least B/2)."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..ops import Array, absolute, cos, maximum, sin
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter


class BankSuction(Effect):
    family = "environment"
    summary = "a bank along the channel"
    source = "form of Norrbin (1974) as in physics reference, section 5, E10"
    parameters = (
        Parameter("strength", "1", 0.3, -2.0, 2.0),
        Parameter("bearing", "rad", 1.5707963, 0.0, 6.2831853, shape=True),
        Parameter("line", "m", 200.0, -1000000.0, 1000000.0, shape=True),
    )
    separate = "pass the same place at another distance and speed"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        along = s.x * cos(q[1]) + s.y * sin(q[1])
        distance = maximum(q[2] - along, 0.5 * ship.B)
        Y = 0.5 * ship.rho * ship.L * ship.T * s.u * absolute(s.u) * q[0] * 0.5 * ship.B / distance
        side = sin(q[1] - s.psi)
        e.push(0.0, Y * side, -0.2 * ship.L * Y * side)

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        """Banks on four sides, each two breadths beyond the outermost place visited."""
        bearings = [0.5 * math.pi * k for k in range(4)]
        flat = positions.reshape(-1, 2)
        return [(b, float(np.max(flat[:, 0] * math.cos(b) + flat[:, 1] * math.sin(b))) + 2.0 * ship.B) for b in bearings]


EFFECT = BankSuction()
