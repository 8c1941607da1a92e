"""Another mass than the ship file says (loading): mass and moment of inertia times 1 + share, added masses as they
were."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class MassChange(Effect):
    family = "hull"
    summary = "mass of the ship"
    phrase = "a mass that is {share}"
    source = "docs/theory.md#equations-of-motion"
    traits = Traits(between_ships=True, absorbs_misfit=True, aliases=("thrust_gain",))
    parameters = (Parameter("share", "1", 0.15, -0.5, 1.0, title="mass", relative=True),)
    separate = "pushes of a force of known size: thrusters, a bollard"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.mass = e.mass * (1.0 + q[0])


EFFECT = MassChange()
