"""What a cause could not be told from: what stood beside it when it was added, not what was better before and was
dropped."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from shipbench.diagnosis.explain import rivals_of
from shipbench.diagnosis.model.term import Term
from shipbench.diagnosis.selection.analysis import Analysis
from shipbench.diagnosis.selection.stepwise import Step
from shipbench.effects.base import EFFECTS


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
    named = [Term(EFFECTS.get("wind"))]
    found = SimpleNamespace(
        selection=SimpleNamespace(steps=steps), final=SimpleNamespace(model=SimpleNamespace(terms=named))
    )
    assert rivals_of(found, named[0]) == ("wave_drift",)
    named.append(Term(EFFECTS.get("wave_drift")))
    assert rivals_of(found, named[0]) == ()


def test_mass_and_thrust_are_always_told_as_confused():
    """The one that was there was behind the other by up to 24 on ships of five simulators."""
    steps, mass = (
        [step(0, "mass_change", 40.0), step(0, "thrust_gain", 18.0), step(0, "wind", 17.0)],
        Term(EFFECTS.get("mass_change")),
    )
    found = SimpleNamespace(
        selection=SimpleNamespace(steps=steps), final=SimpleNamespace(model=SimpleNamespace(terms=[mass]))
    )
    assert rivals_of(found, mass) == ("thrust_gain",)


@pytest.mark.parametrize(
    ("named", "other", "told"),
    [("wind", "wave_drift", True), ("wave_drift", "wind", True), ("current", "wave_drift", False)],
)
def test_wind_and_waves_are_told_as_confused_where_their_formulas_decide(named: str, other: str, told: bool):
    """Drift in waves by another formula on a tanker: wind was ahead by 25 of 706, and waves not spoken of."""
    steps, cause = [step(0, named, 706.0), step(0, other, 681.0)], Term(EFFECTS.get(named))
    found = SimpleNamespace(
        selection=SimpleNamespace(steps=steps), final=SimpleNamespace(model=SimpleNamespace(terms=[cause]))
    )
    assert rivals_of(found, cause) == ((other,) if told else ())


@pytest.mark.parametrize(
    ("names", "told"),
    [(("wind",), "with and without it"), (("wind", "list"), "with and without it beside the other causes")],
)
def test_a_cause_alone_is_not_told_to_be_beside_others(names: tuple[str, ...], told: str):
    model, with_it, without = (
        SimpleNamespace(terms=names),
        SimpleNamespace(per_run=np.ones(3)),
        SimpleNamespace(per_run=np.zeros(3)),
    )
    final = SimpleNamespace(
        worth=lambda index: 179.0, model=model, solution=with_it, solution_without=lambda index: without
    )
    found = SimpleNamespace(final=final, selection=SimpleNamespace(steps=[]), threshold=10.0)
    assert Analysis.score(found, 0) == (179.0, 3, told)
