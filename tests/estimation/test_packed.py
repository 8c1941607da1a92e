"""Packed symmetric products, with machine code and without, against numpy."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.estimation import packed


@pytest.fixture(params=["machine code", "numpy"])
def way(request, monkeypatch):
    """Machine code, and what stands in for it where there is no compiler."""
    if request.param == "numpy":
        monkeypatch.setattr(packed, "_code", lambda *_: None)
    return request.param


@pytest.mark.parametrize("n", [1, 7, 8, 9, 16, 17, 40, 41])
def test_every_value_of_the_lower_triangle_has_a_place_of_its_own(n):
    rows = [packed.places(n)[i, : i + 1] for i in range(n)]
    assert [row[0] for row in rows] == [8 * sum(i // 8 + 1 for i in range(k)) for k in range(n)]
    assert packed.length(n) == 8 * sum(i // 8 + 1 for i in range(n))
    np.testing.assert_array_equal(packed.places(n), packed.places(n).T)
    assert len(np.unique(np.concatenate(rows))) == n * (n + 1) // 2


def test_some_rows_and_columns_are_those_of_the_whole():
    whole, keep = symmetric(3, 13), np.array([0, 4, 5, 12])
    some = packed.only(packed.pack(whole), 13, keep)
    np.testing.assert_array_equal(some[:, packed.places(4)], whole[:, keep][:, :, keep])


@pytest.mark.parametrize("sizes", [(6, 1), (6, 9, 1), (6, 9, 0, 3, 5, 1), (6, 39, 57, 1)])
def test_products_are_those_of_the_whitened_columns(sizes):
    """White and coloured, of blocks that are parts of others, and of pieces that end early."""
    rng, (B, K, n) = np.random.default_rng(0), (3, 7, sum(sizes))
    whole = rng.standard_normal((B, 6 * K, n))
    blocks = np.split(whole, np.cumsum(sizes)[:-1], axis=-1)
    real = np.arange(K) < np.array([7, 4, 0])[:, None]
    for factor in (None, np.tril(rng.standard_normal((K, K)))):
        found = packed.products(blocks, 2, 0.5, factor, real)
        if found is None:
            pytest.skip("no C compiler here")
        Z = 0.5 * whole.reshape(B, K, 6, n)[:, :, 2]
        Z = (Z if factor is None else factor @ Z) * real[..., None]
        np.testing.assert_allclose(found[:, packed.places(n)], np.swapaxes(Z, 1, 2) @ Z, rtol=1e-9, atol=1e-12)


def test_weighed_sums_are_whole_matrices(way):
    parts, weights = [symmetric(4, 21) for _ in range(3)], np.array([0.5, 2.0, 3.0])
    found = packed.weighed([packed.pack(p) for p in parts], weights, 21)
    np.testing.assert_allclose(found, sum(w * p for w, p in zip(weights, parts, strict=True)), rtol=1e-12)


def test_contracted_products_are_quadratic_forms_and_traces(way):
    rng = np.random.default_rng(1)
    parts, theta, more = [symmetric(4, 21) for _ in range(3)], rng.standard_normal((4, 21)), symmetric(4, 9)
    found = packed.contracted([packed.pack(p) for p in parts], theta, more)
    expected = [np.einsum("bi,bij,bj", theta, p, theta) + np.sum(p[:, :9, :9] * more) for p in parts]
    np.testing.assert_allclose(found, expected, rtol=1e-10)


def symmetric(count: int, n: int) -> np.ndarray:
    """Symmetric matrices (count, n, n)."""
    half = np.random.default_rng(n).standard_normal((count, n, n))
    return half + np.swapaxes(half, 1, 2)
