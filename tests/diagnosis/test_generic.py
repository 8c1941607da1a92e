"""What an unexplained force depends on, alone and beside what the hull's own motion explains."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.diagnosis.generic import dependences
from shipbench.diagnosis.model import Scales
from shipbench.diagnosis.plain import null_fit
from shipbench.diagnosis.plant import Plant
from shipbench.diagnosis.settle import Fit
from shipbench.simulate.published import PUBLISHED, published_trials

HULL = ("speed", "sway velocity", "yaw rate")


@pytest.fixture(scope="module")
def s175() -> Fit:
    """She heels in turns, which no term of the fitted model does."""
    plant = Plant.of(published_trials(PUBLISHED["s175"], 77))
    return null_fit(plant, Scales(plant))


def test_beside_the_hull_nothing_is_left_of_what_the_hull_explains(s175):
    alone, beside = dependences(s175), dependences(s175, HULL)
    assert (alone[0].axis, alone[0].variable in HULL) == ("yaw", True)
    assert alone[0].score > 20.0
    assert not {d.variable for d in beside} & set(HULL)
    assert beside[0].score < 10.0


def test_a_variable_is_worth_the_same_beside_one_that_nothing_follows(s175):
    scores = {(d.axis, d.variable): d.score for d in dependences(s175)}
    others = {(d.axis, d.variable): d.score for d in dependences(s175, ("run",))}
    assert max(abs(others[key] - scores[key]) for key in others) < 3.0
    assert np.isfinite(list(others.values())).all()
