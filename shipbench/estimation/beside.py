"""Runs beside a simulation: what it adds to the physics nearest to it, as known accelerations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..records import Dataset

PUSHES = ("push_u", "push_v", "push_r")
"""Channels of a known acceleration [m/s^2, m/s^2, rad/s^2] that acts beside the physics, held over a sample."""


@dataclass(frozen=True, eq=False)
class BesideSimulation(Dataset):
    """Data set with the channels `PUSHES`.

    Args:
        centre: (NUM_BASE,) coefficients of the physics nearest to the simulation, about which the prior lies, in prior
            standard deviations from the published regressions.
    """

    centre: np.ndarray | None = None


def centre_of(dataset: Dataset) -> np.ndarray | None:
    """Coefficients about which the prior of `dataset` lies; None: the published regressions."""
    return dataset.centre if isinstance(dataset, BesideSimulation) else None
