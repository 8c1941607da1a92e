"""A uniform, steady current: the water moves over the ground, and the hull, propeller and rudder see the velocity
through it.

The components, north and east, say where it flows to; u_c = north cos(psi) + east sin(psi), v_c = east cos(psi) - north
sin(psi)."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter, body_axes
from .traits import Traits


class Current(Effect):
    family = "environment"
    summary = "uniform current, the same in all runs"
    phrase = "a current of {speed} towards {to}"
    source = "Fossen (2021), section 10.3; added masses act on the velocity through the water"
    traits = Traits(imitates=("bank_suction",), on_card=True)
    parameters = (
        Parameter("north", "m/s", 0.3, -6.0, 6.0, scaling="speed"),
        Parameter("east", "m/s", 0.3, -6.0, 6.0, scaling="speed"),
    )
    breaks_symmetry = True
    moves_flow = True
    vector = ("speed", "to")
    separate = "straight runs on reciprocal courses at two speeds, or a full turn"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        u_c, v_c = body_axes(q[0], q[1], s.psi)
        e.u_c, e.v_c = e.u_c + u_c, e.v_c + v_c


EFFECT = Current()
