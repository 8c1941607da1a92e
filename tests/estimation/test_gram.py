"""Linear Gaussian algebra of the diagnosis against direct computation."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.estimation.gram import (
    ETA_PRECISION,
    Hyper,
    Prior,
    Products,
    accelerated,
    by_run,
    ornstein_uhlenbeck,
    solve,
)
from shipbench.estimation.packed import pack


def test_the_evidence_is_that_of_the_joint_gaussian():
    rng = np.random.default_rng(0)
    knots, G, T = 3, 2, 6 * 5
    Z = rng.standard_normal((2, T, 6 + 3 * knots + G + 1))
    hyper = Hyper(np.array([0.1, -0.3, 0.2]), rng.normal(0.0, 0.2, 6), 2.0)
    by_channel = np.moveaxis(Z.reshape(2, 5, 6, -1), 2, 0)
    P = pack(np.swapaxes(by_channel, 2, 3) @ by_channel)
    gram = Products.of(P, Z.shape[2], np.array([5, 5]), knots, 1.0, np.array([0, 1]), 2).weigh(hyper)
    prior = Prior(np.array([0]), np.array([0.7]), np.array([1]), np.array([0.4]))
    found = solve(gram.reduce(hyper.log_force), prior).log_evidence
    K = np.linalg.inv(ornstein_uhlenbeck(knots, 1.0, 2.0)[0])
    noise = np.diag(np.tile(np.exp(hyper.log_noise), 5))
    C = np.zeros((2 * T, 2 * T))
    for b in range(2):
        S_eta, S_w, own = Z[b, :, :6], Z[b, :, 6 : 6 + 3 * knots], Z[b, :, -2:-1]
        W = np.kron(np.diag(np.exp(hyper.log_force)), K)
        at = slice(b * T, (b + 1) * T)
        C[at, at] = noise + S_eta @ S_eta.T / ETA_PRECISION + S_w @ W @ S_w.T + np.exp(0.4) * own @ own.T
    shared = Z[:, :, -3].reshape(-1, 1)
    C += shared @ shared.T / 0.7
    e = Z[:, :, -1].ravel()
    expected = -0.5 * (e @ np.linalg.solve(C, e) + np.linalg.slogdet(C)[1])
    assert found == pytest.approx(expected, rel=1e-9)


def test_accelerated_steps_reach_the_rest_of_a_creeping_iteration():
    """Steps that close 2 % of the distance: as many plain ones would be 60 % short."""
    rest = np.array([1.0, -3.0])

    def step(theta: np.ndarray) -> tuple[float, np.ndarray]:
        return -float(np.sum((theta - rest) ** 2)), theta + np.array([0.02, 0.05]) * (rest - theta)

    assert np.abs(accelerated(step, np.zeros(2), 8) - rest).max() < 0.15


def test_a_leap_that_loses_evidence_is_not_taken():
    """Two linear stretches: extrapolated over the bend, the leap would land far beyond it."""

    def step(theta: np.ndarray) -> tuple[float, np.ndarray]:
        return -abs(float(theta[0]) - 1.0), np.minimum(theta + np.array([0.3]), 1.0)

    assert accelerated(step, np.array([-0.1]), 3) == pytest.approx(1.0)


def test_sums_by_run_are_those_of_reduceat():
    run = np.array([0, 1, 1, 1, 2, 2, 5])
    values = np.random.default_rng(0).standard_normal((7, 3, 3))
    np.testing.assert_allclose(by_run(values, run), np.add.reduceat(values, [0, 1, 4, 6]), rtol=1e-12)
