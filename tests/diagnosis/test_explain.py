"""What a cause could not be told from: what stood beside it when it was added, not what was better before and was
dropped."""

from __future__ import annotations

import pytest
from made_fits import made_analysis, made_fit

from shipbench.diagnosis.explain import rivals_of
from shipbench.diagnosis.selection.stepwise import Step
from shipbench.effects.base import EFFECTS
from shipbench.estimation.term import Term


def step(number: int, label: str, score: float) -> Step:
    return Step(number, Term(EFFECTS.get(label)), score, 0)


def test_only_what_came_near_in_the_round_in_which_a_cause_was_added_is_its_rival():
    steps = [
        step(0, "speed_scale", 90.0),
        step(0, "wind", 60.0),
        step(1, "wind", 40.0),
        step(1, "wave_drift", 38.0),
        step(1, "list", 12.0),
    ]
    wind, waves = Term(EFFECTS.get("wind")), Term(EFFECTS.get("wave_drift"))
    assert rivals_of(made_analysis(made_fit((wind,)), steps), wind) == ("wave_drift",)
    assert rivals_of(made_analysis(made_fit((wind, waves)), steps), wind) == ()


def test_mass_and_thrust_are_always_told_as_confused():
    """The one that was there was behind the other by up to 24 on ships of five simulators."""
    steps, mass = (
        [step(0, "mass_change", 40.0), step(0, "thrust_gain", 18.0), step(0, "wind", 17.0)],
        Term(EFFECTS.get("mass_change")),
    )
    assert rivals_of(made_analysis(made_fit((mass,)), steps), mass) == ("thrust_gain",)


@pytest.mark.parametrize(
    ("named", "other", "told"),
    [("wind", "wave_drift", True), ("wave_drift", "wind", True), ("current", "wave_drift", False)],
)
def test_wind_and_waves_are_told_as_confused_where_their_formulas_decide(named: str, other: str, told: bool):
    """Drift in waves by another formula on a tanker: wind was ahead by 25 of 706, and waves not spoken of."""
    steps, cause = [step(0, named, 706.0), step(0, other, 681.0)], Term(EFFECTS.get(named))
    assert rivals_of(made_analysis(made_fit((cause,)), steps), cause) == ((other,) if told else ())
