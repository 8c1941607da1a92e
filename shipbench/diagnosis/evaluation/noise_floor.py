"""Noise floor of open-loop rollouts: the error that the sensors' noise alone makes, of a model without any error."""

from __future__ import annotations

import numpy as np

from ...estimation.calibration import calibration_of
from ...estimation.laplace import Fit
from ...estimation.linearisation import Point, Scales, predict
from ...estimation.open_loop import rolled, rollout_plant
from ...records import Dataset
from ..result import NoiseFloor
from .held_out_gain import horizon, recorded_gears

_DRAWS = 8


def noise_floor(dataset: Dataset, null: Fit, seed: int) -> NoiseFloor:
    """Mean errors of rollouts of the calibrated ship that begin at a state with the noise of the sensors, against a
    record with that noise.

    The rollouts are those of the benchmark's ED: as long, and driven by the same commands. Gusts and errors of the
    model are not part of it.

    Args:
        dataset: the runs.
        null: their baseline model; its noise is that of the sensors, wave motion and lasting errors included.
        seed: of the draws.
    """
    plant = rollout_plant(dataset, recorded_gears(dataset, null), horizon(dataset.ship.L))
    scales, model, rng = Scales(plant), calibration_of(null), np.random.default_rng(seed)
    exact = rolled(plant, scales, model).predicted
    size = model.pushes.noise * np.sqrt(1.0 + null.scales.colour.share)
    scored = plant.seg.mask.copy()
    scored[:, 0] = False
    at_rest = np.zeros((len(scored), plant.knots, 3))
    position, heading = [], []
    for _ in range(_DRAWS):
        noise = size * rng.standard_normal(exact.shape)
        start = Point(model.base, noise[:, 0] / scales.eta, at_rest, model.terms, model.values)
        error = predict(plant, scales, start) - exact - noise
        position.append(np.hypot(error[..., 0], error[..., 1])[scored])
        heading.append(np.abs(error[..., 2])[scored])
    return NoiseFloor(float(np.nanmean(position)), float(np.nanmean(heading)))
