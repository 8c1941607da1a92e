"""Mean error of every model in slices of the true ship's motion."""

from __future__ import annotations

import numpy as np
from made_results import results, windows_of

from shipbench.leaderboard.slicing import regime_errors


def test_means_are_over_the_scored_windows_of_a_slice():
    found = results({"m": [[1, None, 3, 5, 7, 9]], "n": [[None] * 6]})
    windows = windows_of(found, speed=[1.0, 2, 3, 4, 5, 6])
    (speed,) = [r for r in regime_errors(found.rows, windows, ["m", "n"]) if r.name == "speed"]
    assert speed.counts == (2, 2, 2)
    assert speed.labels == ("below 2.67 m/s", "2.67 to 4.33 m/s", "above 4.33 m/s")
    assert speed.values["m"] == (1.0, 4.0, 8.0)
    assert np.isnan(speed.values["n"]).all()


def test_without_the_motion_of_the_true_ship_there_is_no_slice():
    assert regime_errors(results({"m": [[1, 2]]}).rows, None, ["m"]) == []
