"""A log that reads nothing where the ship makes way is told and replaced by the track; a ship that stops, or drifts
with the water, is neither."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.checking.base import check_dataset
from shipbench.checking.speed_log import dropout
from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.preparation.base import Prepared
from shipbench.diagnosis.preparation.log_dropout import speeds_of_the_track
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.signals import U, V, X, Y
from shipbench.simulate.trials import Trials, sea_trials


def trials(ship: str = "container130", noise: float = 1.0) -> Dataset:
    return sea_trials(load_mmg_ship(ship), 5, (), Trials(runs=16, samples=120, noise=noise))


def silent(data: Dataset, share: float = 0.3) -> Dataset:
    """Surge and sway read a hundredth of themselves in the slowest samples."""
    runs = []
    below = np.quantile(np.abs(np.concatenate([run.states[:, U] for run in data.runs])), share)
    for run in data.runs:
        states = run.states.copy()
        slow = np.abs(states[:, U]) < below
        states[np.ix_(slow, [U, V])] *= 0.01
        runs.append(replace(run, states=states))
    return data.with_runs(runs)


def drifting(slowly: float, water: tuple[float, float], noise: float = 0.02) -> Dataset:
    """Ships of 130 m that hardly move through water which does: speeds are through water, positions over ground; noise:
    of the log [m/s]."""
    plan, t, runs = trials(), np.arange(200.0), []
    for i, run in enumerate(plan.runs):
        rng = np.random.default_rng(i)
        states = np.zeros((len(t), 10))
        states[:, U] = slowly * np.sin(2.0 * np.pi * t / 100.0 + i)
        states[:, X] = np.cumsum(states[:, U]) + water[0] * t
        states[:, Y] = water[1] * t
        states[:, [X, Y]] += 0.3 * rng.standard_normal((len(t), 2))
        states[:, [U, V]] += noise * rng.standard_normal((len(t), 2))
        runs.append(replace(run, t=t, states=states, inputs=states[:, 6:10]))
    return replace(plan, dt=1.0, runs=tuple(runs))


@pytest.mark.long
@pytest.mark.parametrize(
    ("ship", "noise", "share"), [("container130", 1.0, 0.3), ("kcs", 1.0, 0.5), ("kvlcc2_l7", 0.0, 0.3)]
)
def test_it_is_told_on_ships_of_any_size(ship, noise, share):
    data = trials(ship, noise)
    assert dropout(data) is None
    (finding,) = check_dataset(silent(data, share))
    assert finding.kind == "speed-log dropout"
    assert finding.channels == ("u", "v")
    assert finding.severity == "error"


def test_runs_of_a_few_samples_tell_nothing_and_hinder_nothing():
    short = [
        replace(run, id=f"{run.id}-short", t=run.t[:3], states=run.states[:3], inputs=run.inputs[:3])
        for run in trials().runs
    ]
    assert dropout(trials().with_runs(short)) is None
    whole = silent(trials())
    assert dropout(whole.with_runs([*whole.runs, *short])).pieces == dropout(whole).pieces


@pytest.mark.parametrize(("slowly", "water"), [(0.0, (0.5, -0.3)), (0.08, (0.0, 0.0)), (0.08, (1.0, 1.0))])
def test_a_ship_that_lies_still_in_a_current_or_creeps_has_a_log(slowly, water):
    assert dropout(drifting(slowly, water)) is None


def test_what_a_noisy_log_says_within_its_noise_counts():
    """It never reads more than six times its noise, the track departs by 6 m, and the log explains it."""
    seen = drifting(0.4, (0.5, -0.3), noise=0.1)
    assert dropout(seen) is None
    assert dropout(silent(seen, 1.0)) is not None


def test_the_same_creep_with_a_log_that_does_not_see_it_is_told():
    seen = drifting(1.0, (0.5, -0.3))
    assert dropout(seen) is None
    assert dropout(silent(seen, 1.0)) is not None


@pytest.mark.long
def test_the_diagnosis_takes_the_speeds_of_the_track():
    data = trials()
    ready = speeds_of_the_track(Prepared(silent(data)))
    mended, (line,) = ready.dataset, ready.notes
    assert line.startswith("u and v read zero (below ")
    assert line.endswith("u and v are taken from the positions in all runs instead.")
    assert mended.derived == ("u", "v")
    error = np.concatenate(
        [a.states[10:-10, U] - b.states[10:-10, U] for a, b in zip(mended.runs, trials(noise=0.0).runs, strict=True)]
    )
    assert np.sqrt(np.mean(error**2)) < 0.1
    verdict = diagnose(silent(data), gain=False)
    assert (verdict.verdict, verdict.causes) == ("none", ())
    assert line in verdict.warnings
