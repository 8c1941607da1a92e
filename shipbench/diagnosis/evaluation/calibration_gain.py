"""Error of the ship file's model, and what calibrating the ship's own coefficients makes of it, on the fitted runs."""

from __future__ import annotations

import numpy as np

from ...estimation.actuator_fit import fit_actuators
from ...estimation.calibration import calibration_of
from ...estimation.coefficients import NUM_BASE
from ...estimation.gears import gears_of
from ...estimation.laplace import Fit
from ...estimation.linearisation import Scales
from ...estimation.open_loop import Rollout, distance, rollout_plant
from ...physics.actuators import Gear
from ...records import Dataset
from ..result import Calibrated
from .held_out_gain import horizon


def calibration_gain(dataset: Dataset, null: Fit) -> Calibrated:
    """Mean position errors of open-loop rollouts over the fitted runs: with the prior means of all coefficients, which
    the ship file and published regressions give, and with the coefficients of the baseline model `null`."""
    seconds = horizon(dataset.ship.L)
    plant = rollout_plant(dataset, _gears(dataset, null), seconds)
    as_in_file = Rollout(np.zeros(NUM_BASE), (), ())
    before, after = (
        float(distance(plant, Scales(plant), model)[0].mean()) for model in (as_in_file, calibration_of(null))
    )
    return Calibrated(before, after, plant.steps * plant.seg.dt)


def _gears(dataset: Dataset, null: Fit) -> dict[str, Gear]:
    """Actuator dynamics of the baseline model: from the records, or those of the fit where there are none."""
    if dataset.actuators == "commanded":
        return dict(null.plant.ordinary)
    batch = dataset.windows(min(len(run) for run in dataset.runs) - 1).batch()
    return gears_of(fit_actuators(batch, dataset.dt))
