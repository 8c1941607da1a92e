"""The noise floor of rollouts: that of a known noise, on simulated runs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.evaluation.noise_floor import noise_floor
from shipbench.estimation.calibration import estimated
from shipbench.estimation.forward import Plant
from shipbench.estimation.laplace import Fit
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.simulator import Simulator
from shipbench.simulate.trials import NOISE, Trials, sea_trials

SHIP = load_mmg_ship("container130")
PLAN = Trials(runs=8, samples=60, gusts=0.0, astern=False, thrusters=False)
DATA = sea_trials(SHIP, 5, (), PLAN)


@pytest.fixture(scope="module")
def found() -> Fit:
    """A baseline model of the runs."""
    return estimated(Plant.of(DATA))


def with_noise(found: Fit, size: np.ndarray) -> Fit:
    """The same model with sensors whose noise has standard deviations `size` (6,)."""
    log_noise = 2.0 * np.log(np.maximum(size, 1e-9) / found.scales.noise)
    return replace(found, hyper=replace(found.hyper, log_noise=log_noise))


def test_noise_of_the_position_stays_as_large_as_it_is(found):
    floor = noise_floor(DATA, with_noise(found, np.array([2.0, 2.0, 0, 0, 0, 0])), seed=0)
    assert floor.position == pytest.approx(2.0 * np.sqrt(np.pi), rel=0.1)  # of two errors, in two directions
    assert floor.heading < 1e-6


def test_noise_of_the_heading_grows_with_the_way(found):
    floor = noise_floor(DATA, with_noise(found, np.array([0, 0, 0.01, 0, 0, 0])), seed=0)
    assert floor.heading == pytest.approx(0.01 * 2.0 / np.sqrt(np.pi), rel=0.15)
    way = np.mean([np.hypot(*(r.states[1:, :2] - r.states[0, :2]).T).mean() for r in DATA.runs])
    assert floor.position == pytest.approx(0.01 * np.sqrt(2.0 / np.pi) * way, rel=0.35)


@pytest.mark.long
def test_it_is_that_of_the_ship_and_the_sensors_that_made_the_runs(found):
    clean, rng, draws = sea_trials(SHIP, 5, (), replace(PLAN, noise=0.0)).batch(), np.random.default_rng(1), 8
    s0, U = np.tile(clean.s0, (draws, 1)), np.tile(clean.U[..., :4], (draws, 1, 1))
    exact = Simulator(SHIP).rollout(s0, U, DATA.dt)[..., :6]
    noise = NOISE[:6] * rng.standard_normal((len(s0), exact.shape[1] + 1, 6))
    s0[:, :6] += noise[:, 0]
    error = Simulator(SHIP).rollout(s0, U, DATA.dt)[..., :6] - exact - noise[:, 1:]
    floor = noise_floor(DATA, found, seed=0)
    assert floor.position == pytest.approx(np.hypot(error[..., 0], error[..., 1]).mean(), rel=0.15)
    assert floor.heading == pytest.approx(np.abs(error[..., 2]).mean(), rel=0.3)  # of another structure
    assert floor == noise_floor(DATA, found, seed=0)
