"""The wake at the propeller falls while the ship drifts and turns: w = w_P0 - c (1 - w_P0)(1 - exp(-2|beta_P|)).

beta_P = atan2(-(v + x_P r), u); 0.1 m/s (at 130 m) is added to u, and u held at or above zero, so that it stays smooth
at rest."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array, absolute, arctan2, exp, maximum
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class WakeVariation(Effect):
    family = "propulsion"
    summary = "wake fraction in turns"
    phrase = "a wake fraction that changes in turns"
    source = "Yasukawa & Yoshimura (2015), eq. 24"
    traits = Traits(between_ships=True, persistent=True, ordinary=(0.35, 0.12))
    parameters = (Parameter("size", "1", 0.6, -1.0, 2.0),)
    separate = "the same turn with the shaft stopped"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        beta_P = arctan2(-(s.v - e.v_c + ship.x_P * s.r), maximum(s.u - e.u_c, 0.0) + 0.1 * (ship.L / 130.0) ** 0.5)
        e.wake = e.wake - q[0] * (1.0 - ship.w_P0) * (1.0 - exp(-2.0 * absolute(beta_P)))


EFFECT = WakeVariation()
