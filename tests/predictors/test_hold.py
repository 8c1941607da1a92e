"""The floor: u, v, r kept, pose in closed form."""

from __future__ import annotations

import numpy as np

from shipbench.predictors.hold import Hold
from shipbench.signals import move_frame


def held(dt=1.0):
    model = Hold()
    model.dt = dt
    return model


def start(**values):
    from shipbench.signals import STATES

    s0 = np.zeros(10)
    for name, value in values.items():
        s0[STATES.index(name)] = value
    return s0


def test_without_yaw_rate_the_track_is_straight_along_the_heading():
    S = held().predict(start(x=10.0, psi=np.pi / 2, u=4.0, v=1.0), np.zeros((5, 4)))
    np.testing.assert_allclose(S[:, 0], 10.0 - np.arange(1, 6), atol=1e-12)  # sway to starboard of east is south
    np.testing.assert_allclose(S[:, 1], 4.0 * np.arange(1, 6), atol=1e-12)


def test_with_yaw_rate_the_track_is_the_circle_of_radius_u_over_r():
    r = 2 * np.pi / 100
    S = held().predict(start(u=3.0, r=r), np.zeros((100, 4)))
    np.testing.assert_allclose(S[24, :3], [3.0 / r, 3.0 / r, np.pi / 2], rtol=1e-9)  # a quarter circle to starboard
    np.testing.assert_allclose(S[-1, :3], [0.0, 0.0, 2 * np.pi], atol=1e-9)


def test_a_tiny_yaw_rate_gives_the_straight_line():
    U = np.zeros((50, 4))
    a, b = (held().predict(start(u=3.0, v=0.2, r=r), U) for r in (0.0, 1e-13))
    np.testing.assert_allclose(a, b, atol=1e-8)


def test_the_rest_of_the_state_is_kept_whatever_is_commanded():
    s0 = start(u=3.0, n=80.0, delta=0.1, F_b=5.0)
    S = held().predict(s0, np.full((5, 4), 7.0))
    np.testing.assert_array_equal(S[:, 3:], np.repeat(s0[None, 3:], 5, axis=0))


def test_predictions_move_with_the_earth_frame():
    rng = np.random.default_rng(1)
    s0, U, origin = rng.normal(size=(4, 10)), np.zeros((4, 30, 4)), np.array([100.0, -50.0])
    moved = held(0.5).predict(move_frame(s0, origin, 1.1), U)
    np.testing.assert_allclose(moved, move_frame(held(0.5).predict(s0, U), origin, 1.1), atol=1e-10)


def test_a_saved_model_predicts_the_same(tmp_path):
    s0, U = start(u=3.0, r=0.01), np.zeros((5, 4))
    held(0.5).save(tmp_path / "model")
    np.testing.assert_array_equal(Hold.load(tmp_path / "model").predict(s0, U), held(0.5).predict(s0, U))
