"""One list of requirements decides, explains and counts the detection limit."""

from __future__ import annotations

import importlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from made_fits import RUNS, fit_of, made_fit

from shipbench.diagnosis.selection import requirements
from shipbench.diagnosis.selection.requirements import (
    REQUIREMENTS,
    SURE,
    Requirement,
    Standard,
    Verdict,
    detection_limit,
    first_unmet,
)
from shipbench.diagnosis.selection.screening import Score
from shipbench.effects.base import EFFECTS, Effect
from shipbench.effects.traits import Traits
from shipbench.estimation.term import Term

EXAMPLE = Path(__file__).parents[3] / "examples" / "shipbench-example"


class Never(Requirement):
    """No cause meets it."""

    def check(self, fit, index, standard) -> Verdict:
        return Verdict(False, "never met")

    def least_size(self, seen, standard) -> float:
        return 7.0


class Always(Requirement):
    """Every cause meets it."""

    def check(self, fit, index, standard) -> Verdict:
        return Verdict(True)


def test_the_first_requirement_that_is_not_met_gives_the_reason():
    fit = fit_of(np.zeros(RUNS))
    assert first_unmet((Always(), Never()), fit, 0, Standard(fit, 10.0)) == Verdict(False, "never met")
    assert first_unmet((Always(),), fit, 0, Standard(fit, 10.0)).met


def _seen(effect: str = "rudder_offset", information: float = 900.0) -> Score:
    term = Term(EFFECTS.get(effect))
    return Score(term, 50.0, np.zeros(term.size), np.nan, information * np.eye(term.size), np.zeros(RUNS))


def test_the_detection_limit_is_what_the_most_demanding_requirement_asks_for(monkeypatch):
    fit = made_fit()
    limit = detection_limit(_seen(), Standard(fit, 10.0))
    assert limit == pytest.approx(np.sqrt((10.0 + np.log(901.0)) / 900.0))
    assert detection_limit(_seen(), Standard(fit, 40.0)) > limit
    assert detection_limit(_seen(information=1e9), Standard(fit, 10.0)) == Traits().least_size
    beside_form = replace(_seen(), beside_form=9.0 * np.eye(1))  # of 900 a form error leaves 9
    assert detection_limit(beside_form, Standard(fit, 10.0)) == pytest.approx(np.sqrt((10.0 + np.log(10.0)) / 9.0))
    monkeypatch.setattr(requirements, "REQUIREMENTS", (*REQUIREMENTS, Never()))
    assert detection_limit(_seen(), Standard(fit, 10.0)) == 7.0


class Stranger(Effect):
    """An effect of a plug-in, of which shipbench knows nothing but what it states itself."""

    family = "hull"
    parameters = EFFECTS.get("mass_change").parameters
    traits = Traits(between_ships=True, absorbs_misfit=True, least_size=0.4)


def test_an_effect_of_a_plug_in_is_asked_the_same_as_one_of_the_library():
    own, theirs = Term(EFFECTS.get("mass_change")), Term(Stranger())
    standard = Standard(fit_of(np.zeros(RUNS)), 10.0, off_form=5.0)
    assert standard.asked_besides(theirs) == standard.asked_besides(own) > 5.0
    fit = made_fit()
    seen = Score(theirs, 50.0, np.zeros(1), np.nan, 1e9 * np.eye(1), np.zeros(RUNS))
    assert detection_limit(seen, Standard(fit, 10.0)) == 0.4


def test_the_effect_of_the_example_package_is_a_candidate_and_meets_the_same_requirements(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    effect = importlib.import_module("shipbench_example.barge_alongside").EFFECT
    term, standard = Term(effect), Standard(fit_of(np.zeros(RUNS)), 10.0, off_form=5.0)
    assert (
        standard.asked_besides(term) == standard.asked_besides(Term(EFFECTS.get("current"))) == 0.0
    )  # neither differs between ships
    assert standard.asked_besides(Term(effect, since=3)) == 5.0
    own = fit_of(np.full(RUNS, 0.5), term=term)
    met = first_unmet(SURE, own, 0, standard)
    assert met == Verdict(True)
    scattered = fit_of(0.5 + 3.0 * np.resize([1.0, -1.0], RUNS), term=term)
    assert first_unmet(SURE, scattered, 0, standard) == Verdict(
        False, "the runs do not agree that its size differs from zero"
    )


def test_whoever_is_told_the_names_asks_for_no_evidence():
    assert (
        Standard(fit_of(np.zeros(RUNS)), 0.0, off_form=5.0, careful=False).asked_besides(
            Term(EFFECTS.get("mass_change"))
        )
        == 0.0
    )
