"""Standard manoeuvres are sailed as ordered, from cruising speed, to both sides on the same course."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.physics.mmg import load_mmg_ship
from shipbench.signals import PSI, R, U
from shipbench.simulate.trials import STANDARD, Trials, sea_trials


@pytest.fixture(scope="module")
def trials():
    return sea_trials(
        load_mmg_ship("container130"), 3, (), Trials(runs=10, samples=300, noise=0.0, gusts=0.0, standard=True)
    ).runs


def test_a_turn_goes_to_the_side_of_its_rudder_and_a_zig_zag_to_both(trials):
    for run, (kind, degrees) in zip(trials, STANDARD, strict=True):
        turned = np.rad2deg(run.states[:, PSI] - run.states[0, PSI]) * np.sign(degrees)
        if kind == "turn":
            assert turned[-1] > 60.0
        if kind == "zig-zag":
            assert np.sum(np.diff(np.sign(run.states[30:, R])) != 0) >= 2
            assert np.abs(turned).max() < 90.0


def test_runs_begin_at_cruising_speed_on_two_courses_and_a_stop_slows_down(trials):
    speed = np.array([run.states[0, U] for run in trials])
    assert np.ptp(speed) < 0.1 * speed.mean()
    course = np.array([run.states[0, PSI] for run in trials])
    np.testing.assert_allclose(np.abs(np.sin(0.5 * (course[::2] - course[1::2]))), 0.0, atol=0.2)
    assert np.abs(np.sin(0.5 * (course[0] - course[2]))) > 0.9
    (stop,) = (run for run, (kind, _) in zip(trials, STANDARD, strict=True) if kind == "stop")
    assert stop.states[-1, U] < 0.5 * stop.states[0, U]
