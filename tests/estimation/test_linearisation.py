"""Sensitivities of the plain model against the rollout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from shipbench.estimation.gauss_newton import start
from shipbench.estimation.linearisation import Linearisation, Scales, predict


def test_sensitivities_are_those_of_the_rollout(plant):
    scales = Scales(plant)
    point, _ = start(plant)
    columns = Linearisation(plant, scales, point).columns()
    step = 1e-4
    for i in (0, 3, 8, 16):
        moved = replace(point, base=point.base + step * np.eye(len(point.base))[i])
        slope = (predict(plant, scales, moved) - columns.predicted) / step
        got = columns.base[..., i].reshape(slope.shape)
        assert np.abs(got - slope).max() < 0.02 * np.abs(slope).max() + 1e-9
    moved = replace(point, w=point.w + step * np.eye(plant.knots)[4][None, :, None] * np.array([0.0, 1.0, 0.0]))
    slope = (predict(plant, scales, moved) - columns.predicted) / step
    assert np.abs(columns.w[..., plant.knots + 4].reshape(slope.shape) - slope).max() < 0.02 * np.abs(slope).max()


def test_a_guess_whose_gaps_are_chained_gives_the_rollout_of_a_linear_change(plant):
    scales = Scales(plant)
    point, _ = start(plant)
    lin = Linearisation(plant, scales, point)
    lin.columns()
    near = replace(point, base=point.base + 1e-3)
    lifted = Linearisation(plant, scales, near, lin.towards(near)).predicted
    assert np.abs(lifted - predict(plant, scales, near)).max() < 1e-3
