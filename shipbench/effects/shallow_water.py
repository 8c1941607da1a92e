"""Finite water depth: hull derivatives, added masses and resistance grow with T/h (`physics.shallow_water`); zero is
deep water."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..ops import Array, maximum
from ..physics.modifiers import Flow, Modifiers
from ..physics.shallow_water import depth_factors
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class ShallowWater(Effect):
    family = "environment"
    summary = "finite water depth"
    phrase = "shallow water, where the draught is {draught_to_depth}"
    source = (
        "Taimuri et al. (2020), Ocean Eng. 218, 108103: formulas of Kijima, Ankudinov and others; "
        "docs/theory.md#environment"
    )
    traits = Traits(between_ships=True)
    parameters = (Parameter("draught_to_depth", "1", 0.6, 0.0, 0.85, title="draught", share_of="depth"),)
    known_with = ("depth",)
    separate = "the same steady turn at two depths: drift over yaw rate changes with depth and not with rudder force"

    def known(self, inputs: Mapping[str, np.ndarray], ship: Particulars) -> tuple[np.ndarray, ...]:
        """Draught over the recorded depth [m], counted from the surface."""
        return (ship.T / inputs["depth"],)

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        deep = depth_factors(ship.T / maximum(q[0], 1e-30), ship.L, ship.B, ship.T, ship.Cb)
        e.hull = e.hull * deep.hull
        e.m_y, e.J_z = e.m_y * deep.m_y, e.J_z * deep.J_z


EFFECT = ShallowWater()
