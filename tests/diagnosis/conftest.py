"""Forward model of a few short runs."""

from __future__ import annotations

import pytest

from shipbench.diagnosis.model.forward import Plant
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.trials import Trials, sea_trials


@pytest.fixture(scope="session")
def plant() -> Plant:
    """Four runs of 60 s of a container ship."""
    return Plant.of(sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=4, samples=60)))
