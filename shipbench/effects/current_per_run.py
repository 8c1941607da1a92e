"""A uniform current that is steady within a run and differs from run to run; signs as in `current`."""

from __future__ import annotations

from collections.abc import Sequence

from ..ops import Array
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter, body_axes
from .traits import Traits


class CurrentPerRun(Effect):
    family = "environment"
    summary = "uniform current, another one in each run"
    phrase = "a current that differs from run to run"
    source = "Fossen (2021), section 10.3"
    traits = Traits(least_size=0.15)
    parameters = (
        Parameter("north", "m/s", 0.3, -6.0, 6.0, scaling="speed"),
        Parameter("east", "m/s", 0.3, -6.0, 6.0, scaling="speed"),
    )
    breaks_symmetry = True
    moves_flow = True
    per_run = True
    vector = ("speed", "to")
    separate = "straight runs on reciprocal courses within one run"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        u_c, v_c = body_axes(q[0], q[1], s.psi)
        e.u_c, e.v_c = e.u_c + u_c, e.v_c + v_c


EFFECT = CurrentPerRun()
