"""Refinement of a calibration on open-loop rollouts, where that pays on validation runs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..physics.actuators import Gear
from ..records import Dataset
from ..ship import complete
from .calibration import Calibration, refined
from .forward import MOST_STEPS
from .linearisation import Scales
from .open_loop import distance, rollout_plant

_LENGTHS = (60.0, 240.0)
"""Lengths of rollouts [s] that are tried, for a ship of 130 m (Froude-scaled)."""


def refinement_length(train: Dataset, valid: Dataset, gears: Mapping[str, Gear], start: Calibration) -> float | None:
    """Length of the rollouts [s] whose refinement of `start`, a calibration to `train`, predicts the validation runs
    best; None where no gain exceeds its standard error over these runs (the rule of one standard error), as of a single
    run."""
    if len(valid) < 2:
        return None
    froude = (complete(train.ship).L / 130.0) ** 0.5
    test = rollout_plant(valid, dict(gears), _LENGTHS[-1] * froude)
    before, gains = distance(test, Scales(test), start)[0], {}
    for seconds in (froude * length for length in _LENGTHS):
        gain = before - distance(test, Scales(test), refined_on(train, gears, seconds, start))[0]
        if gain.mean() > gain.std(ddof=1) / np.sqrt(len(gain)):
            gains[seconds] = gain.mean()
    return max(gains, key=gains.__getitem__, default=None)


def refined_on(dataset: Dataset, gears: Mapping[str, Gear], seconds: float | None, start: Calibration) -> Calibration:
    """Calibration refined on rollouts of `seconds`, as many as a fit takes of a long record; `start` itself for
    None."""
    if seconds is None:
        return start
    rolled = rollout_plant(dataset, dict(gears), seconds)
    rolled = rolled.thinned(max(len(dataset), MOST_STEPS // (rolled.steps * rolled.substeps)))
    return refined(rolled, Scales(rolled), start)
