"""A diagnosis ends: its work is counted, and a limit that acts is said."""

from __future__ import annotations

import pytest

from shipbench.diagnosis import select as selection
from shipbench.diagnosis.analysis import THRESHOLD, plain_model
from shipbench.diagnosis.budget import Budget, count, is_overrun, is_spent, limited
from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.plant import Plant
from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials


@pytest.fixture(scope="module")
def turned() -> Dataset:
    """A compass 3 degrees off."""
    return sea_trials(load_mmg_ship("kcs"), 3, (Hidden(EFFECTS.get("heading_bias"), (0.05,)),), Trials(runs=8, samples=60))


def test_work_is_counted_inside_and_a_limit_is_remembered():
    assert not is_spent()  # without a budget there is no limit
    with limited(Budget(iterations=3, overrun=2.0)) as budget:
        count()
        count()
        assert not is_spent()
        assert budget.said(overrun=False) == []
        count()
        assert is_spent()
        assert not is_overrun()
        for _ in range(3):
            count()
        assert is_overrun()
        assert budget.stopped[0] == 3
    assert not is_spent()
    (line,) = budget.said(overrun=True)
    assert "stopped after 3 iterations" in line
    assert "Nothing is named" in line


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
    assert {c.effect for c in found.candidates} >= {"heading_bias", "current"}


@pytest.mark.long
def test_an_ample_budget_changes_nothing(turned):
    with limited(Budget()) as outer:
        found = diagnose(turned, gain=False)
    assert [c.effect for c in found.causes] == ["heading_bias"]
    assert outer.used == 0
    assert not [w for w in found.warnings if "stopped" in w]
