"""Shared data: a few short simulated runs, made once."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.simulate.harbour import draw_plan, fly


def make_harbour(num: int, horizon: int, seed: int) -> Dataset:
    """`num` simulated port manoeuvres of `horizon` seconds."""
    ship = load_mmg_ship("container130")
    rng = np.random.default_rng(seed)
    S, C = fly(ship, draw_plan(rng, num, ship.L, horizon, 30), rng, horizon, 30)
    t = np.arange(horizon + 1.0)
    runs = tuple(Run(f"run{i}", t, S[i], C[i]) for i in range(num))
    return Dataset("small_harbour", ship.particulars, 1.0, runs, simulation="container130")


@pytest.fixture(scope="session")
def harbour() -> Dataset:
    """16 runs of 40 s."""
    return make_harbour(16, 40, seed=4)
