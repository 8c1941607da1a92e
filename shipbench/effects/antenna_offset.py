"""The recorded position is that of an antenna, ahead and to starboard of midship: p + R(psi) (forward, starboard). Its
velocity is midship's (a log, or an inertial unit that reckons with the lever), or the antenna's own, from the same
receiver: u - r starboard, v + r forward. Its own agree with the track, so that only the forces tell where on the ship
they belong: what is ahead or astern may pass for another hull.

It stands on the ship or near her: within three quarters of the length from midship, and within a breadth of the
centreline."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..ops import Array
from ..ship import Particulars
from ..signals import PSI, R, U, V, X, Y
from .base import Effect, Parameter, per_run

_FORM = 0.08
"""Lengths by which the forces of a hull act elsewhere than those of a fitted one
(docs/calibration.md#sizes-that-matter)."""


class AntennaOffset(Effect):
    family = "sensor"
    summary = "lever arm of the position sensor, its velocities midship's or its own"
    phrase = "a position antenna {forward} forward and {starboard} to starboard of midship"
    source = "docs/theory.md#sensors"
    parameters = (
        Parameter("forward", "m", 12.0, -80.0, 80.0, scaling="length"),
        Parameter("starboard", "m", 12.0, -40.0, 40.0, scaling="length"),
        Parameter("own_velocities", "1", 0.0, 0.0, 1.0, shape=True, other=True),
    )
    separate = "a turn on the spot: the antenna draws a circle"

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        out = S.copy()
        forward, starboard, own = (per_run(value) for value in q)
        c, s, r = np.cos(S[..., PSI]), np.sin(S[..., PSI]), own * S[..., R]
        out[..., X] += forward * c - starboard * s
        out[..., Y] += forward * s + starboard * c
        out[..., U] -= r * starboard
        out[..., V] += r * forward
        return out

    def plausible(self, q: Sequence[float], ship: Particulars) -> bool:
        return super().plausible(q, ship) and abs(q[0]) < 0.75 * ship.L and abs(q[1]) < ship.B

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        return [(0.0,), (1.0,)]

    def form_spread(self, setting: Sequence[float], L: float) -> tuple[float, ...]:
        """Standard deviation of the antenna's place by the form of the hull: the antenna's own velocities agree with
        the track, so that only the forces identify how far ahead it is."""
        return (_FORM * L if any(setting) else 0.0, 0.0)

    def correction(self, values: Mapping[str, float]) -> str:
        """Line with the antenna's place, where the velocities are midship's."""
        return "" if values.get("own_velocities") else f"antenna = [{values['forward']:.3g}, {values['starboard']:.3g}]"


EFFECT = AntennaOffset()
