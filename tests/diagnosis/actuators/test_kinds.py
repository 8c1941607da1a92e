"""Effects on actuator dynamics, and what is ordinary for a ship of any length."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.diagnosis.actuators.kinds import GearFinding, slow_on_any_ship
from shipbench.physics.actuators import Gear


@pytest.mark.parametrize(
    ("effect", "actuator", "gear", "slow"),
    [
        ("shaft_lag", "n", Gear(25.0, 10.0), True),  # a Diesel of 12 s on a ship of 130 m needs 21 s on one of 400 m
        ("shaft_lag", "n", Gear(15.0, 10.0), False),
        ("rudder_rate_limit", "delta", Gear(1.0, np.deg2rad(0.6)), True),
        ("rudder_rate_limit", "delta", Gear(1.0, np.deg2rad(1.6)), False),
        ("rudder_delay", "delta", Gear(1.0, 0.1, delay=1.0), True),
    ],
)
def test_what_is_slow_for_the_longest_ship_is_slow_for_any(effect, actuator, gear, slow):
    found = GearFinding(effect, 100.0, 1.0, (0.9, 1.1), np.zeros(4), actuator, gear)
    assert slow_on_any_ship(found) is slow
