"""What makes the search for causes quick leaves what it finds: shared linearisations, all changes at once, traces
without the matrices."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.selection.screening import _changes, screen
from shipbench.diagnosis.selection.stepwise import Beginning, candidates_for, refits
from shipbench.effects.base import EFFECTS
from shipbench.estimation import baseline
from shipbench.estimation import gauss_newton as refit
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import Origin, fit, looking_at
from shipbench.estimation.gram import background, background_cov, update_force
from shipbench.estimation.laplace import Fit, Model, at_point, hull_evidence, once_followed, settle
from shipbench.estimation.linearisation import Linearisation, Scales
from shipbench.estimation.thresholds import THRESHOLDS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials

NAMES = ("current", "heading_bias", "wind_per_run", "speed_scale", "rudder_delay")


@pytest.fixture(scope="module")
def null() -> Fit:
    """A compass error is hidden; candidates of all three kinds, one with values per run."""
    plant = Plant.of(
        sea_trials(load_mmg_ship("kcs"), 3, (Hidden(EFFECTS.get("heading_bias"), (0.04,)),), Trials(runs=8, samples=60))
    )
    return null_fit(plant, Scales(plant), candidates_for(plant, NAMES))


@pytest.mark.long
@pytest.mark.parametrize("actuators", ["measured", pytest.param("commanded", marks=pytest.mark.long)])
def test_every_candidate_has_a_slope_at_whatever_size(actuators):
    """Else its fit rests where it begins: the delay of a recorded rudder had one at zero alone, and was never found."""
    plant = Plant.of(
        replace(sea_trials(load_mmg_ship("container130"), 4, (), Trials(runs=8, samples=70)), actuators=actuators)
    )
    found = null_fit(plant, Scales(plant))
    for term in candidates_for(plant):
        value = np.full((plant.seg.runs, term.size) if term.per_run else term.size, 0.31)
        at = Linearisation(plant, found.scales, replace(found.point, terms=(term,), values=(value,)), found.motion)
        assert np.all(np.abs(at.columns().own[0]).sum(axis=(0, 1)) > 1e-3), term


def test_a_refit_from_the_shared_linearisation_is_the_one_from_its_own(null):
    origin, scores = Origin.of(null.plant, null.scales), {s.term.label: s for s in reversed(screen(null))}
    together = Beginning.of(null, origin, [s.term for s in scores.values()])
    for name in ("heading_bias", "current", "wind_per_run"):
        alone = Beginning.of(null, origin, [scores[name].term])
        assert together.refit(scores[name]).evidence == pytest.approx(alone.refit(scores[name]).evidence, abs=1e-3)


def test_the_cost_once_the_force_has_followed_needs_no_other_sensitivities(null):
    """A trial point is judged by it many times a fit."""
    point = replace(null.point, base=null.point.base + 0.3)
    lin = Linearisation(null.plant, null.scales, point, null.motion, coarse=False)
    cost = once_followed(lin, null.model, null.hyper, null.log_tau2)
    whole = settle(lin, null.model, null.hyper, null.log_tau2, leap=0.0)
    assert cost == pytest.approx(at_point(whole, point) + np.sum(whole.reduced.logdet), rel=1e-9)


def test_a_refit_that_cannot_be_the_best_is_given_up_and_the_best_is_not(null):
    """Of ten refits on a record of 2.5 h seven went on to rest, 90 to 270 of log evidence behind the best."""
    origin, scores = Origin.of(null.plant, null.scales), {s.term.label: s for s in reversed(screen(null))}
    start = Beginning.of(null, origin, [s.term for s in scores.values()])
    best, other = start.refit(scores["heading_bias"]), start.refit(scores["rudder_delay"])
    gain = 2.0 * (best.evidence - null.evidence)
    assert start.refit(scores["heading_bias"], rival=gain - 40.0).evidence == best.evidence
    less = start.refit(scores["rudder_delay"], rival=gain - 40.0)
    assert less.evidence <= other.evidence < best.evidence - 20.0
    assert 2.0 * (less.promise - null.evidence) < gain - 40.0
    of_all = refits(null, [scores["rudder_delay"], scores["heading_bias"]], origin, 10.0, lambda f: gain)
    assert max(score for _, score in of_all) == pytest.approx(gain)


@pytest.mark.long
def test_a_gear_that_fits_worse_is_given_up_and_the_best_is_not(monkeypatch):
    trials = sea_trials(load_mmg_ship("container130"), 4, (), Trials(runs=8, samples=70))
    plant = Plant.of(replace(trials, actuators="commanded"))
    quick, real = null_fit(plant, Scales(plant)), baseline.fit

    def to_rest(*given, hope=None, rival=None, **others):
        return real(*given, **others)

    monkeypatch.setattr(baseline, "fit", to_rest)
    whole = null_fit(plant, Scales(plant))
    assert quick.plant.ordinary == whole.plant.ordinary
    assert quick.evidence == pytest.approx(whole.evidence, abs=0.1)


def test_where_free_steps_lead_astray_each_step_lowers_the_cost(null, monkeypatch):
    """A current on a ship of 56 m with positions of 1.5 m noise: the first step raised the cost twelve times, and no
    later one came back."""
    origin, model, real = Origin.of(null.plant, null.scales), Model(), refit._step

    def astray(lin, found, free, share):
        return None if free else real(lin, found, free, share)

    def fitted(lost: float) -> float:
        row = THRESHOLDS.rows["led_astray"]
        monkeypatch.setitem(THRESHOLDS.rows, row.name, replace(row, value=lost))
        return fit(null.plant, null.scales, model, origin.point, origin.hyper, guess=origin.motion, far=True).evidence

    rest = fitted(np.inf)
    monkeypatch.setattr(refit, "_step", astray)
    assert fitted(np.inf) < rest - 30.0
    assert fitted(10.0) == pytest.approx(rest, abs=1.0)


def test_a_fit_that_goes_on_near_rest_takes_no_free_steps(null, monkeypatch):
    """They led 200 of log evidence away and back: the plain model of 90 runs took 13 linearisations from rest to the
    same place."""
    taken, real = [], refit._step

    def step(lin, found, free, share):
        taken.append((found.excess, free))
        return real(lin, found, free, share)

    monkeypatch.setattr(refit, "_step", step)
    beside = replace(null.point, base=null.point.base + 0.01)
    again = fit(null.plant, null.scales, null.model, beside, null.hyper, guess=null.motion)
    assert 1.0 < taken[0][0] < 30.0
    assert not any(free for _, free in taken)
    assert again.evidence == pytest.approx(null.evidence, abs=0.5)
    taken.clear()
    origin = Origin.of(null.plant, null.scales)
    fit(null.plant, null.scales, null.model, origin.point, origin.hyper, guess=origin.motion, far=True)
    assert taken[0][1]


def test_beside_a_cause_in_the_model_the_others_begin_with_it(null):
    origin, scores = Origin.of(null.plant, null.scales), {s.term.label: s for s in reversed(screen(null))}
    first = Beginning.of(null, origin, [scores["heading_bias"].term]).refit(scores["heading_bias"])
    assert 2.0 * (first.evidence - null.evidence) > 20.0
    now = looking_at(first, null.candidates)
    assert now.evidence == pytest.approx(first.evidence, abs=0.1)
    beside = Beginning.of(now, origin, [scores["speed_scale"].term]).refit(scores["speed_scale"])
    assert [t.label for t in beside.model.terms] == ["heading_bias", "speed_scale"]
    assert beside.values[0] == pytest.approx(first.values[0], rel=0.1)


def test_a_force_that_begins_with_a_run_touches_no_run_before(null):
    late = replace(next(t for t in null.candidates if t.label == "current"), since=5)
    columns = Linearisation(null.plant, null.scales, null.point, null.motion).columns([late]).candidates[0]
    moved = np.abs(columns).max(axis=(1, 2)) > 0.0
    assert (moved == (null.plant.seg.run >= 5)).all()


def test_changes_at_many_runs_are_those_of_each_alone():
    rng = np.random.default_rng(1)
    Z = rng.standard_normal((10, 30, 6))
    S = np.swapaxes(Z, 1, 2) @ Z
    base, prior, cols = np.array([0, 1]), np.array([1.0, 0.5]), np.array([2, 4])
    gated = np.cumsum(S[::-1], axis=0)[::-1]
    scores, values = _changes(S.sum(axis=0), gated[[3, 6]], base, prior, cols, 1.5)
    keep = np.array([0, 1, 2, 4])
    precision = np.array([1.0, 0.5, 1.0, 1.0])
    for k, score, value in zip((3, 6), scores, values, strict=True):
        total, late = S.sum(axis=0), S[k:].sum(axis=0)
        plain = total[np.ix_(keep, keep)] + np.diag(precision)
        both = np.block(
            [[plain, late[np.ix_(keep, cols)]], [late[np.ix_(cols, keep)], late[np.ix_(cols, cols)] + np.eye(2)]]
        )
        b = np.append(total[keep, -1], late[cols, -1])
        gain = b @ np.linalg.solve(both, b) - np.linalg.slogdet(both)[1]
        gain -= b[:4] @ np.linalg.solve(plain, b[:4]) - np.linalg.slogdet(plain)[1]
        assert score == pytest.approx(gain - 1.5, rel=1e-9)
        assert value == pytest.approx(np.linalg.solve(both, b)[4:], rel=1e-9)


def test_variances_of_the_force_need_no_matrix_of_a_segment(null):
    term = next(t for t in null.candidates if t.per_run)
    lin = Linearisation(
        null.plant, null.scales, replace(null.point, terms=(term,), values=(np.zeros((8, 2)),)), null.motion
    )
    found = settle(lin, replace(null.model, terms=(term,)), null.hyper, {0: -1.0}, leap=0.0)
    gram, reduced, prior, solution = found.gram, found.reduced, found.prior, found.solution
    estimate, cov = background(gram, reduced, prior, solution), background_cov(gram, reduced, prior, solution)
    expected = []
    for j in range(3):
        at = slice(6 + j * gram.knots, 6 + (j + 1) * gram.knots)
        w = estimate[:, at]
        expected.append(np.log((np.sum(w @ gram.K_inv * w) + np.sum(gram.K_inv * cov[:, at, at].sum(axis=0))) / w.size))
    free = np.array(expected) > 2.0 * np.log(0.1)  # the least that a force may be
    assert free.any()
    assert update_force(gram, reduced, prior, solution, estimate)[free] == pytest.approx(
        np.array(expected)[free], abs=1e-9
    )


def test_the_evidence_for_a_hull_off_the_regressions_is_that_of_two_linear_models(null):
    lin = Linearisation(null.plant, null.scales, null.point, null.motion)
    wide, narrow = (
        settle(lin, replace(null.model, hull=width), null.hyper, null.log_tau2).solution.log_evidence
        for width in (1.0, 0.1)
    )
    assert hull_evidence(null) == pytest.approx(2.0 * (wide - narrow), abs=0.05)


def test_a_refit_ends_where_another_start_does(plant):
    """The evidence belongs to the model, not to the path of the fit."""
    scales = Scales(plant)
    origin = Origin.of(plant, scales)
    one = fit(plant, scales, Model(), origin.point, origin.hyper, guess=origin.motion)
    far = replace(origin.point, base=origin.point.base + 0.5 * np.cos(np.arange(len(origin.point.base))))
    other = fit(plant, scales, Model(), far, origin.hyper, guess=origin.motion)
    assert other.evidence == pytest.approx(one.evidence, abs=0.5)
