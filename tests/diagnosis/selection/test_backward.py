"""Backward elimination of causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import RUNS, fit_of, fit_to, made_fit

from shipbench.diagnosis.selection import backward
from shipbench.diagnosis.selection.backward import needed_only, wanted_only, without
from shipbench.diagnosis.selection.requirements import EVIDENCE, SIGNIFICANT, Standard
from shipbench.effects.base import EFFECTS
from shipbench.estimation.gauss_newton import start
from shipbench.estimation.laplace import Fit
from shipbench.estimation.term import Term

TERMS = tuple(Term(EFFECTS.get(name)) for name in ("rudder_offset", "thrust_gain", "mass_change"))


def fit_with(*sizes: float) -> Fit:
    """Causes of these sizes, each with information 9 in every run."""
    S = np.zeros((RUNS, len(sizes) + 1, len(sizes) + 1))
    S[:] = np.diag([*[9.0] * len(sizes), 1.0])
    S[:, :-1, -1] = S[:, -1, :-1] = 9.0 * np.array(sizes)
    return fit_to(TERMS[: len(sizes)], S)


@pytest.fixture
def refitted(monkeypatch):
    """Effects that were taken out, in their order; a refit says what the linearisation said."""
    dropped = []

    def known(before: Fit, index: int) -> Fit:
        dropped.append(before.model.terms[index].label)
        sizes = [float(v[0]) for i, v in enumerate(before.values) if i != index]
        terms = tuple(t for i, t in enumerate(before.model.terms) if i != index)
        evidence = before.solution_without(index).log_evidence
        return made_fit(terms, [np.array([s]) for s in sizes], log_evidence=evidence)

    monkeypatch.setattr(backward, "without", known)
    return dropped


def test_what_is_worth_less_than_is_asked_is_dropped_but_the_last_one(refitted):
    fit, standard = fit_with(1.0, 0.01), Standard(made_fit(), 10.0)
    assert EVIDENCE.check(fit, 0, standard).met
    assert not EVIDENCE.check(fit, 1, standard).met
    assert needed_only(fit, standard) is fit  # the last one was just added
    assert [t.label for t in needed_only(fit, standard, spare_last=False).model.terms] == ["rudder_offset"]
    assert refitted == ["thrust_gain"]


def test_what_a_refit_still_needs_is_kept(monkeypatch):
    fit, standard = fit_with(1.0, 0.01), Standard(made_fit(), 10.0)
    monkeypatch.setattr(backward, "without", lambda before, index: made_fit(log_evidence=before.evidence - 100.0))
    assert needed_only(fit, standard, spare_last=False) is fit


def test_what_does_not_meet_a_requirement_goes_the_last_first_with_its_reason(refitted):
    kept, reasons = wanted_only(fit_with(0.001, 1.0, 0.001), (SIGNIFICANT,), Standard(made_fit(), 10.0))
    assert [t.label for t in kept.model.terms] == ["thrust_gain"]
    assert refitted == ["mass_change", "rudder_offset"]
    assert set(reasons) == set(refitted)
    assert all("not practically significant" in reason for reason in reasons.values())


def test_whoever_is_told_the_names_keeps_them_all(refitted):
    fit = fit_of(np.full(RUNS, 0.001))
    assert wanted_only(fit, (SIGNIFICANT,), Standard(made_fit(), 0.0, careful=False)) == (fit, {})
    assert refitted == []


def test_a_refit_without_a_term_loses_that_one_alone(plant):
    terms, values = (Term(EFFECTS.get("heading_bias")), Term(EFFECTS.get("rudder_offset"))), (np.zeros(1), np.zeros(1))
    point, hyper = start(plant)
    both = replace(made_fit(terms, values, plant), point=replace(point, terms=terms, values=values), hyper=hyper)
    less = without(replace(both, motion=plant.seg.states[..., :6]), 0)
    assert [t.label for t in less.model.terms] == ["rudder_offset"]
    assert less.excess < 1.0
