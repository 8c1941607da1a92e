"""Effects are hidden in runs of the MMG ships, on hulls that the fit does not know, and must be found.

Draws change with the source of shipbench and are the same for one commit: the seed is in the message, and
`SHIPBENCH_SEED=n` sets it.
"""

from __future__ import annotations

import os
import random
from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_analysis, made_fit

from shipbench.bench.provenance import source_digest
from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.result import Diagnosis
from shipbench.diagnosis.selection.analysis import THRESHOLD
from shipbench.diagnosis.selection.screening import changes, screen
from shipbench.diagnosis.selection.ship_file import whatever_the_ship
from shipbench.diagnosis.selection.stepwise import absorbed, candidates_for, select
from shipbench.effects.base import EFFECTS
from shipbench.errors import InputError
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import Origin
from shipbench.estimation.linearisation import Scales
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.published import PUBLISHED, published_trials
from shipbench.simulate.trials import Trials, sea_trials
from shipbench.suites.diagnosis.cases import ON_PUBLISHED, draw_case, singles
from shipbench.suites.diagnosis.unmodelled import canonical

SEED = int(os.environ.get("SHIPBENCH_SEED", int(source_digest(), 16) % 10_000))
CLEAR = (
    "current", "heading_bias", "yaw_rate_bias", "speed_scale", "antenna_offset", "velocity_delay", "rudder_lag",
    "rudder_backlash",
    "shaft_rate_limit",
)  # fmt: skip
DRAWN = tuple(random.Random(SEED).sample(CLEAR, 4))
SHORT = Trials(runs=16, samples=100)


def _trials(*hidden: Hidden, runs: int = 12, samples: int = 90, seed: int = 3) -> Dataset:
    return sea_trials(load_mmg_ship("kcs"), seed, hidden, Trials(runs=runs, samples=samples))


@pytest.mark.long
@pytest.mark.parametrize("names", [DRAWN, pytest.param(CLEAR, marks=pytest.mark.long)], ids=["drawn", "all"])
def test_fresh_draws_of_clear_effects_at_their_typical_size_are_named_first(names):
    found = {}
    for index in [i for i, name in enumerate(singles()) if name in names]:
        case = draw_case("single", index, SEED, "test", Trials(runs=16, samples=80))
        assert case.size == (1.0,)
        verdict = diagnose(case.dataset(), gain=False)
        found[case.truth[0]] = [c.effect for c in verdict.causes]
    wrong = {truth: named for truth, named in found.items() if named[:1] != [truth]}
    assert len(found) == len(names)
    assert len(wrong) <= len(names) // 4, f"seed {SEED}: {wrong}"


def test_no_workers_are_refused_before_any_work():
    with pytest.raises(InputError, match=r"workers: 0; accepted: whole numbers from 1\."):
        diagnose(_trials(runs=2, samples=20), workers=0)


@pytest.fixture(scope="module")
def drifting() -> tuple[Dataset, Diagnosis]:
    """Runs in a current, and what one process says of them."""
    data = _trials(Hidden(EFFECTS.get("current"), (0.25, -0.2)), runs=10, samples=60)
    return data, diagnose(data, workers=1)


@pytest.mark.long
@pytest.mark.parametrize("found", [True, pytest.param(False, marks=pytest.mark.long)])
def test_two_processes_say_what_one_says(drifting, found):
    """The first part is fitted beside the whole there, before it is known whether anything is found and what the
    threshold is."""
    plain = _trials(runs=8, samples=50)
    data, one = drifting if found else (plain, diagnose(plain, workers=1))
    assert one.verdict == ("found" if found else "none")
    one, two = (replace(d, seconds=0.0, trace=None).document() for d in (one, diagnose(data, workers=2)))
    assert two == one


@pytest.mark.long
def test_nothing_is_named_on_most_fresh_ships_without_a_hidden_effect():
    named = {}
    for kind, index in (("none-same", 0), ("none-other", 0), ("none-published", 0), ("none-published", 1)):
        verdict = diagnose(draw_case(kind, index, SEED, "test", Trials(runs=16, samples=100)).dataset(), gain=False)
        named[f"{kind} {index}"] = [c.effect for c in verdict.causes]
    assert sum(bool(n) for n in named.values()) <= 1, f"seed {SEED}: {named}"


@pytest.mark.long
@pytest.mark.parametrize("ship", random.Random(SEED).sample(range(len(PUBLISHED)), 2), ids=["drawn", "another"])
def test_causes_are_found_on_ships_of_the_literature_in_their_own_equations(ship):
    """One of a current, a compass error and a speed log's: the three share no equation with the fit."""
    effect = ("current", "heading_bias", "speed_scale")[(SEED + ship) % 3]
    case = draw_case(
        "published", len(PUBLISHED) * ON_PUBLISHED.index(effect) + ship, SEED, plan=Trials(runs=16, samples=80)
    )
    assert case.truth == (effect,)
    named = [c.effect for c in diagnose(case.dataset(), gain=False).causes]
    assert named[:1] == [effect], f"seed {SEED}: {named} on {case.ship.name}"


@pytest.mark.long
def test_what_ships_differ_in_is_not_named_for_a_hull_of_another_form():
    """A container ship that heels, with nothing hidden: what her forces lack of the fit's form looks like a rudder that
    answers late."""
    verdict = diagnose(published_trials(PUBLISHED["s175"], 40), gain=False)
    late = next(c for c in verdict.candidates if c.effect == "rudder_delay")
    assert late.score > THRESHOLD
    assert "for effects in which ships differ" in late.rejected_because
    assert not verdict.causes


@pytest.mark.long
def test_a_change_that_one_run_alone_speaks_for_is_none():
    """A container ship that heels, with nothing hidden: one run of 24 carries a score of 16 for a centre of gravity
    that moved."""
    data = published_trials(PUBLISHED["s175"], 25)
    plant = Plant.of(data)
    null = null_fit(plant, Scales(plant), candidates_for(plant))
    assert all(s.score < THRESHOLD for s in changes(null))


@pytest.mark.long
def test_a_current_shows_where_the_plain_model_rests_and_where_nothing_is_fitted_yet():
    """A hull damped the wrong way had absorbed it: nothing of it was left where the plain model rested, but for a refit
    from the origin."""
    plant = Plant.of(_trials(Hidden(EFFECTS.get("current"), (0.25, -0.2))))
    null = null_fit(plant, Scales(plant), candidates_for(plant, ("current", "heading_bias", "speed_scale")))
    at_rest, at_origin = screen(null), absorbed([], null, THRESHOLD, Origin.of(null.plant, null.scales))
    assert [scores[0].term.label for scores in (at_rest, at_origin)] == ["current", "current"]
    assert at_rest[0].score > THRESHOLD
    found = select(null, THRESHOLD)
    assert [t.label for t in found.final.model.terms] == ["current"]
    assert found.final.evidence - found.null.evidence > 50.0


@pytest.mark.long
def test_a_strong_wind_in_every_run_is_found_on_a_ship_far_from_the_regressions():
    """Her fit is far from linear in it: the variance of its values vanished, and no run seemed to support it."""
    cause = diagnose(draw_case("published", 60, 0).dataset(), gain=False).causes[0]
    assert cause.effect == "wind_per_run"
    assert cause.support == "24 of 24 runs"


@pytest.mark.long
def test_a_hidden_current_is_sized_and_pays_on_runs_that_were_not_fitted(drifting):
    _, verdict = drifting
    cause = verdict.causes[0]
    assert verdict.verdict == "found"
    assert cause.effect == "current"
    assert verdict.extended_model.startswith("calibrated+current")
    assert cause.parameters["speed"].value == pytest.approx(np.hypot(0.25, 0.2), rel=0.15)
    assert np.sin(cause.parameters["to"].value - np.arctan2(-0.2, 0.25)) == pytest.approx(0.0, abs=0.15)
    assert verdict.gain is not None
    assert verdict.gain.relative > 0.15  # beside the calibrated ship, which absorbs a part of it
    assert verdict.gain.ci95[0] > 0.0
    assert {c.effect for c in verdict.candidates} == set(EFFECTS.names())
    assert verdict.what_is_wrong
    assert sum(w.share_of_error for w in verdict.what_is_wrong) <= 1.0


@pytest.mark.long
def test_two_effects_at_once_are_both_named():
    hidden = [Hidden(EFFECTS.get("heading_bias"), (0.03,)), Hidden(EFFECTS.get("current"), (-0.2, 0.2))]
    named = [c.effect for c in diagnose(_trials(*hidden), gain=False).causes]
    assert set(named) == {"heading_bias", "current"}


@pytest.mark.long
def test_a_cause_that_begins_with_a_run_is_named_with_that_run():
    values = np.where(np.arange(12) >= 6, 0.04, 0.0)
    verdict = diagnose(_trials(Hidden(EFFECTS.get("heading_bias"), (values,))), gain=False)
    cause = verdict.causes[0]
    assert cause.effect == "change_point"
    assert (
        next(c for c in verdict.candidates if c.effect == "heading_bias").rejected_because == "named as a change_point"
    )
    assert "heading_bias" in cause.evidence
    assert abs(cause.parameters["from_run"].value - 6) <= 1
    assert not np.isfinite(cause.parameters["from_run"].ci95).any()  # none is known: no width of zero is claimed


@pytest.mark.long
@pytest.mark.parametrize(
    ("index", "plan"),
    [
        (1, SHORT),
        *(pytest.param(i, plan, marks=pytest.mark.long) for i, plan in ((3, Trials()), (6, SHORT), (8, SHORT))),
    ],
    ids=[
        "slow force in time",
        "thrust lost with the rudder angle, not just lost",
        "force that goes with the place",
        "turned log",
    ],
)
def test_a_force_or_a_fault_of_a_sensor_that_follows_no_known_cause_is_called_unknown_with_its_variable(index, plan):
    case = draw_case("outside", index, 3, "development", plan)
    verdict = diagnose(case.dataset(), gain=False)
    assert verdict.verdict == "unknown"
    assert not verdict.causes
    assert verdict.unknown is not None
    assert canonical(verdict.unknown["variable"]) & case.variables


@pytest.mark.long
def test_what_an_unknown_fault_replaces_raises_no_doubt_of_the_ship_file():
    """A log mounted at an angle: a list of 3.8 times its size had been the doubt, and a compass error was told beside
    it."""
    verdict = diagnose(draw_case("outside", 58, 7, "test", Trials(runs=12, samples=90)).dataset(), gain=False)
    assert (verdict.verdict, verdict.causes, verdict.warnings) == ("unknown", (), ())
    assert verdict.unknown is not None
    assert (verdict.unknown["axis"], verdict.unknown["variable"]) == ("recorded sway", "speed")


@pytest.mark.long
def test_a_ship_file_of_another_ship_names_nothing():
    data = replace(_trials(), ship=load_mmg_ship("container130").particulars)
    verdict = diagnose(data, gain=False)
    assert not verdict.causes
    assert verdict.verdict == "unknown"


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "values", "ship", "file"),
    [
        ("speed_scale", (0.05,), "tanker", "s175"),
        ("current", (0.3, -0.2), "tanker", "s175"),
        ("rudder_offset", (0.035,), "navy", "tanker"),
    ],
)
def test_what_shows_whatever_the_ship_is_is_named_under_doubt(name, values, ship, file):
    trials = published_trials(PUBLISHED[ship], 7, (Hidden(EFFECTS.get(name), values),), Trials(runs=16, samples=100))
    verdict = diagnose(replace(trials, ship=PUBLISHED[file].particulars), gain=False)
    assert "Is the ship file that of this ship" in verdict.warnings[0]
    assert [(c.effect, c.rank) for c in verdict.causes] == [(name, 1)]
    reasons = {c.effect: c.rejected_because for c in verdict.candidates}
    assert reasons[name] == "named"
    # no more than a refit gained, which the ranking shows (the linear model said up to fifteen times as much)
    assert verdict.causes[0].score <= next(c.score for c in verdict.candidates if c.effect == name)
    if name == "speed_scale":  # beside which the file's thrust would be another
        assert any(r == "in the model, but not named while the ship file is in doubt" for r in reasons.values())
    assert next(iter(verdict.causes[0].parameters.values())).value == pytest.approx(np.linalg.norm(values), rel=0.25)


@pytest.mark.parametrize(
    ("name", "told"),
    [
        ("wind_per_run", False), ("bank_suction", False), ("current_per_run", True), ("wind", True),
        ("heading_bias", True), ("mass_change", False),
    ],
)  # fmt: skip
def test_under_doubt_a_wind_of_each_run_and_a_bank_are_not_told(name, told):
    """What the coefficients of another ship lack in a run's manoeuvre, or in those of one place, passes for them."""
    assert whatever_the_ship(name, made_analysis(made_fit())) is told


@pytest.mark.long
def test_the_file_of_a_ship_of_another_size_is_doubted():
    """A container ship with the file of a navy ship of a third of her length: no parameter of the fit is out of the
    ordinary there. That her ordinary rudder is slow for so short a ship is not named."""
    trials = replace(
        published_trials(PUBLISHED["s175"], 3, (), Trials(runs=16, samples=100)), ship=PUBLISHED["navy"].particulars
    )
    verdict = diagnose(trials, gain=False)
    assert verdict.warnings[0].startswith("a similar ship of 2.5 times the size fits the runs better")
    assert "Is the ship file that of this ship" in verdict.warnings[0]
    slow = next(c for c in verdict.candidates if c.effect == "rudder_lag")
    assert slow.score > THRESHOLD
    assert slow.rejected_because == "in the model, but not named while the ship file is in doubt"
    assert "rudder_lag" not in [c.effect for c in verdict.causes]


@pytest.mark.long
def test_where_every_fit_creeps_no_refit_is_given_up_for_its_first_promise():
    """With another ship's file the current's refit promises less than nothing at first; it ends far ahead."""
    trials = sea_trials(
        load_mmg_ship("container130"), 0, (Hidden(EFFECTS.get("current"), (0.3, 0.2)),), Trials(runs=12, samples=100)
    )
    verdict = diagnose(replace(trials, ship=PUBLISHED["s175"].particulars), gain=False)
    assert [c.effect for c in verdict.causes] == ["current"]
    assert verdict.causes[0].parameters["speed"].value == pytest.approx(np.hypot(0.3, 0.2), rel=0.2)


def test_too_few_runs_rank_candidates_but_name_none():
    verdict = diagnose(_trials(Hidden(EFFECTS.get("heading_bias"), (0.05,)), runs=1), gain=False)
    assert verdict.verdict == "none"
    assert not verdict.causes
    assert "too few" in verdict.warnings[0]


def test_a_ship_that_never_moves_is_refused():
    data = _trials(runs=6, samples=40)
    states = [r.states * np.array([1, 1, 1, 0, 0, 0, 1, 1, 1, 1]) for r in data.runs]
    still = data.with_runs(
        [type(r)(r.id, r.t, s, r.inputs, r.inputs_names) for r, s in zip(data.runs, states, strict=True)]
    )
    with pytest.raises(InputError, match="never moves"):
        diagnose(still)


def test_twenty_samples_are_refused_or_name_nothing():
    with pytest.raises(InputError, match="at least 20"):
        diagnose(_trials(runs=1, samples=12))


@pytest.mark.long
def test_where_the_wind_is_measured_it_is_not_missing_but_its_coefficients_may_be():
    """A container ship in a strong measured wind that turns it the other way, twice as hard as the formula says; and as
    it says."""
    ship, plan = load_mmg_ship("container130"), Trials(runs=24, samples=120, gusts=9.0)
    for hidden in ((), (Hidden(EFFECTS.get("wind_coefficients"), (0.0, 0.0, -3.0, 0.0)),)):
        data = sea_trials(ship, 4, hidden, plan, wind_recorded=True)
        plant = Plant.of(data)
        assert not {"wind", "wind_per_run"} & {t.label for t in candidates_for(plant)}
        scores = {s.term.label: s for s in reversed(screen(null_fit(plant, Scales(plant), candidates_for(plant))))}
        if hidden:
            assert max(scores, key=lambda name: scores[name].score) == "wind_coefficients"
            assert scores["wind_coefficients"].score > THRESHOLD
            assert scores["wind_coefficients"].estimate[2] < 0
        else:
            assert scores["wind_coefficients"].score < THRESHOLD


def test_without_a_measured_wind_its_coefficients_are_no_candidate():
    assert "wind_coefficients" not in {t.label for t in candidates_for(Plant.of(_trials()))}
