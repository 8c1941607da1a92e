"""Fading of the force of thrusters with speed."""

from __future__ import annotations

import numpy as np

from shipbench.physics.thruster import fading


def test_thrusters_fade_alike_ahead_and_astern_and_not_at_rest():
    speeds = np.array([0.0, 3.57, -3.57, 100.0])
    np.testing.assert_allclose(fading(speeds, 130.0), [0.0, 1.0 - np.exp(-1.0), 1.0 - np.exp(-1.0), 1.0], rtol=1e-3)
