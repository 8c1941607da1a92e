"""Products of whitened columns."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from shipbench.estimation import packed
from shipbench.estimation.gauss_newton import start
from shipbench.estimation.linearisation import Linearisation, Scales
from shipbench.estimation.packed import places
from shipbench.estimation.whitening import products_of


@pytest.fixture(params=["machine code", "numpy"])
def way(request, monkeypatch):
    """Products with and without a compiler."""
    if request.param == "numpy":
        monkeypatch.setattr(packed, "_code", lambda *_: None)


def test_products_of_some_channels_are_rows_of_those_of_all(plant, way):
    """With noise that lasts in one of them, and a piece that ends early."""
    scales = Scales(plant)
    seg = replace(
        plant.seg,
        mask=plant.seg.mask
        & (np.arange(plant.steps + 1) < plant.steps - 3 * (np.arange(len(plant.seg.run)) == 1)[:, None]),
    )
    short = copy(plant)
    short.seg = seg
    point, _ = start(plant)
    columns, coloured = (
        Linearisation(short, scales, point).columns(),
        scales.coloured(scales.colour.with_channel(2, 4.0, 6.0)),
    )
    whole, some = products_of(short, coloured, point, columns), products_of(short, coloured, point, columns, [2, 5])
    assert coloured.colour.differs(scales.colour) == [2]
    np.testing.assert_allclose(some.P, [whole.P[2], whole.P[5]], rtol=1e-12)
    e = (seg.states[..., 2] - columns.predicted[..., 2]) / scales.noise[2]
    white = np.where(seg.mask, e @ coloured.colour.factor[2].T, 0.0)
    np.testing.assert_allclose(whole.P[2][:, places(whole.size)[-1, -1]], np.sum(white**2, axis=1), rtol=1e-9)


def test_values_of_a_diverged_trajectory_have_no_products(plant, way):
    scales, (point, _) = Scales(plant), start(plant)
    lin = Linearisation(plant, scales, point)
    columns = lin.columns()
    columns.base[0, 0, 0] = 1e200
    assert np.isfinite(products_of(plant, scales, point, columns).weigh(start(plant)[1]).reduce(np.zeros(3)).S).all()
