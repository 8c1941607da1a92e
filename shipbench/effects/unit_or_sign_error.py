"""One recorded channel is in another unit or has the other sign: recorded = (1 + change) times true, for every sample.

The amplitude is the factor less one, so that zero means nothing, as everywhere; it is reported as the factor. `channel`
is an index of `signals.STATES`, or its name where values are given by name. Two channels in a wrong unit (u and v in
knots) are two such effects.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np

from ..errors import InputError, unknown_parameter
from ..ops import Array
from ..ship import Particulars
from ..signals import STATES
from .base import Effect, Parameter
from .traits import Traits

KNOT = 1852.0 / 3600.0
"""Metres per second in one knot [m/s]."""

_ANGLE = {"degrees": math.degrees(1.0)}
_SPEED = {"knots": 1.0 / KNOT, "km/h": 3.6}
_FORCE = {"kN": 1e-3}
_RATE = {"degrees per second": math.degrees(1.0), "degrees per minute": 60.0 * math.degrees(1.0)}
_SHAFT = {"rev/s": 1.0 / 60.0, "rad/s": 2.0 * math.pi / 60.0}
FACTORS: dict[str, dict[str, float]] = {
    "psi": _ANGLE, "u": _SPEED, "v": _SPEED, "r": _RATE, "n": _SHAFT, "delta": _ANGLE, "F_b": _FORCE, "F_s": _FORCE,
}  # fmt: skip
"""Units in records other than the standard one, per state: recorded over standard number."""


class UnitOrSignError(Effect):
    family = "sensor"
    summary = "a channel recorded in another unit or with the other sign"
    phrase = "a channel with another unit or sign"
    source = "docs/theory.md#sensors"
    traits = Traits(search="units", describes_data=True)
    parameters = (
        Parameter("factor", "1", -2.0, -4000.0, 4000.0),
        Parameter("channel", "1", float(STATES.index("r")), 0.0, 9.0, shape=True),
    )
    separate = (
        "none needed: heading against yaw rate, track against speeds, rudder against turning show it in any record"
    )

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        this = np.arange(len(STATES)) == np.asarray(q[1], dtype=float)[..., None]
        factor = 1.0 + np.asarray(q[0], dtype=float)[..., None] * this
        return S * (factor if factor.ndim == 1 else factor[:, None, :])

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        return [(float(i),) for i in range(len(STATES))]

    def public(self, q: Sequence[float]) -> dict[str, float]:
        return {"factor": 1.0 + float(q[0]), "channel": float(q[1])}

    def internal(self, values: Mapping[str, float | str]) -> tuple[float, ...]:
        """Values `q` from `factor` (recorded over true) and `channel` (index or name of a state).

        Raises:
            InputError: a name is unknown, the factor or the channel is missing, or the channel is no state.
        """
        for key in values:
            if key not in ("factor", "channel"):
                raise unknown_parameter(f"effect '{self.name}'", key, ("factor", "channel"))
        if "factor" not in values or "channel" not in values:
            raise InputError(
                f"effect '{self.name}': got {', '.join(values) or 'nothing'}; both factor and channel are needed."
            )
        channel = values["channel"]
        if channel in STATES:
            channel = STATES.index(str(channel))
        if channel not in range(len(STATES)):
            raise InputError(
                f"effect '{self.name}': channel = {channel}; accepted: 0 to {len(STATES) - 1}, or one of "
                f"{', '.join(STATES)}."
            )
        return float(values["factor"]) - 1.0, float(channel)

    def describe(self, q: Sequence[float]) -> str:
        """Words such as "delta recorded in degrees" or "r recorded with the other sign"."""
        channel = STATES[round(q[1])]
        return f"{channel} recorded {in_words(channel, 1.0 + float(q[0]))}"


def in_words(channel: str, factor: float) -> str:
    """Meaning of a factor: "in degrees", "with the other sign", "in knots, with the other sign", or the number."""
    parts = [] if abs(factor) == 1.0 else [_unit(channel, abs(factor))]
    if factor < 0.0:
        parts.append("with the other sign")
    return ", ".join(parts) or "as it should be"


def _unit(channel: str, size: float) -> str:
    for unit, factor in FACTORS.get(channel, {}).items():
        if abs(math.log(max(size, 1e-12) / factor)) < 0.02:
            return f"in {unit}"
    return f"{size:.4g} times too large"


EFFECT = UnitOrSignError()
