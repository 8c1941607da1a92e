"""Speed and turning of the calibrated ship beside those of her file, where the runs identify the difference."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ...effects.base import EFFECTS
from ...estimation.behaviour import Operation, changes
from ...estimation.budget import is_spent
from ...estimation.calibration import calibration_of
from ...estimation.laplace import Fit
from ..result import Cause, Moved
from ..thresholds import THRESHOLDS

_ANGLES = (10.0, 25.0)
"""Rudder angles of the steady turns [deg]."""
_NOT_SHIP = ("environment", "sensor", "time")


def moved(found: Fit, causes: Sequence[Cause]) -> tuple[Moved, ...]:
    """Differences of the calibrated ship from her file that are practically significant.

    Single coefficients are not reported: on simulated ships their intervals do not hold
    (docs/calibration.md#sizes-of-calibration). Beside a cause in the ship herself the coefficients alone are not the
    ship.
    """
    from scipy.stats import t

    own = [EFFECTS.get(c.effect) for c in causes]
    if is_spent() or any(e.family not in _NOT_SHIP and e.traits.search != "hull" for e in own):
        return ()
    at = Operation.of(found.plant, tuple(map(math.radians, _ANGLES)))
    if at is None:
        return ()
    where = f"at {at.rpm:.3g} rpm"
    names = [f"speed {where}", *(f"yaw rate with {math.degrees(a):.0f}° of rudder {where}" for a in at.angles)]
    quantile = float(t.ppf(0.975, max(found.plant.seg.runs - 1, 1)))
    least = THRESHOLDS.value("reported_share")
    return tuple(
        Moved(name, c.relative, "1", c.ci95, c.spreads)
        for name, c in zip(names, changes(found.plant, calibration_of(found), at, quantile), strict=True)
        if c is not None and abs(c.relative) > least and c.ci95[0] * c.ci95[1] > 0.0
    )
