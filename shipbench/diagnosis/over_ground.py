"""Velocities through water in place of those over ground: a ship's log in a current. Beside them every other fault of a sensor is hidden, and so is
what the current does to the ship."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..checking.recording import Recording
from ..checking.track import through_water
from ..records import Dataset, Run
from ..signals import PSI, U, V
from .derived import has_speeds


def over_ground(dataset: Dataset) -> tuple[Dataset, list[str]]:
    """The data set with velocities over ground, and a line for the reader where it had others. What is derived from positions is over ground."""
    found = through_water(Recording(dataset)) if has_speeds(dataset) else None
    if found is None:
        return dataset, []
    north, east = found
    line = (
        f"u and v are through water: the track drifts {np.hypot(north, east):.3g} m/s towards {np.rad2deg(np.arctan2(east, north)) % 360.0:.0f} deg "
        "more than they say. That is added to them; the current that the ship feels is looked for as any other cause. `shipbench data check` has "
        "the lines for dataset.toml."
    )
    return dataset.with_runs([_drifting(run, north, east) for run in dataset.runs]), [line]


def _drifting(run: Run, north: float, east: float) -> Run:
    states, c, s = run.states.copy(), np.cos(run.states[:, PSI]), np.sin(run.states[:, PSI])
    states[:, U] += c * north + s * east
    states[:, V] += c * east - s * north
    return replace(run, states=states)
