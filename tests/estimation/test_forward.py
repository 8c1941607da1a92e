"""Segments of runs, and the forward model on them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from made_fits import made_plant, made_segments, made_ship

from shipbench.estimation.forward import DEEP, cut, least_depth, ordinary_gears, working
from shipbench.records import Dataset, Run
from shipbench.ship import Ship
from shipbench.signals import COMMANDS, DELTA, N, U

SHIP = Ship(name="toy", L=130.0, B=20.0, T=6.0, displacement=9000.0)


def dataset(*steps: int, depth: float | None = None) -> Dataset:
    """Runs of so many transitions, at rest but for the shaft."""
    names = (*COMMANDS, "depth")[: 4 + (depth is not None)]
    runs = []
    for i, num in enumerate(steps):
        S, inputs = np.zeros((num + 1, 10)), np.zeros((num + 1, len(names)))
        S[:, N], S[:, U] = 60.0, 5.0
        if depth is not None:
            inputs[:, -1] = depth
        runs.append(Run(f"r{i}", np.arange(num + 1.0), S, inputs, names))
    return Dataset("toy", SHIP, 1.0, tuple(runs))


def test_segments_share_the_sample_between_them_and_shorter_ones_are_masked():
    seg = cut(dataset(40, 15), 20)
    assert seg.run.tolist() == [0, 0, 1]
    assert seg.start.tolist() == [0.0, 20.0, 0.0]
    assert seg.mask.sum(axis=1).tolist() == [21, 21, 16]
    assert seg.runs == 2


@pytest.mark.parametrize(("depth", "used"), [(12.0, True), (5.0, False), (DEEP * 6.0 + 1.0, False)])
def test_a_depth_is_used_between_the_keel_and_deep_water(depth: float, used: bool):
    found = dataset(20, depth=depth)
    assert least_depth(found) == depth
    assert (cut(found, 20).depth is not None) is used
    assert least_depth(dataset(20)) == np.inf


def test_an_actuator_that_is_zero_throughout_does_not_work():
    found = dataset(20, 20)
    assert working(found) == {"n"}
    one = replace(found.runs[1], states=found.runs[1].states + 0.1 * (np.arange(10) == DELTA))
    assert "delta" in working(found.with_runs([found.runs[0], one]))


def test_thinning_keeps_a_segment_of_every_run():
    seg = made_segments(np.repeat(np.arange(4), 10))
    assert seg.thinned(40) is seg
    few = seg.thinned(6)
    assert set(few.run.tolist()) == {0, 1, 2, 3}
    assert len(few.run) <= 8


def test_the_runs_of_wanted_segments_are_numbered_anew():
    seg = made_segments([0, 0, 1, 2], kinds=("a", "b", "c"))
    some = seg.where(np.array([False, True, False, True]))
    assert (some.run.tolist(), some.runs, some.kinds) == ([0, 1], 2, ("a", "c"))


def test_a_ship_four_times_as_long_has_gears_half_as_quick():
    short, long = ordinary_gears(100.0), ordinary_gears(400.0)
    assert pytest.approx(2.0 * short["delta"].T) == long["delta"].T
    assert long["delta"].rate == pytest.approx(short["delta"].rate / 2.0)
    assert long["n"].rate == pytest.approx(short["n"].rate / 4.0)


def test_a_similar_ship_keeps_segments_and_units():
    plant = made_plant(3)
    other = plant.resized(2.5)
    assert pytest.approx(2.5 * made_ship().L) == other.ship.L
    assert (other.froude, other.seg, other.knots) == (plant.froude, plant.seg, plant.knots)


def test_a_turned_actuator_has_another_sign_in_record_and_command():
    states, commands = np.zeros((2, 3, 10)), np.zeros((2, 3, 4))
    states[..., DELTA], commands[..., 1], states[..., N] = 0.2, 0.3, 50.0
    turned = made_segments([0, 1], states=states, commands=commands).turned([1])
    assert np.all(turned.states[..., DELTA] == -0.2)
    assert np.all(turned.commands[..., 1] == -0.3)
    assert np.all(turned.states[..., N] == 50.0)
