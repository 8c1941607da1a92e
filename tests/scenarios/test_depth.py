"""A depth that is recorded is in the fitted model."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.diagnosis.diagnose import _of_depth, diagnose
from shipbench.effects.base import EFFECTS
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.forward import DEEP, Plant
from shipbench.estimation.linearisation import Scales
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials

RATIOS = (0.15, 0.45, 0.7)
"""Draught over depth."""


def sounded(data: Dataset, depth: float) -> Dataset:
    names = (*data.inputs, "depth")
    return data.with_runs(
        [
            replace(run, inputs=np.column_stack([run.inputs, np.full(len(run), depth)]), inputs_names=names)
            for run in data.runs
        ]
    )


@pytest.fixture(scope="module")
def trials() -> Dataset:
    """Runs in water of three depths."""
    ship, shallow = load_mmg_ship("container130"), EFFECTS.get("shallow_water")
    parts = [
        sounded(sea_trials(ship, seed, [Hidden(shallow, (q,))], Trials(runs=5)), ship.T / q)
        for seed, q in enumerate(RATIOS)
    ]
    runs = [replace(run, id=f"{i}-{run.id}") for i, part in enumerate(parts) for run in part.runs]
    return replace(parts[0], runs=tuple(runs))


def unsounded(data: Dataset) -> Dataset:
    return data.with_runs(
        [replace(run, inputs=run.inputs[:, :-1], inputs_names=run.inputs_names[:-1]) for run in data.runs]
    )


@pytest.mark.long
def test_what_a_recorded_depth_does_is_in_the_model(trials):
    plants = [Plant.of(data) for data in (trials, unsounded(trials))]
    with_depth, without = (null_fit(plant, Scales(plant)) for plant in plants)
    assert with_depth.evidence > without.evidence + 50.0
    found = diagnose(trials, gain=False)
    assert (found.verdict, found.causes) == ("none", ())
    (line,) = [c for c in found.candidates if c.effect == "shallow_water"]
    assert line.rejected_because == "the depth is measured and in the model already"
    (warning,) = [w for w in found.warnings if w.startswith("the depth is recorded")]
    assert "1.4 to 6.7 draughts" in warning


def test_deep_water_changes_nothing(trials):
    deep = sounded(unsounded(trials), 1.1 * DEEP * trials.ship.T)
    assert Plant.of(deep).seg.depth is None
    assert Plant.of(trials).seg.depth.shape == Plant.of(trials).seg.run.shape


def test_a_depth_below_the_keel_is_not_used_and_said(trials):
    below = sounded(unsounded(trials.subset(range(6))), 0.6 * trials.ship.T)
    assert Plant.of(below).seg.depth is None
    (warning,) = _of_depth(below, Plant.of(below))
    assert "to one below the keel add the draught" in warning
