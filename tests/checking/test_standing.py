"""An actuator that never moves is spoken of where only it can do what the ship does; not where she coasts, drifts or is
held in a turn."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.checking.base import check_dataset
from shipbench.diagnosis.diagnose import diagnose
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import DELTA, N
from shipbench.simulate.trials import Trials, sea_trials


def dead(data: Dataset, channel: int, value: float = 0.0) -> Dataset:
    """The record of an actuator and of its command is `value` throughout."""
    runs = []
    for run in data.runs:
        states, inputs = run.states.copy(), run.inputs.copy()
        states[:, channel] = inputs[:, channel - N] = value
        runs.append(replace(run, states=states, inputs=inputs))
    return data.with_runs(runs)


def named(data: Dataset) -> list[str]:
    return [f.channels[0] for f in check_dataset(data) if f.kind == "actuator never moves"]


@pytest.mark.long
@pytest.mark.parametrize("ship", ["container130", "kcs", "kvlcc2_l7"])
def test_a_dead_channel_is_named_on_ships_of_any_size(ship):
    data = sea_trials(load_mmg_ship(ship), 5, (), Trials(runs=16, samples=150))
    assert named(data) == []
    assert named(dead(data, DELTA)) == ["delta"]
    assert named(dead(data, DELTA, 0.2)) == ["delta"]
    assert named(dead(data, N)) == ["n"]
    assert named(dead(dead(data, N), DELTA)) == ["n", "delta"]


def moving(u: np.ndarray, r: float, delta: float = 0.0, n: float = 0.0) -> Dataset:
    """Runs of a ship of 130 m at speeds `u`, turning at a constant rate."""
    plan = sea_trials(load_mmg_ship("container130"), 0, (), Trials(runs=6, samples=len(u)))
    t = np.arange(len(u), dtype=float)
    states = np.zeros((len(u), 10))
    states[:, 2] = r * t
    states[:, :2] = np.column_stack([np.cumsum(u * np.cos(r * t)), np.cumsum(u * np.sin(r * t))])
    states[:, 3], states[:, 5], states[:, N], states[:, DELTA] = u, r, n, delta
    inputs = states[:, N : N + 4]
    return replace(plan, dt=1.0, runs=tuple(replace(run, t=t, states=states, inputs=inputs) for run in plan.runs))


@pytest.mark.long
def test_a_ship_that_coasts_or_is_held_in_a_turn_or_drifts_is_no_sign_of_a_dead_channel():
    t = np.arange(200.0)
    coasting = 6.0 / (1.0 + 6.0 * t / (18.0 * 130.0))
    assert named(moving(coasting, 0.0)) == []
    assert named(moving(np.full(200, 6.0), 0.0)) == ["n"]
    assert named(moving(np.full(200, 0.5), 0.02)) == []
    assert named(moving(np.full(200, 6.0), 0.01, delta=0.3, n=90.0)) == []
    assert named(moving(np.full(200, 6.0), 0.01, n=90.0)) == ["delta"]


@pytest.mark.long
def test_the_diagnosis_says_so_too():
    verdict = diagnose(dead(sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=12, samples=80)), DELTA), gain=False)
    assert any(w.startswith("The rudder is recorded at 0 degrees throughout") for w in verdict.warnings)
