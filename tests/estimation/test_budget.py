"""A diagnosis ends: its work is counted, and a limit that acts is said."""

from __future__ import annotations

import numpy as np
import pytest
from made_fits import made_analysis, made_fit

from shipbench.diagnosis import diagnose as whole
from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.evaluation.held_out_gain import FoldErrors
from shipbench.diagnosis.preparation import time_offsets as clocks
from shipbench.diagnosis.selection import analysis
from shipbench.diagnosis.selection import stepwise as selection
from shipbench.diagnosis.selection.analysis import THRESHOLD, plain_model
from shipbench.effects.base import EFFECTS
from shipbench.errors import InputError
from shipbench.estimation import noise_selection as noise
from shipbench.estimation.budget import Budget, count, is_spent, limited
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import Origin, fit
from shipbench.estimation.laplace import Fit, Model
from shipbench.estimation.linearisation import Scales
from shipbench.estimation.term import Term
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials


@pytest.fixture(scope="module")
def turned() -> Dataset:
    """A compass 3 degrees off."""
    return sea_trials(
        load_mmg_ship("kcs"), 3, (Hidden(EFFECTS.get("heading_bias"), (0.05,)),), Trials(runs=8, samples=60)
    )


def test_work_is_counted_inside_and_a_limit_is_remembered():
    assert not is_spent()  # without a budget there is no limit
    with limited(Budget(iterations=3)) as budget:
        count()
        count()
        assert not is_spent()
        assert budget.said(nothing=False) == []
        count()
        assert is_spent()
        count()
        assert budget.stopped[0] == 3
    assert not is_spent()
    (line,) = budget.said(nothing=True)
    assert "stopped after 3 iterations" in line
    assert "no cause is named" in line


def test_parts_share_the_seconds_that_are_left():
    assert 1.9 < Budget(seconds=10.0).part(5).seconds <= 2.0
    assert Budget(seconds=1e-9).part(5).seconds == 0.0


def test_what_takes_too_much_memory_is_refused_before_it_is_made(turned, monkeypatch):
    monkeypatch.setattr(analysis, "null_fit", None)
    with pytest.raises(InputError, match=r"8 pieces of 61 samples .* GB of memory. Accepted: up to 0.001 GB"):
        diagnose(turned, gain=False, budget=Budget(gigabytes=1e-3))


def test_seconds_are_those_of_the_processor():
    with limited(Budget(seconds=1e-9)):
        assert is_spent()


def test_a_selection_begins_once_more_beside_other_noise_and_not_again(turned, monkeypatch):
    """It restarted itself inside itself until it was stopped: on positions in feet other noise always suits better."""
    null = plain_model(Plant.of(turned), only=("heading_bias",))
    again = []
    monkeypatch.setattr(selection, "beside_noise_of", lambda now, plain: again.append(now) or plain)
    found = selection.select(null, THRESHOLD)
    assert len(again) == 1
    assert [t.label for t in found.final.model.terms] == ["heading_bias"]
    assert found.plain is null


def test_a_small_budget_ends_the_diagnosis_with_what_stands_and_says_so(turned):
    found = diagnose(turned, gain=True, budget=Budget(iterations=1))
    assert (found.verdict, found.causes, found.gain) == ("none", (), None)
    (line,) = [w for w in found.warnings if w.startswith("stopped after")]
    assert "--cpu-limit" in line
    assert "no cause is named" in line
    assert {c.effect for c in found.candidates} >= {"heading_bias", "current"}


def test_a_diagnosis_begins_little_after_its_limit(turned):
    budget = Budget(iterations=3)
    diagnose(turned, gain=False, budget=budget)
    assert budget.used <= 3 + 2  # fits that others need, of one iteration each


def test_a_round_that_is_cut_short_names_nothing(turned, monkeypatch):
    """Of the causes that were not tried one may be better."""
    budget = Budget()

    def plain_then_one_more(*args: object, **kwargs: object) -> Fit:
        null = plain_model(*args, **kwargs)
        budget.iterations = budget.used + 1
        return null

    monkeypatch.setattr(whole, "plain_model", plain_then_one_more)
    found = diagnose(turned, gain=False, budget=budget)
    assert (found.verdict, found.causes) == ("none", ())
    (line,) = [w for w in found.warnings if w.startswith("stopped after")]
    assert "The causes named so far are valid" in line
    assert budget.used <= budget.iterations + 2


def test_noise_is_not_looked_for_after_the_limit(turned, monkeypatch):
    plant, asked = Plant.of(turned), []
    origin = Origin.of(plant, Scales(plant))
    null = fit(plant, Scales(plant), Model(), origin.point, origin.hyper, iterations=1, guess=origin.motion, far=True)
    monkeypatch.setattr(noise, "evidence_with", lambda found, colour: asked.append(colour) or 0.0)
    with limited(Budget(iterations=0)):
        assert not noise.colour_of(null).share.any()
    assert len(asked) == 1


def test_no_gain_is_measured_with_a_training_part_that_was_stopped(turned):
    def work(fold: int, threshold: float | None) -> FoldErrors:
        test = whole._folds(turned, 0)[fold]
        return FoldErrors(test, *np.ones((5, len(test))), stopped=fold == 1)

    found = made_analysis(made_fit((Term(EFFECTS.get("heading_bias")),)))
    worth = whole._cross_validated(turned, found, False, 0, work, None, None)
    assert (worth.gain, worth.calibration, worth.per_run) == (None, None, ())
    assert "1 of 5 training parts were stopped" in worth.told[0]


def test_clocks_are_not_judged_by_fits_that_were_stopped(turned, monkeypatch):
    monkeypatch.setattr(clocks, "late_velocities", lambda _: (1.0, 0.1))
    monkeypatch.setattr(clocks, "_evidence", lambda data, _: np.zeros(len(data)))
    assert clocks.late_velocities_of(turned) is not None
    with limited(Budget(iterations=0)):
        assert clocks.late_velocities_of(turned) is None


@pytest.mark.long
def test_an_ample_budget_changes_nothing(turned):
    with limited(Budget()) as outer:
        found = diagnose(turned, gain=False)
    assert [c.effect for c in found.causes] == ["heading_bias"]
    assert outer.used == 0
    assert not [w for w in found.warnings if "stopped" in w]
