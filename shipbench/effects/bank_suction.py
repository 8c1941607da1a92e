"""A straight bank, or those of a channel: suction towards it, and a moment that turns the leading end away, falling
with distance.

The bank is the line x cos(bearing) + y sin(bearing) = line; d is the distance from it (at least B/2), phi = (B/2)/d,
less (B/2)/d of the opposite bank where there is a `channel` of such a breadth (0: no other bank), s = sin(bearing -
psi) its side (1: to starboard). Y = rho/2 L T u^2 c phi s, N = -L rho/2 L T u|u| (0.2 c + moment) phi s: the pressure
falls with the square of the speed either way, the bow wave stands at the leading end."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..ops import Array, absolute, cos, maximum, sin, smoothstep
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .base import Effect, Parameter
from .traits import Traits


class BankSuction(Effect):
    family = "environment"
    summary = "a bank along the channel"
    phrase = "suction towards a bank"
    source = "Norrbin (1974), 10th Symp. Naval Hydrodynamics; docs/theory.md#environment"
    traits = Traits(local=True, between_ships=True, persistent=True, by_coefficients=True)
    parameters = (
        Parameter("strength", "1", 0.3, -2.0, 2.0),
        Parameter("moment", "1", 0.06, -0.4, 0.4, other=True),
        Parameter("bearing", "rad", 0.5 * math.pi, 0.0, 2.0 * math.pi, shape=True),
        Parameter("line", "m", 200.0, -1e6, 1e6, scaling="length", shape=True),
        Parameter("channel", "m", 0.0, 0.0, 1e6, scaling="length", shape=True),
    )
    breaks_symmetry = True
    separate = "pass the same place at another distance and speed"

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        c, moment, bearing, line, channel = q
        distance, least = line - s.x * cos(bearing) - s.y * sin(bearing), 0.5 * ship.B
        phi = least / maximum(distance, least) - smoothstep(channel, 0.0, 1.0) * least / maximum(
            channel - distance, least
        )
        unit = 0.5 * ship.rho * ship.L * ship.T * phi * sin(bearing - s.psi)
        u = s.u - e.u_c
        e.push(0.0, unit * c * u * u, -(0.2 * c + moment) * ship.L * unit * u * absolute(u))

    def normal(self, setting: Sequence[float]) -> float | None:
        """Bearing of the bank."""
        return setting[0]

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        """Banks on four sides, along and across the direction in which the places visited lie, each two breadths beyond
        the outermost of them, and the two along it together, each one or two breadths away."""
        flat = positions.reshape(-1, 2)
        flat = flat[np.isfinite(flat).all(axis=1)]
        along = np.linalg.eigh(np.cov(flat, rowvar=False))[1][:, 1]
        bearings = [(math.atan2(along[1], along[0]) + 0.5 * math.pi * k) % (2.0 * math.pi) for k in range(4)]
        lines = [float(np.max(flat[:, 0] * math.cos(b) + flat[:, 1] * math.sin(b))) + 2.0 * ship.B for b in bearings]
        found: list[tuple[float, ...]] = [(b, line, 0.0) for b, line in zip(bearings, lines, strict=True)]
        nearer = ((0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0))
        return found + [(bearings[1], lines[1] - i * ship.B, lines[1] + lines[3] - (i + j) * ship.B) for i, j in nearer]


EFFECT = BankSuction()
