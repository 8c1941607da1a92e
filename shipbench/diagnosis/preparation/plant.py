"""Forward model of the runs as they are recorded."""

from __future__ import annotations

from ...checking.standing import standing
from ...estimation.forward import MOST_STEPS, Plant
from ...records import Dataset


def plant_of(dataset: Dataset, most_steps: int = MOST_STEPS) -> Plant:
    """Forward model of a data set, at most `most_steps` integration steps; an actuator whose record stands still while
    the ship does what that actuator alone can do is not at work."""
    return Plant.of(dataset, most_steps, standing(dataset).keys())
