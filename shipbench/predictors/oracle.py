"""Ceiling for simulated data: the simulator itself, started from the recorded s0 (it does not know hidden gusts or the
noise in s0).

Source: Yasukawa and Yoshimura (2015), Introduction of MMG standard method for ship maneuvering predictions, J. Mar.
Sci. Technol. 20.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..errors import InputError
from ..physics.mmg import load_mmg_ship
from ..records import Dataset
from ..signals import COMMANDS
from ..simulate.simulator import Simulator
from ._saved import sample_time
from .base import History, PredictorBase


@dataclass
class Oracle(PredictorBase):
    """The simulator that made the data."""

    name: ClassVar[str] = "oracle"
    seeded: ClassVar[bool] = False
    learns: ClassVar[bool] = False

    def skip(self, dataset: Dataset) -> str | None:
        """Reason why this model cannot take `dataset`, or None."""
        return None if dataset.simulation else f"data set '{dataset.name}' was not made by this simulator"

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return hasattr(self, "_simulator")

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Read from the data which simulated ship made them; nothing else is learned.

        Raises:
            InputError: the data were not simulated.
        """
        if train.simulation is None:
            raise InputError(
                f"oracle: data set '{train.name}' has no 'simulation' entry; the oracle needs data of shipbench's "
                "own simulator."
            )
        self._set(train.simulation, train.dt, train.inputs)
        return self

    def _set(self, ship: str, dt: float, inputs: tuple[str, ...]) -> None:
        self.ship, self.dt, self.inputs = ship, dt, inputs
        self._simulator = Simulator(load_mmg_ship(ship))

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        return self._simulator.fast_rollout(s0, U[..., : len(COMMANDS)], self.dt)

    def _meta(self) -> dict[str, Any]:
        return {"ship": self.ship, "dt": self.dt}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        self._set(meta["ship"], sample_time(meta), self.inputs)


PREDICTOR = Oracle
