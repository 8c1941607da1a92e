"""What a fitted form lacks of a ship explains small causes as well, and leaves large ones their evidence."""

from __future__ import annotations

from dataclasses import replace

import pytest

from shipbench.diagnosis.selection.form_error import FormError, beside_form
from shipbench.diagnosis.selection.requirements import BEYOND_FORM, Standard
from shipbench.diagnosis.thresholds import THRESHOLDS
from shipbench.effects.base import EFFECTS
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import fit
from shipbench.estimation.laplace import Fit, Model
from shipbench.estimation.linearisation import Scales
from shipbench.estimation.term import Term
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials

EXACT = Trials(runs=6, noise=0.1, gusts=0.0)


def with_cause(plant: Plant, name: str, *setting: float) -> Fit:
    null = null_fit(plant, Scales(plant))
    model = Model(terms=(Term(EFFECTS.get(name), setting),))
    return fit(plant, null.scales, model, null.point, null.hyper, {})


@pytest.fixture(scope="module")
def offset() -> Fit:
    hidden = (Hidden(EFFECTS.get("rudder_offset"), (0.03,)),)
    return with_cause(Plant.of(sea_trials(load_mmg_ship("container130"), 3, hidden, EXACT)), "rudder_offset")


def test_without_a_form_error_the_score_is_that_of_the_fit(offset):
    form, without = FormError(offset), offset.solution_without(0)
    scores = form.evidence([0.0] * 3) - form.evidence([0.0] * 3, form.without(0))
    assert scores == pytest.approx(offset.solution.log_evidence - without.log_evidence, rel=0.1)


def test_a_true_cause_keeps_its_evidence_beside_a_form_error(offset):
    assert offset.worth(0) > FormError(offset).score(0) > 2.0 * THRESHOLDS.value("evidence")


def test_a_larger_form_error_leaves_a_cause_less(offset):
    form = FormError(offset)
    left = [form.evidence([size] * 3) - form.evidence([size] * 3, form.without(0)) for size in (0.0, 0.2, 2.0)]
    assert left[0] > left[1] > left[2]


@pytest.mark.long
def test_where_only_a_form_tells_a_place_on_the_ship_the_place_is_no_cause():
    """Her equations are not of the fitted form. Exact sensors show that, as an antenna ahead of midship whose
    velocities are its own."""
    plant = Plant.of(published_trials(PUBLISHED["navy"], 7, (), Trials(runs=12, noise=0.1, gusts=0.0)))
    found = with_cause(plant, "antenna_offset", 1.0)
    assert found.worth(0) > THRESHOLDS.value("evidence")
    assert not BEYOND_FORM.check(found, 0, Standard(found, THRESHOLDS.value("evidence"))).met


def test_values_of_single_runs_are_no_form_error(offset):
    fit = replace(offset, model=Model(terms=(Term(EFFECTS.get("current_per_run"), (), True),)))
    assert BEYOND_FORM.check(fit, 0, Standard(fit, 1e9)).met


def test_without_candidates_no_information_is_asked_for(offset):
    assert beside_form(offset, []) == []
