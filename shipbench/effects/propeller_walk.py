"""A side force of the turning propeller, in proportion to its thrust ahead: Y = c (1 - t_P) T, N = x_P Y, none astern.

c > 0 pushes the stern to starboard (bow to port), as a right-handed screw does."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array, maximum
from ..physics.modifiers import Flow, Modifiers
from ..physics.propeller import thrust_quadratic
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class PropellerWalk(Effect):
    family = "propulsion"
    summary = "side force of the propeller ahead"
    phrase = "a side force of the propeller ahead of {share}"
    source = "p0 in eq. (6) of the source paper; docs/theory.md#propulsion"
    traits = Traits(persistent=True, in_place_of=(0,))
    parameters = (Parameter("share", "1", 0.05, -0.3, 0.3, title="side force", share_of="thrust"),)
    breaks_symmetry = True
    separate = "straight runs at one speed with the shaft speed up and down"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        V_A = (1.0 - ship.w_P0) * maximum(s.u - e.u_c, 0.0)
        thrust = thrust_quadratic(maximum(s.n, 0.0) / 60.0, V_A, ship.D_P, ship.kt, ship.rho)
        Y = q[0] * (1.0 - ship.t_P) * maximum(thrust, 0.0)
        e.push(0.0, Y, ship.x_P * Y)


EFFECT = PropellerWalk()
