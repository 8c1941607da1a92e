"""Floor: the ship keeps the surge, sway and yaw rate (and actuators) that it has at the start, whatever is commanded.

Source: kinematics of a rigid body with constant speeds.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..records import Dataset
from ..signals import MOTION, PSI, X, Y
from ._saved import sample_time
from .base import History, PredictorBase


@dataclass
class Hold(PredictorBase):
    """Constant u, v, r: the pose follows a circle (a straight line for r = 0), in closed form."""

    name: ClassVar[str] = "hold"
    seeded: ClassVar[bool] = False
    learns: ClassVar[bool] = False

    def __post_init__(self) -> None:
        self.dt = float("nan")

    @classmethod
    def at(cls, dt: float) -> Self:
        """Predictor for runs sampled at `dt` [s]."""
        model = cls()
        model.dt = dt
        return model

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return not np.isnan(self.dt)

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Store the sample time and the list of inputs; nothing else is learned."""
        self.dt, self.inputs = train.dt, train.inputs
        return self

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        t = self.dt * np.arange(1, U.shape[1] + 1)
        S = np.repeat(s0[:, None, :], len(t), axis=1)
        _, _, psi, u, v, r = np.moveaxis(s0[:, MOTION, None], 1, 0)
        turned = r * t
        # Integral of the turned body velocity, from s0's axes: (sin a / a, (1 - cos a) / a) t without the division at a
        # = 0.
        along, across = t * np.sinc(turned / np.pi), t * np.sin(turned / 2) * np.sinc(turned / (2 * np.pi))
        ahead, starboard = u * along - v * across, u * across + v * along
        S[..., X] += ahead * np.cos(psi) - starboard * np.sin(psi)
        S[..., Y] += ahead * np.sin(psi) + starboard * np.cos(psi)
        S[..., PSI] += turned
        return S

    def _meta(self) -> dict[str, Any]:
        return {"dt": self.dt}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        self.dt = sample_time(meta)


PREDICTOR = Hold
