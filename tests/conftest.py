"""Shared data: a few short simulated runs, made once."""

from __future__ import annotations

import gc
import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # before numpy and torch load: pytest's workers share the cores

from collections.abc import Iterator
from functools import cache

import pytest
from hypothesis import settings
from toy_ship import toy, toy_folder

from shipbench.contract.small import small_harbour
from shipbench.records import Dataset

__all__ = ["toy", "toy_folder"]

settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.load_profile("repeatable")


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Collect tests without the garbage collector: what they import stays, and no later collection looks at it."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


@pytest.fixture(scope="session")
def harbour() -> Dataset:
    """16 runs of 40 s."""
    return small_harbour(num=16, horizon=40)


@pytest.fixture
def undrawn() -> Iterator[pytest.MonkeyPatch]:
    """`run` and `leaderboard` draw no pictures, which take most of the time of a small study; `undrawn.undo()` lets
    them draw."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("shipbench.leaderboard.plots.draw_all", lambda *_: [])
        yield patch


@pytest.fixture(scope="session")
def plant():
    """Forward model of four runs of 60 s of a container ship."""
    from shipbench.estimation.forward import Plant
    from shipbench.physics.mmg import load_mmg_ship
    from shipbench.simulate.trials import Trials, sea_trials

    return Plant.of(sea_trials(load_mmg_ship("kcs"), 5, (), Trials(runs=4, samples=60)))


@pytest.fixture(scope="session")
def fmu_library(tmp_path_factory):
    """Function of the version of FMI: the compiled library of the tests' FMU."""
    import made_fmu

    if not made_fmu.HAS_COMPILER:
        pytest.skip(made_fmu.NO_COMPILER)
    return cache(lambda fmi: made_fmu.library(tmp_path_factory.mktemp(f"fmi{fmi}"), fmi))


@pytest.fixture(scope="session")
def ship_fmu(tmp_path_factory, fmu_library):
    """Function of the version of FMI: the FMU `ship.fmu` of the tests."""
    import made_fmu

    def made(fmi: int = 2):
        path = tmp_path_factory.mktemp("ship") / "ship.fmu"
        files: dict[str, str | bytes] = {
            "modelDescription.xml": made_fmu.description(fmi),
            **made_fmu.members(fmu_library(fmi), fmi),
        }
        return made_fmu.write_archive(path, files)

    return cache(made)
