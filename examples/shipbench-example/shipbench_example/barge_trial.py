"""Twelve simulated manoeuvres of a 130 m container ship with a barge alongside, with sensor noise; no file says that it
is there."""

from __future__ import annotations

from shipbench.data.base import DatasetPart
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials

from .barge_alongside import EFFECT


def make(drag: float = 0.05, seed: int = 1) -> Dataset:
    """Any function that returns a `Dataset` in SI and shipbench's signs will do; data of your own are read from files
    here.

    Its arguments are parameters of the data set: `barge_trial[drag=0.02]`.
    """
    plan = Trials(runs=12, samples=60, gusts=0.0, astern=False, thrusters=False)
    return sea_trials(load_mmg_ship("container130"), int(seed), [Hidden(EFFECT, (drag,))], plan, name="barge_trial")


# name (that of the entry point), one line, licence, function, and whether shipbench keeps what the function made
DATASET = DatasetPart(
    "barge_trial", "12 simulated manoeuvres with a barge alongside, 60 s at 1 s, sensor noise", "MIT", make, cached=True
)
