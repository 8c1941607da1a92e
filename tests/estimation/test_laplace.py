"""Laplace approximation of the joint fit on one linearisation."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from shipbench.effects.base import EFFECTS
from shipbench.estimation.gauss_newton import Origin, fit, start
from shipbench.estimation.laplace import Model, products_of, settle
from shipbench.estimation.linearisation import Linearisation, Scales
from shipbench.estimation.term import Term


def test_the_latent_force_puts_the_model_on_the_measurement(plant):
    scales = Scales(plant)
    origin = Origin.of(plant, scales)
    found = fit(plant, scales, Model(), origin.point, origin.hyper, guess=origin.motion)
    noise = np.exp(0.5 * found.hyper.log_noise) * scales.noise
    assert noise[0] == pytest.approx(0.5 * plant.c.L / 130.0, rel=0.3)  # the simulated position noise is found again
    rest = (plant.seg.states[..., :6] - found.columns.predicted) / noise
    assert np.sqrt(np.mean(rest[plant.seg.mask] ** 2)) < 1.5


def test_an_effect_with_one_value_per_run_has_its_own_columns_in_every_run(plant):
    scales = Scales(plant)
    point, hyper = start(plant)
    term = Term(EFFECTS.get("current_per_run"), per_run=True)
    point = replace(point, terms=(term,), values=(np.zeros((plant.seg.runs, 2)),))
    settled = settle(Linearisation(plant, scales, point), Model((term,)), hyper, {})
    assert settled.values[0].shape == (plant.seg.runs, 2)
    assert np.isfinite(settled.evidence)


def test_the_variance_of_values_per_run_does_not_vanish_at_once(plant):
    """Far from rest the linear model may want none of them."""
    scales = Scales(plant)
    point, hyper = start(plant)
    term = Term(EFFECTS.get("current_per_run"), per_run=True)
    point = replace(point, terms=(term,), values=(np.full((plant.seg.runs, 2), 0.5),))
    found = settle(Linearisation(plant, scales, point), Model((term,)), hyper, {0: 3.0})
    assert found.log_tau2[0] == pytest.approx(2.5)


def test_products_of_some_channels_are_rows_of_those_of_all(plant):
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
    np.testing.assert_allclose(some.P, whole.P[[2, 5]], rtol=1e-12)
    e = (seg.states[..., 2] - columns.predicted[..., 2]) / scales.noise[2]
    white = np.where(seg.mask, e @ coloured.colour.factor[2].T, 0.0)
    np.testing.assert_allclose(whole.P[2, :, -1, -1], np.sum(white**2, axis=1), rtol=1e-9)


def test_a_fit_that_has_not_come_to_rest_is_charged_with_the_cost_it_has(plant):
    """One step from far away promises much; the evidence counts what was reached, and the best point of the path is
    kept."""
    scales = Scales(plant)
    origin = Origin.of(plant, scales)
    far = replace(origin.point, base=origin.point.base + 2.0 * np.cos(np.arange(len(origin.point.base))))
    short, long = (fit(plant, scales, Model(), far, origin.hyper, iterations=k, guess=origin.motion) for k in (1, 20))
    assert short.excess > 10.0
    assert short.evidence < short.solution.log_evidence - 5.0
    assert long.excess < 1.0
    assert long.evidence > short.evidence


def test_values_of_a_diverged_trajectory_have_no_products(plant):
    scales, (point, _) = Scales(plant), start(plant)
    lin = Linearisation(plant, scales, point)
    columns = lin.columns()
    columns.base[0, 0, 0] = 1e200
    assert np.isfinite(products_of(plant, scales, point, columns).weigh(start(plant)[1]).reduce(np.zeros(3)).S).all()
