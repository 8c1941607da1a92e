"""A straight bank: suction towards it, and a moment that turns the leading end away, falling with distance.

The bank is the line x cos(bearing) + y sin(bearing) = line; d is the distance from it (at least B/2), phi = (B/2)/d, s = sin(bearing - psi) its side
(1: to starboard). Y = rho/2 L T u^2 c phi s, N = -0.2 L rho/2 L T u|u| c phi s: the pressure falls with the square of the speed either way,
the bow wave stands at the leading end."""

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
        Parameter("bearing", "rad", 0.5 * math.pi, 0.0, 2.0 * math.pi, shape=True),
        Parameter("line", "m", 200.0, -1e6, 1e6, scaling="length", shape=True),
    )
    breaks_symmetry = True
    separate = "pass the same place at another distance and speed"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        along = s.x * cos(q[1]) + s.y * sin(q[1])
        distance = maximum(q[2] - along, 0.5 * ship.B)
        unit = 0.5 * ship.rho * ship.L * ship.T * q[0] * (0.5 * ship.B / distance) * sin(q[1] - s.psi)
        u = s.u - e.u_c
        e.push(0.0, unit * u * u, -0.2 * ship.L * unit * u * absolute(u))

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        """Banks on four sides, along and across the direction in which the places visited lie, each two breadths beyond the outermost of them."""
        flat = positions.reshape(-1, 2)
        flat = flat[np.isfinite(flat).all(axis=1)]
        along = np.linalg.eigh(np.cov(flat, rowvar=False))[1][:, 1]
        bearings = [(math.atan2(along[1], along[0]) + 0.5 * math.pi * k) % (2.0 * math.pi) for k in range(4)]
        return [(b, float(np.max(flat[:, 0] * math.cos(b) + flat[:, 1] * math.sin(b))) + 2.0 * ship.B) for b in bearings]


EFFECT = BankSuction()
