"""The side force of a screw turning astern: Y = c Y_P, N = c N_P of `physics.propeller.side_force_astern`, and a share
of its thrust at rest that acts at the propeller, whatever the ship's speed; none ahead.

c = 1 is the right-handed screw of Esso Osaka, which throws the stern to port; a left-handed one has c < 0, and share <
0."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array, minimum
from ..physics.modifiers import Flow, Modifiers
from ..physics.propeller import side_force_astern
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class PropellerWalkAstern(Effect):
    family = "propulsion"
    summary = "side force of the propeller astern"
    phrase = "a side force of the propeller astern"
    source = "Miyauchi et al. (2022), doi 10.1007/s00773-022-00889-3: form of Hachii, values of the Esso Osaka"
    traits = Traits(persistent=True, on_card=True)
    parameters = (
        Parameter("size", "1", 1.0, -4.0, 4.0),
        Parameter("share", "1", 0.1, -0.5, 0.5, other=True, title="side force", share_of="thrust at rest"),
    )
    breaks_symmetry = True
    separate = "a propeller that turns astern while the ship is at rest"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        Y, N = side_force_astern(s.n / 60.0, s.u - e.u_c, ship.D_P, ship.L, ship.T, ship.rho)
        aside = -q[1] * ship.rho * ship.kt[0] * ship.D_P**4 * (minimum(s.n, 0.0) / 60.0) ** 2
        e.push(0.0, q[0] * Y + aside, q[0] * N + ship.x_P * aside)


EFFECT = PropellerWalkAstern()
