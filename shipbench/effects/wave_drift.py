"""Mean drift force of waves: along their direction, nearly independent of the ship's speed.

The components, north and east, are the amplitude squared times the direction of travel; in body axes (a_u, a_v), of
size a: X = 0.3 rho g/2 B a_u, Y = rho g/2 L a_v |a_v|/a, N = -0.1 L Y a_u/a, which turns the ship beam on."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from typing import Self

from ..ops import Array, absolute, sqrt
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter, body_axes
from .traits import Traits


class WaveDrift(Effect):
    family = "environment"
    summary = "mean drift force of waves"
    phrase = "a wave drift force towards {to}"
    source = (
        "Faltinsen et al. (1980), 13th Symp. Naval Hydrodynamics: limit of short waves, simplified as in "
        "docs/theory.md#environment"
    )
    traits = Traits(group="wind and waves")
    parameters = (
        Parameter("north", "m^2", 0.12, -8.0, 8.0, scaling="area"),
        Parameter("east", "m^2", 0.12, -8.0, 8.0, scaling="area"),
    )
    breaks_symmetry = True
    vector = ("amplitude_squared", "to")
    separate = "an anemometer or a wave buoy: wind and waves from one side have similar forces"
    ahead, moment = 0.3, -0.1

    def fitted(self, L: float) -> tuple[Self, ...]:
        """Effects with the force ahead of short waves, and five times that, as waves of the ship's length push her
        (added resistance in head waves: 3 to 10 rho g B^2/L times the amplitude squared, Faltinsen et al. 1980); and
        with the moment either way, as bow or stern are the fuller."""
        found = []
        for ahead in (self.ahead, 5.0 * self.ahead):
            for moment in (self.moment, -self.moment):
                effect = copy(self)
                effect.ahead, effect.moment = ahead, moment
                found.append(effect)
        return tuple(found)

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        a_u, a_v = body_axes(q[0], q[1], s.psi)
        size = sqrt(a_u * a_u + a_v * a_v + 1e-12)
        unit = 0.5 * ship.rho * 9.81
        Y = unit * ship.L * a_v * absolute(a_v) / size
        e.push(self.ahead * unit * ship.B * a_u, Y, self.moment * ship.L * Y * a_u / size)


EFFECT = WaveDrift()
