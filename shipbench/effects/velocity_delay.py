"""The recorded surge and sway velocities are old (a slow filter acts alike): u and v at t - delay, in the ship's axes
or in the earth's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..ops import Array
from ..ship import Particulars
from ..signals import PSI, U, V
from .base import Effect, Parameter, body_axes, delayed, per_run
from .traits import Traits


class VelocityDelay(Effect):
    family = "sensor"
    late = True
    summary = "latency of the velocities"
    phrase = "velocities that are {delay} late"
    source = "docs/theory.md#sensors"
    traits = Traits(faults_of=frozenset({"u", "v"}))
    parameters = (
        Parameter("delay", "s", 2.0, -10.0, 10.0, scaling="time"),
        Parameter("earth_axes", "1", 0.0, 0.0, 1.0, shape=True),
    )
    separate = "changes of speed and quick turns"

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        """Measurement late as a vector in the ship's axes (a speed log), or in the earth's (from positions), then
        rotated by the current heading."""
        body = delayed(S, (U, V), q[0], dt)
        if not np.any(q[1]):
            return body
        psi, out = S[..., PSI], S.copy()
        out[..., U], out[..., V] = body_axes(S[..., U], S[..., V], -psi)
        out = delayed(out, (U, V), q[0], dt)
        out[..., U], out[..., V] = body_axes(out[..., U], out[..., V], psi)
        earth = per_run(q[1]) > 0.5
        return np.where(np.broadcast_to(earth, psi.shape)[..., None], out, body)

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        return [(0.0,), (1.0,)]

    def correction(self, values: Mapping[str, float]) -> str:
        late = f"{values['delay']:.3g}"
        return f"[delay] velocity = {late}" if values.get("earth_axes") else f"[delay] u = {late} and v = {late}"


EFFECT = VelocityDelay()
