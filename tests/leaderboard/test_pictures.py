"""Static pictures: growth of the error, and errors in slices of the truth."""

from __future__ import annotations

import numpy as np

from shipbench.leaderboard.pictures import growth, slices
from shipbench.leaderboard.series import Series, _thin
from shipbench.leaderboard.slicing import Regime


def test_growth_is_drawn_for_models_with_errors_alone():
    t = np.linspace(0.0, 20.0, 5)
    errors = np.outer([1.0, 2.0, 3.0], t)
    series = Series(t, [], {"b": (errors, errors)}, [])
    drawn = growth(series, ["a", "b"], 0, "ED [m]")
    assert drawn.count('data-m="1"') == 2  # band and line
    assert 'data-m="0"' not in drawn
    assert growth(series, ["a"], 0, "ED [m]") == ""


def test_slices_without_a_value_have_no_dot_and_a_common_unit_stands_on_the_axis():
    regime = Regime("speed", ("below 2 m/s", "2 to 3 m/s", "above 3 m/s"), (2, 2, 2), {"m": (1.0, np.nan, 3.0)})
    drawn = slices(regime, ["m", "without"])
    assert drawn.count("<circle") == 2
    assert "speed [m/s]" in drawn
    assert 'data-m="1"' not in drawn
    assert slices(regime, ["without"]) == ""


def test_thinned_time_steps_hold_the_first_and_the_last():
    assert _thin(5, 10).tolist() == [0, 1, 2, 3, 4]
    assert _thin(101, 5).tolist() == [0, 25, 50, 75, 100]
