"""Forward selection: which candidates are refitted, and which cannot be told apart."""

from __future__ import annotations

import numpy as np
import pytest
from made_fits import RUNS, made_fit, made_plant

from shipbench.diagnosis.selection.screening import Score
from shipbench.diagnosis.selection.stepwise import (
    CONFUSED,
    Step,
    candidates_for,
    push_alike,
    shows_in_record,
    worth_a_refit,
)
from shipbench.effects.base import EFFECTS
from shipbench.estimation.term import Term


def step(number: int, name: str, score: float) -> Step:
    return Step(number, Term(EFFECTS.get(name)), score, 0)


def score(name: str, value: float) -> Score:
    term = Term(EFFECTS.get(name))
    return Score(term, value, np.zeros(term.size), np.ones(term.size), np.eye(term.size), np.zeros(RUNS))


def test_a_candidate_of_the_same_round_is_near_within_the_evidence_of_a_cause():
    best = step(1, "heading_bias", 90.0)
    assert step(1, "rudder_offset", 90.1 - CONFUSED).is_near(best)
    assert not step(1, "rudder_offset", 89.9 - CONFUSED).is_near(best)
    assert not step(0, "rudder_offset", 90.0).is_near(best)


def test_effects_of_one_group_with_formulas_of_their_own_push_alike():
    wind, waves, current = (EFFECTS.get(name) for name in ("wind", "wave_drift", "current"))
    assert push_alike(wind, waves)
    assert push_alike(waves, wind)
    assert not push_alike(wind, wind)
    assert not push_alike(wind, current)
    best = step(0, "wind", 1000.0)
    assert step(0, "wave_drift", 1000.0 - 2.0 * CONFUSED).is_near(best)  # by a share of a large score
    assert not step(0, "current", 1000.0 - 2.0 * CONFUSED).is_near(best)


@pytest.mark.parametrize(
    ("name", "shows"),
    [("rudder_deadband", True), ("rudder_lag", False), ("rudder_offset", False), ("current", False)],
)
def test_what_acts_between_command_and_record_alone_is_not_looked_for_in_recorded_motion(name: str, shows: bool):
    assert shows_in_record(EFFECTS.get(name)) is shows
    recorded, commanded = (
        {t.label for t in candidates_for(made_plant(3, commanded=commanded))} for commanded in (False, True)
    )
    assert name in commanded
    assert (name in recorded) is not shows


def test_candidates_are_those_that_are_asked_for_less_the_settled():
    plant = made_plant(3)
    assert {t.label for t in candidates_for(plant, ("current", "heading_bias"))} == {"current", "heading_bias"}
    assert {t.label for t in candidates_for(plant, ("current", "heading_bias"), ("current",))} == {"heading_bias"}


def test_nothing_is_refitted_where_the_best_promises_too_little():
    fit = made_fit()
    assert worth_a_refit([], fit, 10.0) == []
    assert worth_a_refit([score("heading_bias", 0.01)], fit, 10.0) == []
