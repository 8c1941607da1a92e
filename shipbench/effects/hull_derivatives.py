"""The hull derivatives and added masses of the published regressions do not fit this ship: each times 1 + its value."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class HullDerivatives(Effect):
    family = "hull"
    summary = "hull derivatives that differ from the regressions"
    phrase = "the ship's own coefficients"
    source = (
        "Clarke, Gedling & Hine (1983): scatter of measured derivatives about the regressions; "
        "docs/theory.md#coefficients-of-the-left-side"
    )
    traits = Traits(search="hull")
    parameters = (
        Parameter("Y_v", "1", 0.25, -0.9, 3.0, title="sway damping", relative=True),
        Parameter("Y_r", "1", 0.25, -0.9, 3.0, title="sway force due to yaw rate", relative=True),
        Parameter("N_v", "1", 0.25, -0.9, 3.0, title="yaw moment due to sway", relative=True),
        Parameter("N_r", "1", 0.25, -0.9, 3.0, title="yaw damping", relative=True),
        Parameter("Y_nonlinear", "1", 0.25, -0.9, 3.0, title="nonlinear sway force", relative=True),
        Parameter("N_nonlinear", "1", 0.25, -0.9, 3.0, title="nonlinear yaw moment", relative=True),
        Parameter("X_nonlinear", "1", 0.25, -0.9, 3.0, title="nonlinear surge force", relative=True),
        Parameter("m_y", "1", 0.25, -0.9, 3.0, title="added mass in sway", relative=True),
        Parameter("J_z", "1", 0.25, -0.9, 3.0, title="added moment of inertia in yaw", relative=True),
    )
    separate = "steady turns and zig-zags at several rudder angles"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        names = ("Y_v", "Y_r", "N_v", "N_r", "Y_nonlinear", "N_nonlinear", "X_nonlinear")
        e.scale_hull(**{k: 1.0 + v for k, v in zip(names, q[:7], strict=True)})
        e.m_y, e.J_z = e.m_y * (1.0 + q[7]), e.J_z * (1.0 + q[8])


EFFECT = HullDerivatives()
