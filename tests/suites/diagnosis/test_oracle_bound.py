"""The oracle bound: what a likelihood-ratio test that knows the effect and its size could find."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from shipbench.effects.base import EFFECTS
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.forward import Plant
from shipbench.estimation.laplace import Fit
from shipbench.estimation.linearisation import Scales
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.oracle_bound import LEVEL, bound, expected_ratio, power

PLAN = Trials(runs=6, samples=60)


@pytest.fixture(scope="module")
def null() -> Fit:
    plant = Plant.of(sea_trials(load_mmg_ship("kcs"), 5, (), PLAN))
    return null_fit(plant, Scales(plant))


def test_power_is_that_of_the_two_sided_normal_test():
    assert power(0.0) == pytest.approx(LEVEL)
    for ratio in (1.0, 4.0, 9.0):
        edge = norm.isf(0.5 * LEVEL)
        assert power(ratio) == pytest.approx(
            norm.sf(edge - np.sqrt(ratio)) + norm.cdf(-edge - np.sqrt(ratio)), rel=1e-6
        )
    assert power(-3.0) == pytest.approx(LEVEL)


def test_evidence_grows_with_the_square_of_the_size(null):
    heading = EFFECTS.get("heading_bias")
    small, twice = (expected_ratio(null, heading, (np.array([size]),)) for size in (0.01, 0.02))
    assert small > 1.0
    assert twice == pytest.approx(4.0 * small, rel=1e-6)


def test_a_value_for_every_run_says_as_much_as_the_one_that_it_repeats(null):
    wind = EFFECTS.get("wind")
    one = expected_ratio(null, wind, (np.array([4.0]), np.array([-2.0])))
    assert expected_ratio(null, wind, (np.full(6, 4.0), np.full(6, -2.0))) == pytest.approx(one)


def test_what_ordinary_ships_do_cannot_be_seen(null):
    """A rudder that is a little stronger is a ship like any other; a heading that is 2 degrees off is not."""
    rudder = expected_ratio(null, EFFECTS.get("rudder_gain"), (np.array([0.05]),))
    assert power(rudder) < 0.5
    assert power(expected_ratio(null, EFFECTS.get("heading_bias"), (np.array([0.035]),))) > 0.99


def test_the_bound_of_a_set_is_that_of_its_least_visible_effect():
    clear, faint = EFFECTS.get("heading_bias"), EFFECTS.get("rudder_gain")
    data = sea_trials(load_mmg_ship("kcs"), 5, (Hidden(clear, (0.035,)),), PLAN)
    both = bound(data, [(clear, (np.array([0.035]),)), (faint, (np.array([0.02]),))])
    assert both < 0.5 < bound(data, [(clear, (np.array([0.035]),))])
