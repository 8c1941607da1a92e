"""A list: the heeled hull is unsymmetrical and turns away from its low side.

N = -0.008 phi rho/2 L^2 T u|u|, Y = -0.5 N/L + s rho/2 L T u|u|; heel phi positive to starboard. At rest there is no
force. s is what the side force of another hull differs by: of it little is known. No ship sails with a list of more
than 10 degrees: passengers or a turn may heel an intact ship by no more (2008 IS Code, part A, 3.1)."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..ops import Array, absolute
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter


class List(Effect):
    family = "hull"
    summary = "heel angle"
    phrase = "a list of {heel}"
    source = "docs/theory.md#hull-and-loading; IMO (2008), Intact Stability Code, part A, 3.1"
    parameters = (
        Parameter("heel", "rad", math.radians(4.0), -0.35, 0.35),
        Parameter("side_force", "1", 6e-4, -0.01, 0.01, other=True),
    )
    breaks_symmetry = True
    separate = "vary the shaft speed at one speed: a list acts with the ship's speed alone"

    def plausible(self, q: Sequence[float], ship: Particulars) -> bool:
        return super().plausible(q, ship) and abs(q[0]) <= math.radians(10.0)

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        u = s.u - e.u_c
        unit = 0.5 * ship.rho * ship.L * ship.T * u * absolute(u)
        e.push(0.0, unit * (0.004 * q[0] + q[1]), -0.008 * ship.L * unit * q[0])


EFFECT = List()
