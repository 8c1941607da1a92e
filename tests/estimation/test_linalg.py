"""Inverses and log determinants of many matrices against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.estimation.linalg import inverses, log_determinant


def test_log_determinants_of_sound_and_of_blown_up_matrices():
    rng = np.random.default_rng(0)
    J = rng.standard_normal((5, 12, 8))
    sound = np.swapaxes(J, 1, 2) @ J + np.eye(8)
    np.testing.assert_allclose(log_determinant(sound), np.linalg.slogdet(sound)[1], rtol=1e-12)
    J[2, :, 0] *= 1e18
    J[2, :, 1] = J[2, :, 0]  # rounding alone decides whether this is positive definite
    blown = np.swapaxes(J, 1, 2) @ J - 1e25 * np.eye(8) * (np.arange(5) == 2)[:, None, None]
    with pytest.raises(np.linalg.LinAlgError):
        np.linalg.cholesky(blown)
    assert np.isfinite(log_determinant(blown)).all()
    np.testing.assert_array_equal(inverses(blown)[0], np.linalg.inv(blown))


@pytest.mark.parametrize(("count", "size"), [(1, 1), (8, 5), (19, 40)])
def test_inverses_of_many_matrices_are_those_of_each(count, size):
    J = np.random.default_rng(size).standard_normal((count, 2 * size, size)) * np.logspace(-4, 4, size)
    A = np.swapaxes(J, 1, 2) @ J
    inverse, logdet = inverses(A)
    unit = np.sqrt(np.diagonal(A, axis1=1, axis2=2))  # columns of very different sizes
    expected = np.linalg.inv(A / unit[:, :, None] / unit[:, None, :])
    np.testing.assert_allclose(inverse * unit[:, :, None] * unit[:, None, :], expected, atol=1e-9)
    np.testing.assert_allclose(logdet, np.linalg.slogdet(A)[1], rtol=1e-10)
