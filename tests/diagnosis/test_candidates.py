"""Candidates: one line for each effect of the library, with the reason why it was not identified."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import RUNS, made_analysis, made_fit

from shipbench.diagnosis.actuators.kinds import GearFinding
from shipbench.diagnosis.candidates import describe_candidates
from shipbench.diagnosis.result import Candidate
from shipbench.diagnosis.selection.analysis import HULL_THRESHOLD, Analysis
from shipbench.diagnosis.selection.requirements import detection_limit
from shipbench.diagnosis.selection.screening import Score
from shipbench.diagnosis.selection.stepwise import Step
from shipbench.diagnosis.selection.unknown import Dependence
from shipbench.effects.base import EFFECTS
from shipbench.estimation.term import Term
from shipbench.physics.actuators import Gear


def score(name: str, value: float, information: float = 1e4) -> Score:
    effect = EFFECTS.get(name)
    term = Term(effect, tuple(p.typical for p in effect.parameters if p.shape))
    return Score(
        term, value, np.zeros(term.size), np.ones(term.size), information * np.eye(term.size), np.zeros(RUNS)
    )  # fmt: skip


def analysis(*scores: Score, terms: tuple[str, ...] = (), **changes) -> Analysis:
    """The plain model and the scores beside it; `changes` of the selection."""
    final = made_fit([Term(EFFECTS.get(name)) for name in terms])
    found = made_analysis(final)
    selection = replace(found.selection, null=made_fit(), first=list(scores), **changes)
    return replace(found, selection=selection, null_draws=np.linspace(0.0, 9.0, 10))


def lines(found: Analysis, named: tuple[str, ...] = (), measured: bool = True) -> dict[str, Candidate]:
    return {c.effect: c for c in describe_candidates(found, named, measured)}


def test_every_effect_has_one_line_and_the_best_stands_first():
    told = describe_candidates(analysis(score("current", 4.0), score("list", 8.0)), (), True)
    assert sorted(c.effect for c in told) == sorted(EFFECTS.names())
    assert [c.effect for c in told[:2]] == ["list", "current"]
    assert all(c.rejected_because for c in told)


@pytest.mark.parametrize(
    ("name", "value", "information", "reason"),
    [
        ("rudder_offset", 9.9, 1e4, "score 9.9 below the threshold 10"),
        ("rudder_offset", 9.9, 0.1, "these data cannot separate it from the fitted coefficients"),
        ("rudder_offset", 30.0, 1e4, "score 30, but the better candidates gain nothing once they are fitted"),
    ],
)
def test_the_reason_follows_score_and_information(name: str, value: float, information: float, reason: str):
    found = analysis(score(name, value, information), steps=[Step(0, Term(EFFECTS.get("list")), 1.0, 0)])
    assert lines(found)[name].rejected_because == reason


def test_what_is_named_kept_in_doubt_unmet_or_explained_is_told_so():
    scores = [score(n, 40.0) for n in ("heading_bias", "current", "list", "rudder_offset")]
    told = lines(
        analysis(*scores, terms=("heading_bias", "current"), unmet={"list": "too small"}), named=("heading_bias",)
    )
    assert told["heading_bias"].rejected_because == "named"
    assert told["current"].rejected_because == "in the model, but not named while the ship file is in doubt"
    assert told["list"].rejected_because == "score 40, but too small"
    assert told["rudder_offset"].rejected_because == "explained by heading_bias (40 alone)"


def test_an_unknown_force_that_explains_more_is_told():
    unknown = Dependence("heading", "yaw", "form", 90.0, 0.5, 1.0, 1.0)
    told = lines(replace(analysis(score("list", 40.0)), unknown=unknown))
    assert told["list"].rejected_because == "a dependence on heading explains more (90 against 40)"


def test_the_detection_limit_is_that_of_the_requirements_in_the_unit_of_the_effect():
    seen = score("rudder_offset", 4.0)
    found = analysis(seen)
    (least,) = detection_limit(seen, found.standard)
    typical = EFFECTS.get("rudder_offset").sized(130.0)[0].typical
    assert lines(found)["rudder_offset"].detectable["offset"] == pytest.approx(abs(typical) * least)
    hopeless = lines(analysis(score("rudder_offset", 4.0, 1e-4)))
    assert np.isnan(hopeless["rudder_offset"].detectable["offset"])  # beyond its bounds


def test_of_two_findings_on_one_actuator_the_better_one_is_told_of():
    one, other = (
        GearFinding(name, value, 2.0, (1.0, 3.0), np.ones(RUNS), "delta", Gear(1.0, 1.0), 0.5)
        for name, value in (("rudder_lag", 60.0), ("rudder_delay", 50.0))
    )
    told = lines(replace(analysis(), all_gears=(one, other)), named=("rudder_lag",))
    assert told["rudder_lag"].rejected_because == "named"
    assert told["rudder_delay"].rejected_because == "rudder_lag explains the same actuator better (60 against 50)"
    low = lines(replace(analysis(), all_gears=(replace(other, score=3.0),)))
    assert low["rudder_delay"].rejected_because == "score 3 below the threshold 10"


@pytest.mark.parametrize(
    ("hull", "measured", "reason"),
    [
        (HULL_THRESHOLD - 1.0, True, "below the threshold"),
        (HULL_THRESHOLD + 1.0, True, "not shown to pay on held-out runs"),
        (HULL_THRESHOLD + 1.0, False, "which was not measured"),
    ],
)
def test_the_hull_is_named_by_its_evidence_and_its_gain(hull: float, measured: bool, reason: str):
    told = lines(replace(analysis(), hull=hull), measured=measured)
    (candidate,) = (c for n, c in told.items() if EFFECTS.get(n).traits.search == "hull")
    assert reason in candidate.rejected_because
    assert candidate.score == hull
