"""Laplace approximation of the joint fit on one linearisation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.effects.base import EFFECTS
from shipbench.estimation.gauss_newton import Origin, fit, start
from shipbench.estimation.laplace import Model, settle
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
