"""Fast records: averaged before they are fitted, and said where not all of a long one is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.estimation.forward import Plant
from shipbench.estimation.outliers import left_out
from shipbench.estimation.resampling import averaged
from shipbench.records import Dataset, Run
from shipbench.ship import Ship
from shipbench.signals import COMMANDS

NAMES = (*COMMANDS, "wind_speed", "wind_from", "depth")


def fast(dt: float, *samples: int, L: float = 130.0) -> Dataset:
    """Runs whose states grow linearly in time; the rudder is ordered over at 3 s, the wind swings about north."""

    def run(number: int, count: int) -> Run:
        t = 5.0 + dt * np.arange(count)
        states = np.linspace(1.0, 10.0, 10) + 0.01 * t[:, None]
        inputs = np.zeros((count, 7))
        inputs[:, 1] = np.where(t - t[0] < 3.0 - 1e-9, 0.0, 0.2)
        inputs[:, 4], inputs[:, 5], inputs[:, 6] = 6.0, np.where(np.arange(count) % 2, 0.3, 2.0 * np.pi - 0.3), 20.0
        return Run(f"run{number}", t, states, inputs, NAMES)

    ship = Ship(name="s", L=L, B=0.15 * L, T=0.06 * L, displacement=0.006 * L**3)
    return Dataset("fast", ship, dt, tuple(run(i, n) for i, n in enumerate(samples)))


def test_samples_are_averaged_at_the_middle_of_what_they_stand_for():
    data = fast(0.2, 103, 51)
    slow = averaged(data)
    assert slow.dt == pytest.approx(1.0)
    assert [len(r) for r in slow.runs] == [20, 10]
    for before, after in zip(data.runs, slow.runs, strict=True):
        np.testing.assert_allclose(after.t, before.t[0] + 0.4 + np.arange(len(after)))
        np.testing.assert_allclose(after.states, np.linspace(1.0, 10.0, 10) + 0.01 * after.t[:, None])
        # held on [2.4, 3.4) s: three samples before the order, two after it
        np.testing.assert_allclose(after.inputs[:5, 1], [0.0, 0.0, 0.08, 0.2, 0.2])
        np.testing.assert_allclose(after.inputs[:, 6], 20.0)
        # vectors, not angles: from north, not from the south
        assert np.all(np.cos(after.inputs[:, 5]) > 0.99)
        assert np.all(np.abs(after.inputs[:, 4] - 6.0 * np.cos(0.3)) < 0.1)


@pytest.mark.parametrize(("dt", "length", "shortest", "expected"),
    [(1.0, 130.0, 60, 1), (0.4, 130.0, 60, 1), (0.1, 130.0, 60, 9), (0.1, 3.0, 60, 1),
                                                                     (0.02, 3.0, 60, 7), (0.1, 130.0, 9, 3),
                                                                     (0.1, 130.0, 4, 1)])  # fmt: skip
def test_as_many_as_a_second_at_130_m_holds_and_the_shortest_run_allows(dt, length, shortest, expected):
    data = fast(dt, 100, shortest, L=length)
    slow = averaged(data)
    assert slow.dt == pytest.approx(expected * dt)
    assert (slow is data) == (expected == 1)
    assert min(len(r) for r in slow.runs) >= 2


def test_a_long_fast_record_is_fitted_whole_but_its_gears_see_every_sample():
    data = fast(0.1, *[6000] * 4)
    plant = Plant.of(data)
    assert plant.seg.dt == pytest.approx(0.9)
    assert plant.long.dt == 0.1
    assert left_out(plant, data.runs) == []
    longer = replace(data, runs=fast(0.1, *[60_000] * 6).runs)
    (line,) = left_out(Plant.of(longer), longer.runs)
    assert line.startswith("59% of the record")
    assert "--thorough" in line
