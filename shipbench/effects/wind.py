"""A mean wind that is not measured; the components say where it comes from, as the signal `wind_from` does."""

from __future__ import annotations

from collections.abc import Sequence
from copy import copy
from dataclasses import replace
from typing import Self

from ..ops import Array, sqrt
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter, body_axes
from .traits import Traits


class Wind(Effect):
    family = "environment"
    summary = "mean wind, the same in all runs"
    phrase = "a wind of {speed} from {from}"
    source = (
        "Blendermann (1994), J. Wind Eng. Ind. Aerodyn. 51: lowest harmonics in the fitted model; "
        "docs/theory.md#environment"
    )
    traits = Traits(
        group="wind and waves",
        imitates=("bank_suction",),
        relies_on=("wind_X", "wind_Y", "wind_N", "wind_lever"),
        on_card=True,
    )
    parameters = (
        Parameter("north", "m/s", 7.0, -60.0, 60.0, scaling="speed"),
        Parameter("east", "m/s", 7.0, -60.0, 60.0, scaling="speed"),
    )
    breaks_symmetry = True
    moves_flow = True
    vector = ("speed", "from")
    known_with = ("wind_speed", "wind_from")
    separate = (
        "the same manoeuvre at two speeds and on reciprocal courses: wind forces do not grow with the ship's speed"
    )
    stretch: tuple[float, float] | None = None
    moment: float = 1.0

    def fitted(self, L: float) -> tuple[Self, ...]:
        """Components a = W (W + W_0)/(W_t + W_0) of a wind W, W_t the typical one, W_0 a ship's ordinary speed: its
        forces grow with them, while the square of a weak wind has no slope that a fit could follow. Once for each of
        three moments: that of an unknown superstructure may be a fraction of the formula's or twice as large (the
        spread between types of ship: Blendermann 1994)."""
        found = []
        for moment in (0.3, 1.0, 2.0):
            effect = copy(self)
            effect.stretch, effect.moment = (self.sized(L)[0].typical, 0.1 * (9.81 * L) ** 0.5), moment
            found.append(effect)
        return tuple(found)

    def sized(self, L: float) -> tuple[Parameter, ...]:
        """Parameters of the fitted components, with the bounds of a wind along one of them."""
        plain = super().sized(L)
        if self.stretch is None:
            return plain
        typical, speed = self.stretch
        factors = [(p.high + speed) / (typical + speed) for p in plain]
        return tuple(
            replace(p, low=factor * p.low, high=factor * p.high) for p, factor in zip(plain, factors, strict=True)
        )

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        air_u, air_v = body_axes(*self._wind(q), s.psi)
        e.air_u, e.air_v, e.wind_N = e.air_u - air_u, e.air_v - air_v, e.wind_N * self.moment

    def public(self, q: Sequence[float]) -> dict[str, float]:
        return super().public([float(v) for v in self._wind(q)])

    def _wind(self, q: Sequence[Array]) -> tuple[Array, Array]:
        """North and east component of the wind [m/s]."""
        north, east = q
        if self.stretch is None:
            return north, east
        typical, speed = self.stretch
        size = sqrt(north * north + east * east + (1e-6 * typical) ** 2)
        share = (sqrt(0.25 * speed * speed + size * (typical + speed)) - 0.5 * speed) / size
        return north * share, east * share


EFFECT = Wind()
