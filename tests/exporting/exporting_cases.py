"""Models on which every format is tested, and the measure of their agreement."""

from __future__ import annotations

import numpy as np
import pytest

CURRENT = "current[speed=0.4,to=1.0]"
SENSORS = "heading_bias[bias=0.05,turned_velocities=1]+antenna_offset[forward=20,starboard=3,own_velocities=1]"
GEARS = "rudder_delay[delay=1.3]+rudder_backlash[play=0.03]"
PHYSICS = [
    ("physics", {}),
    ("physics", {"wind": True}),
    ("physics", {"commanded": True}),
    (f"physics+{CURRENT}+{GEARS}", {}),
    (f"physics+{GEARS}+{SENSORS}", {"commanded": True, "wind": True}),
    ("physics+rudder_deadband[band=0.02]+shaft_lag[lag=4]+speed_scale[scale=0.1]", {}),
    ("physics+change_point[effect=rudder_offset,time=9.5,offset=0.05]", {}),
]
WHOLE = (f"calibrated+{CURRENT}+{GEARS}+{SENSORS}", {"commanded": True, "wind": True})
CALIBRATED = [("calibrated", {}), ("calibrated", {"wind": True}), (f"calibrated+{CURRENT}+{GEARS}", {})]
LONG = [pytest.param(*case, marks=pytest.mark.long) for case in (*PHYSICS[:2], WHOLE)]
CASES = [*PHYSICS, WHOLE, *(pytest.param(*case, marks=pytest.mark.long) for case in CALIBRATED)]
"""Spec with given values, and options of `made`; LONG are those that are compiled in the long tests."""


def largest(found: np.ndarray, expected: np.ndarray) -> float:
    """Largest difference relative to max(1, size)."""
    return float(np.max(np.abs(found - expected) / np.maximum(1.0, np.abs(expected))))
