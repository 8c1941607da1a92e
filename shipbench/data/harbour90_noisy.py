"""Port manoeuvres of `harbour90`, sailed in light hidden gusts and recorded by noisy sensors: no model can be
perfect."""

from __future__ import annotations

import numpy as np

from ..records import Dataset
from ..simulate.harbour import Gusts
from .base import DatasetPart
from .harbour90 import SEED, simulate

GUSTS = Gusts(sigma=1.5, tau=20.0)
# White noise per sample: x, y 0.5 m; psi 0.3 deg; u, v 0.05 m/s; r 0.05 deg/s; n 0.5 rpm; delta 0.2 deg; thruster
# forces 1 % of reading.
NOISE = np.array([0.5, 0.5, np.deg2rad(0.3), 0.05, 0.05, np.deg2rad(0.05), 0.5, np.deg2rad(0.2), 0.01, 0.01])


def make(seed: int = SEED) -> Dataset:
    """Make the noisy set; it has the plans of `harbour90`, so the tracks differ by the gusts and the controllers'
    response to them."""
    return simulate("harbour90_noisy", int(seed), GUSTS, NOISE)


DATASET = DatasetPart("harbour90_noisy", "harbour90 with sensor noise and light hidden gusts", "MIT", make, cached=True)
