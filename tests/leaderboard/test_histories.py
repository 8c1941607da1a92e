"""Tracks and time histories of drawn windows."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.leaderboard.histories import EAST, NORTH, SIGNALS, near, shown, widths
from shipbench.render.linked import linked_run
from shipbench.signals import PSI, X, Y


def track(steps: int = 11) -> np.ndarray:
    S = np.zeros((steps, 10))
    S[:, X] = np.arange(steps)
    return S


def test_a_model_that_diverges_is_cut_where_it_leaves_twice_the_extent_of_the_true_track():
    truth, predicted = track(), track()
    predicted[4:, Y] = 19.0  # 10 m long: 20 m are near
    np.testing.assert_array_equal(near(predicted, truth), predicted)
    predicted[6, Y] = 21.0
    cut = near(predicted, truth)
    np.testing.assert_array_equal(cut[:6], predicted[:6])
    assert np.isnan(cut[6:]).all()  # also where it comes back


def test_a_truth_with_gaps_still_has_an_extent_and_infinities_are_cut():
    truth, predicted = track(), track()
    truth[3:5, X] = np.nan
    predicted[8, Y] = np.inf
    cut = near(predicted, truth)
    assert np.isfinite(cut[[0, 1, 2, 5, 6, 7]]).all()
    assert np.isnan(cut[8:]).all()


def test_a_heading_is_shown_on_the_turn_of_the_true_one_in_degrees():
    truth, predicted = track(), track()
    truth[:, PSI], predicted[:, PSI] = 2.0 * np.pi + 0.1, 0.2
    columns = shown(predicted, truth, SIGNALS)
    assert columns["psi"] == pytest.approx(np.full(11, 360.0 + np.rad2deg(0.2)))
    assert columns["north"].tolist() == list(range(11))


def test_the_half_widths_of_a_band_stand_in_the_units_of_its_columns():
    W = np.arange(1.0, 7.0) * np.ones((11, 1))
    found = widths(W, SIGNALS)
    assert {name: values[0] for name, values in found.items()} == {
        "north": 1.0, "east": 2.0, "psi": pytest.approx(np.rad2deg(3.0)), "u": 4.0, "v": 5.0,
        "r": pytest.approx(np.rad2deg(6.0)),
    }  # fmt: skip
    assert widths(None, SIGNALS) == {}
    columns = [EAST, NORTH]
    lines, bands = [{"east": W[:, 0], "north": W[:, 1]}, {"east": W[:, 0]}], [{}, {"east": W[:, 4]}]
    run = linked_run("r", "", np.arange(11.0), columns, lines, bands=bands)
    assert run["bands"] == [[None, None], [[50] + [0] * 10, None]]
    assert "bands" not in linked_run("r", "", np.arange(11.0), columns, lines, bands=[{}, {}])
