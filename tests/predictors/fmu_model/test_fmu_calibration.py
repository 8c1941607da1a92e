"""Calibration of parameters by rollouts, on a formula in place of an FMU."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.predictors.fmu_model.calibration import Rollouts, calibrate, typical_sizes


def simulate(windows: Rollouts, values: np.ndarray) -> np.ndarray:
    """Speed that approaches gain x command with a time constant; straight on."""
    S = np.repeat(np.repeat(windows.s0[None, :, None], windows.U.shape[1], axis=2), len(values), axis=0)
    for column, (gain, lag) in enumerate(values):
        u, x = windows.s0[:, 3].copy(), windows.s0[:, 0].copy()
        for k in range(windows.U.shape[1]):
            u = u + (gain * windows.U[:, k, 0] - u) / lag
            x = x + u
            S[column, :, k, 0], S[column, :, k, 3] = x, u
    return S


@pytest.fixture
def windows() -> Rollouts:
    rng = np.random.default_rng(3)
    s0, U = np.zeros((5, 10)), np.repeat(rng.uniform(50, 100, (5, 6, 4)), 10, axis=1)
    s0[:, 3] = rng.uniform(1, 5, 5)
    start = Rollouts(s0, U, np.zeros((5, 60, 10)))
    return Rollouts(s0, U, simulate(start, np.array([[0.05, 12.0]]))[0])


LOW, HIGH = np.array([0.01, 3.0]), np.array([0.2, 60.0])


def test_values_come_back_from_far(windows):
    found = calibrate(simulate, windows, np.array([0.15, 50.0]), LOW, HIGH)
    np.testing.assert_allclose(found.values, [0.05, 12.0], rtol=1e-6)
    assert found.after < 1e-6 < found.before
    assert found.simulated > 0


def test_deviations_are_those_of_repeated_noise(windows):
    values, told = [], []
    for seed in range(12):
        noise = np.zeros_like(windows.truth)
        noise[..., 3] = 0.1 * np.random.default_rng(seed).standard_normal(noise.shape[:2])
        noise[..., 0] = 2.0 * np.random.default_rng(seed + 99).standard_normal(noise.shape[:2])
        found = calibrate(
            simulate, Rollouts(windows.s0, windows.U, windows.truth + noise), np.array([0.1, 20.0]), LOW, HIGH
        )
        values.append(found.values)
        told.append(found.deviations)
    ratio = np.std(values, axis=0) / np.mean(told, axis=0)
    assert ((ratio > 0.4) & (ratio < 2.5)).all(), ratio


def test_a_parameter_without_effect_has_no_deviation(windows):
    def with_idle(w: Rollouts, values: np.ndarray) -> np.ndarray:
        return simulate(w, values[:, :2])

    low, high = np.append(LOW, 0.0), np.append(HIGH, 1.0)
    found = calibrate(with_idle, windows, np.array([0.1, 20.0, 0.5]), low, high)
    np.testing.assert_allclose(found.values[:2], [0.05, 12.0], rtol=1e-6)
    assert np.isnan(found.deviations[2])


def test_runs_that_fail_push_away_from_their_values(windows):
    def fragile(w: Rollouts, values: np.ndarray) -> np.ndarray:
        S = simulate(w, values)
        S[values[:, 1] < 8.0] = np.nan
        return S

    found = calibrate(fragile, windows, np.array([0.1, 20.0]), LOW, HIGH)
    np.testing.assert_allclose(found.values, [0.05, 12.0], rtol=1e-4)


def test_short_windows_hold_the_same_samples(windows):
    short = windows.shortened()
    assert short is not None
    assert short.truth.shape == (20, 15, 10)
    np.testing.assert_array_equal(short.truth[5], windows.truth[0, 15:30])
    np.testing.assert_array_equal(short.s0[5], windows.truth[0, 14])
    assert Rollouts(windows.s0, windows.U[:, :20], windows.truth[:, :20]).shortened() is None


def test_the_size_of_both_positions_is_one(windows):
    size = typical_sizes(windows.s0, windows.truth)
    assert size[0] == size[1] > 0.0
    assert size[5] == 1.0  # does not move
