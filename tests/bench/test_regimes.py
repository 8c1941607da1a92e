"""What the true ship does in a window, and the slices that are made of it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from shipbench.bench.regimes import slices, window_features
from shipbench.records import Batch
from shipbench.signals import DELTA, U, V


def batch(num=1, steps=4):
    zeros = np.zeros((num, steps, 10))
    return Batch(tuple(f"r{i}" for i in range(num)), np.zeros((num, 10)), np.zeros((num, steps, 4)), zeros)


def test_features_by_hand():
    b = batch()
    b.truth[0, :, U], b.truth[0, :, V] = [3.0, 3.0, 0.0, -4.0], [0.0, -3.0, 0.0, 0.0]
    b.truth[0, :, DELTA] = [0.1, -0.1, 0.3, -0.3]
    b.U[0, :, 0], b.U[0, 0, 3] = [50.0, 50.0, -20.0, 50.0], 1e3
    found = {name: values[0] for name, values in window_features(b, L=50.0).items()}
    root = 3 * np.sqrt(2)
    assert found["speed"] == pytest.approx((3 + root + 0 + 4) / 4)
    assert found["drift"] == pytest.approx(
        root * np.pi / 4 / (3 + root + 4)
    )  # going straight astern is no drift, being at rest counts nothing
    assert (found["rudder"], found["astern"], found["thrusters"]) == (pytest.approx(0.2), 0.25, 0.25)
    assert np.isnan(found["advance"])


def test_a_ship_at_rest_has_no_drift():
    assert window_features(batch(), L=50.0)["drift"][0] == 0.0


def test_every_window_is_in_one_slice_of_each_regime():
    rng = np.random.default_rng(0)
    frame = pd.DataFrame(
        {
            "speed": rng.random(20),
            "drift": rng.random(20),
            "rudder": 0.3,
            "astern": rng.random(20) > 0.5,
            "thrusters": 0.0,
        }
    )
    found = list(slices(frame))
    assert [s.regime for s in found] == ["speed"] * 3 + ["drift"] * 3 + [
        "astern"
    ] * 2  # no difference in rudder or thrusters
    for regime in ("speed", "drift", "astern"):
        assert (np.sum([s.members for s in found if s.regime == regime], axis=0) == 1).all()


def test_bounds_are_printed_in_the_units_that_people_read():
    frame = pd.DataFrame(
        {"speed": [1.0, 2, 3, 4], "drift": np.deg2rad([1.0, 2, 3, 4]), "rudder": 0.0, "astern": 0.0, "thrusters": 0.0}
    )
    assert [s.label for s in slices(frame)][3:] == [
        "drift below 2.00 deg",
        "drift 2.00 to 3.00 deg",
        "drift above 3.00 deg",
    ]
