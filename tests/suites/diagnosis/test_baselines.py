"""The two baselines: they name a great force, and they are deceived where they are known to be."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.baselines import derivative_regression, white_residual_test

NAMES = ["current", "rudder_offset", "thrust_gain", "heading_bias", "rudder_delay"]
PLAN = Trials(runs=6, samples=60, gusts=0.5)


def trials(name: str, q: tuple[float, ...]):
    return sea_trials(load_mmg_ship("container130"), 3, [Hidden(EFFECTS.get(name), q)], PLAN)


@pytest.mark.parametrize(("name", "q"), [("rudder_offset", (0.1,)), ("current", (0.6, -0.6))])
def test_a_great_force_is_named_by_both(name, q):
    data = trials(name, q)
    for method in (white_residual_test, derivative_regression):
        found = method(data, NAMES)
        assert found.ranking[0][0] == name, method.__name__
        assert found.named[0] == name
        assert found.verdict == "found"


def test_a_sensor_fault_is_seen_by_the_residuals_and_not_by_the_regression():
    data = trials("heading_bias", (0.12,))
    assert white_residual_test(data, NAMES).named == ("heading_bias",)
    assert "heading_bias" not in dict(derivative_regression(data, NAMES).ranking)


def test_rankings_are_sorted_and_name_every_candidate_once():
    data = trials("current", (0.3, 0.0))
    for method, known in (
        (white_residual_test, NAMES),
        (derivative_regression, [n for n in NAMES if n != "heading_bias"]),
    ):
        ranking = method(data, NAMES).ranking
        assert sorted(name for name, _ in ranking) == sorted(known)
        scores = [score for _, score in ranking]
        assert np.all(np.diff(scores) <= 0)
        assert np.all(np.isfinite(scores))


def test_settings_and_one_set_per_run_are_candidates_too():
    data = trials("current", (0.3, 0.0))
    ranking = dict(white_residual_test(data, ["current", "current_per_run", "bank_suction", "rudder_stall"]).ranking)
    assert set(ranking) == {"current", "current_per_run", "bank_suction", "rudder_stall"}
    assert ranking["current"] > ranking["current_per_run"], "one vector for all runs costs less than six"
