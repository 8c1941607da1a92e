"""Forces of identified causes along the runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_fit

from shipbench.diagnosis.evaluation.forces import force_of_hull, force_of_term
from shipbench.effects.base import EFFECTS
from shipbench.estimation.coefficients import FREE, NUM_BASE
from shipbench.estimation.forward import Plant
from shipbench.estimation.laplace import Fit
from shipbench.estimation.term import Term


def moving(plant: Plant, name: str, *values: float) -> Fit:
    """A fit about the recorded motion, with one cause."""
    fit = made_fit((Term(EFFECTS.get(name)),), (np.array(values),), plant)
    return replace(fit, motion=plant.seg.states[..., :6])


def test_a_sensor_pushes_nothing(plant):
    assert force_of_term(moving(plant, "heading_bias", 1.0), 0) == {}


def test_more_thrust_pushes_ahead_in_proportion(plant):
    one, two = (force_of_term(moving(plant, "thrust_gain", size), 0) for size in (1.0, 2.0))
    assert one["surge"] > 0.0
    assert two["surge"] == pytest.approx(2.0 * one["surge"], rel=1e-3)
    assert "sway" not in one


def test_a_force_that_is_too_small_to_matter_is_not_told(plant):
    assert force_of_term(moving(plant, "thrust_gain", 1e-4), 0) == {}


def test_the_hull_of_the_regressions_pushes_nothing_and_another_does(plant):
    fit = replace(made_fit(plant=plant), motion=plant.seg.states[..., :6])
    assert force_of_hull(fit) == {}
    mean = np.zeros(NUM_BASE)
    mean[len(FREE) :][:10] = 1.0
    other = replace(fit, solution=replace(fit.solution, mean=mean))
    assert max(force_of_hull(other).values()) > 0.0
