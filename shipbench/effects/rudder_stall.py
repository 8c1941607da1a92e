"""The rudder loses lift beyond an angle of attack: the lost share is reached 0.35 rad (20 deg) above `angle`, on a
smooth step."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits

_ORDINARY_ANGLE, _LEAST_BEYOND = 0.3, 0.7
"""Angle [rad] from which rudders ordinarily stall, and the least size of a stall that begins there
(docs/calibration.md#sizes-that-matter)."""


class RudderStall(Effect):
    family = "rudder"
    summary = "stall of the rudder at large angles"
    phrase = "a rudder that loses {lost_share} at large angles"
    source = "Brix (1993), Manoeuvring Technical Manual; docs/theory.md#rudder"
    traits = Traits(between_ships=True, absorbs_misfit=True, persistent=True, least_size=0.5, on_card=True)
    parameters = (
        Parameter("lost_share", "1", 0.5, 0.0, 0.95, title="lift loss", share_of="lift"),
        Parameter("angle", "rad", 0.3, 0.1, 0.7, shape=True),
    )
    separate = "turns at 10, 20, 30 and 35 deg of rudder"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        e.stall, e.stall_angle = q[0], q[1]

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        return [(0.1,), (0.2,), (0.35,)]

    def least_size(self, setting: Sequence[float]) -> float:
        return _LEAST_BEYOND if max(setting, default=0.0) > _ORDINARY_ANGLE else super().least_size(setting)


EFFECT = RudderStall()
