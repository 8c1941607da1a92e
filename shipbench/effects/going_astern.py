"""The hull going astern, and a reversed propeller's thrust and wake, which derivatives for motion ahead do not know.

N_v and Y_r change sign when the ship goes astern (the moment that destabilises her then turns about the other end).
They are taken times 1 - 2 q b, where b goes from 0 ahead over 1/2 across to 1 astern: q = 1 is theory.
The thrust of a reversed propeller has `thrust` times the J-term that the plain formula drops, for J within 1/2 of rest.
"""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array, clip, minimum, sqrt
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class GoingAstern(Effect):
    family = "hull"
    summary = "hull, thrust and rudder while going astern"
    phrase = "forces astern that differ from the model"
    source = (
        "Yoshimura, Nakao & Ishibashi (2009): v u and r u in place of v U and r U; Miyauchi et al. (2022): "
        "flow at the rudder"
    )
    traits = Traits(search="never")
    parameters = (
        Parameter("N_v", "1", 0.5, -0.5, 2.0),
        Parameter("Y_r", "1", 0.5, -2.0, 4.0),
        Parameter("thrust", "1", 0.5, -2.0, 3.0),
        Parameter("backing", "1", 0.5, 0.0, 1.0),
    )
    separate = "going astern with the wheel to both sides, and stopping with headway"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        u, v = s.u - e.u_c, s.v - e.v_c
        astern = 0.5 - 0.5 * u / sqrt(u * u + v * v + (0.05 * (0.01 * ship.L) ** 0.5) ** 2)
        e.scale_hull(N_v=1.0 - 2.0 * q[0] * astern, Y_r=1.0 - 2.0 * q[1] * astern)
        tip = minimum(s.n, 0.0) / 60.0 * ship.D_P
        e.push((1.0 - ship.t_P) * q[2] * ship.kt[1] * -ship.rho * ship.D_P**2 * tip * clip(u, 0.5 * tip, -0.5 * tip))
        e.backing = e.backing + q[3]


EFFECT = GoingAstern()
