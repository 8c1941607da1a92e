"""Small simulated trial with a hidden current of 0.36 m/s towards 060°, for `shipbench demo`."""

from __future__ import annotations

import math

from ..effects.base import EFFECTS
from ..physics.mmg import load_mmg_ship
from ..records import Dataset
from ..simulate.hidden import Hidden
from ..simulate.trials import Trials, sea_trials
from .base import DatasetPart

SPEED, TOWARDS = 0.36, math.radians(60.0)
"""Hidden current [m/s, rad clockwise from north]."""
SEED, RUNS, SAMPLES = 1, 12, 100


def make(seed: int = SEED) -> Dataset:
    """Runs of the demo, 12 of 100 s at 1 s, of the 130 m container ship: zig-zags, turns, rudder and engine commands,
    with sensor noise and gusts."""
    current = EFFECTS.get("current")
    hidden = [Hidden(current, current.internal({"speed": SPEED, "to": TOWARDS}))]
    return sea_trials(load_mmg_ship("container130"), int(seed), hidden, Trials(runs=RUNS, samples=SAMPLES), name="demo")


DATASET = DatasetPart(
    "demo",
    "12 simulated runs of a 130 m container ship, 100 s at 1 s, with a hidden current",
    "MIT",
    make,
    cached=False,
)
