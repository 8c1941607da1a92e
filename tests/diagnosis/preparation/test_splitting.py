"""One log of half an hour, or a few: cut into parts that count as runs."""

from __future__ import annotations

import numpy as np
import pytest

from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.preparation.base import Prepared
from shipbench.diagnosis.preparation.splitting import LEAST_RUNS, split_long_runs
from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials

SHIP = load_mmg_ship("container130")


def _logs(runs: int, seconds: int) -> Dataset:
    """Without any motion in them."""
    rng, t = np.random.default_rng(1), np.arange(seconds + 1.0)
    logs = tuple(Run(f"r{i}", t, rng.standard_normal((len(t), 10)), np.zeros((len(t), 4))) for i in range(runs))
    return Dataset("logs", SHIP.particulars, 1.0, logs)


@pytest.mark.parametrize(("runs", "seconds", "parts"), [(1, 1800, 15), (3, 400, 9), (1, 6000, 24)])
def test_a_few_long_runs_are_cut_into_parts_of_equal_length(runs: int, seconds: int, parts: int):
    data = _logs(runs, seconds)
    ready = split_long_runs(Prepared(data))
    cut, told = ready.dataset, ready.notes
    assert len(cut) == parts
    assert f"cut into {parts} parts" in told[0]
    lengths = np.array([len(part) for part in cut.runs])
    assert np.ptp(lengths) <= 1
    assert lengths.min() >= 120
    for run in data.runs:
        own = [part for part in cut.runs if part.group == run.id]
        np.testing.assert_array_equal(
            np.concatenate([own[0].states, *(part.states[1:] for part in own[1:])]), run.states
        )


@pytest.mark.parametrize(("runs", "seconds"), [(1, 590), (4, 230), (LEAST_RUNS, 400)])
def test_short_runs_and_runs_enough_stay_as_they_are(runs: int, seconds: int):
    data = _logs(runs, seconds)
    assert split_long_runs(Prepared(data)) == Prepared(data)


@pytest.mark.long
@pytest.mark.parametrize("hidden", [pytest.param((), marks=pytest.mark.long), ("current",)])
def test_one_long_run_names_what_acted_in_it_and_says_that_it_was_one(hidden: tuple[str, ...]):
    causes = tuple(Hidden(EFFECTS.get(name), (0.3, 0.2)) for name in hidden)
    verdict = diagnose(sea_trials(SHIP, 5, causes, Trials(runs=1, samples=1200)), gain=False)
    assert [c.effect for c in verdict.causes] == [*hidden]
    assert "1 run of 1200 s in all: cut into 10 parts" in verdict.warnings[0]
