"""Velocities through water in place of those over ground: a ship's log in a current. Uncorrected they hide every other
sensor error, and the effect of the current on the ship."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...checking.recording import Recording
from ...checking.track import through_water
from ...records import Run
from ...signals import PSI, U, V
from .base import Prepared
from .derived_speeds import has_speeds


def speeds_over_ground(prepared: Prepared) -> Prepared:
    """Convert velocities through water to velocities over ground. Derived velocities are over ground already."""
    dataset = prepared.dataset
    found = through_water(Recording(dataset)) if has_speeds(dataset) else None
    if found is None:
        return prepared
    north, east = found
    line = (
        f"u and v are through water: the track drifts {np.hypot(north, east):.3g} m/s towards "
        f"{np.rad2deg(np.arctan2(east, north)) % 360.0:.0f} deg "
        "more than they give. That is added to them; the current is searched like any other "
        "cause. `shipbench data check` has "
        "the lines for dataset.toml."
    )
    return prepared.corrected(dataset.with_runs([_drifting(run, north, east) for run in dataset.runs]), line)


def _drifting(run: Run, north: float, east: float) -> Run:
    states, c, s = run.states.copy(), np.cos(run.states[:, PSI]), np.sin(run.states[:, PSI])
    states[:, U] += c * north + s * east
    states[:, V] += c * east - s * north
    return replace(run, states=states)
