"""Sensitivities of the predicted record, and the change of the motion's sensitivities with the same causes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .rollout import Active

ASIDE, AWAY = (2, 3, 4, 5), 0.01
"""States (heading, velocities) for second derivatives of the motion, and the step in units of the scales."""


@dataclass(frozen=True)
class Columns:
    """Sensitivities about a point, T = 6 (K + 1) rows with the channel last.

    Shapes: latent (B, T, 6 + 3 knots) of [eta, w]; base (B, T, NUM_BASE); one (B, T, size) per term of the point
    (`own`) and one per candidate; predicted (B, K + 1, 6).
    """

    predicted: np.ndarray
    latent: np.ndarray
    base: np.ndarray
    own: tuple[np.ndarray, ...]
    candidates: tuple[np.ndarray, ...]
    bends: tuple[Bend, ...]

    @property
    def eta(self) -> np.ndarray:
        """Sensitivities (B, T, 6) to the initial states."""
        return self.latent[..., :6]

    @property
    def w(self) -> np.ndarray:
        """Sensitivities (B, T, 3 knots) to the latent force."""
        return self.latent[..., 6:]


@dataclass(frozen=True)
class Bend:
    """Change of the motion's sensitivities with columns of base, own terms or candidates.

    Through forces: `rates` (size, K, B, 3), the change of the acceleration in the middle of every step beside the
    trajectory (`Linearisation.aside`) less that on it. Through sensors: `sensors`, their readings when each state is
    moved by `unit`, or None where that changes nothing.
    """

    rates: np.ndarray | None
    sensors: tuple[tuple[Active, ...] | None, ...] = ()
    unit: float = 1.0
