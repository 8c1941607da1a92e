"""Nomoto's first-order steering model with a first-order surge, found by linear least squares."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from shipbench import Dataset, PredictorBase


@dataclass  # its fields are the parameters of the spec: nomoto[by_speed=false]
class Nomoto(PredictorBase):
    """T dr/dt + r = K delta, after Nomoto et al. (1957); du/dt is linear in u and n; v follows r.

    Args:
        by_speed: the rudder's moment grows with the speed ahead (K u in place of K).
    """

    name: ClassVar[str] = "nomoto"  # the entry point's name: a saved model is found again by it
    seeded: ClassVar[bool] = False  # nothing is drawn, so that one seed is enough
    by_speed: bool = True

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Least squares on the change from each sample to the next."""
        data = train.merged(valid)  # nothing here stops early, so that the validation runs are data too
        self.inputs, self.dt = data.inputs, data.dt
        before = np.concatenate([run.states[:-1] for run in data.runs])
        after = np.concatenate([run.states[1:] for run in data.runs])
        command = np.concatenate([run.inputs[:-1, :4] for run in data.runs])
        change = (after - before) / self.dt
        v, r = before[:, 4], before[:, 5]
        self.yaw = np.linalg.lstsq(self._yaw_terms(before), change[:, 5], rcond=None)[0]
        self.surge = np.linalg.lstsq(self._surge_terms(before), change[:, 3], rcond=None)[0]
        self.drift = np.array([(v * r).sum() / max((r * r).sum(), 1e-12)])
        # Share of the way to its command that each actuator goes in one sample; an actuator that never moves goes all
        # the way.
        gap, moved = command - before[:, 6:], after[:, 6:] - before[:, 6:]
        size = (gap * gap).sum(axis=0)
        self.follow = np.clip(
            np.where(size > 0, (gap * moved).sum(axis=0) / np.where(size > 0, size, 1.0), 1.0), 0.0, 1.0
        )
        return self

    def _yaw_terms(self, S: np.ndarray) -> np.ndarray:
        """r and delta (or u delta), (samples, 2)."""
        return np.stack([S[:, 5], S[:, 7] * (S[:, 3] if self.by_speed else 1.0)], axis=1)

    def _surge_terms(self, S: np.ndarray) -> np.ndarray:
        """1, u and n, (samples, 3)."""
        return np.stack([np.ones(len(S)), S[:, 3], S[:, 6]], axis=1)

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: Any) -> np.ndarray:
        """s0 (batch, 10), U (batch, K, inputs) -> S (batch, K, 10); S[:, k] is the state at the end of step k, s0 is
        not in it."""
        S, now = np.empty((*U.shape[:2], 10)), s0
        for k in range(U.shape[1]):
            after = now.copy()
            after[:, 3] += self.dt * (self._surge_terms(now) * self.surge).sum(axis=1)
            after[:, 5] += self.dt * (self._yaw_terms(now) * self.yaw).sum(axis=1)
            after[:, 4] = self.drift * after[:, 5]
            after[:, 6:] += self.follow * (U[:, k, :4] - now[:, 6:])
            psi = now[:, 2] + 0.5 * self.dt * now[:, 5]  # x is north, y east, psi clockwise from north
            after[:, 0] += self.dt * (now[:, 3] * np.cos(psi) - now[:, 4] * np.sin(psi))
            after[:, 1] += self.dt * (now[:, 3] * np.sin(psi) + now[:, 4] * np.cos(psi))
            after[:, 2] += self.dt * now[:, 5]
            S[:, k] = now = after
        return S

    def describe(self) -> str:
        """Kept beside the predictions of a study."""
        return f"dr/dt = {self.yaw[0]:.4g} r + {self.yaw[1]:.4g} {'u ' if self.by_speed else ''}delta"

    # What `save` writes and `load` takes back: plain arrays and JSON, never a pickle.
    def _arrays(self) -> dict[str, np.ndarray]:
        return {"yaw": self.yaw, "surge": self.surge, "drift": self.drift, "follow": self.follow}

    def _meta(self) -> dict[str, Any]:
        return {"dt": self.dt}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        self.dt = float(meta["dt"])
        for name, array in arrays.items():
            setattr(self, name, array)
