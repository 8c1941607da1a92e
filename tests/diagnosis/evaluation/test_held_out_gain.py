"""What is held out is held out whole: pieces of one log, or copies, are never on both sides; nor do they count as so
many runs of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from threadpoolctl import threadpool_info, threadpool_limits

from shipbench.diagnosis.diagnose import _folds, _one_fold, diagnose
from shipbench.diagnosis.evaluation.held_out_gain import summarise
from shipbench.effects.base import EFFECTS
from shipbench.estimation.budget import Budget
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials


def grouped(groups: str, samples: int = 5, *hidden: Hidden) -> Dataset:
    """Runs whose groups are the letters; "-" is a run without one."""
    data = sea_trials(load_mmg_ship("kcs"), 3, hidden, Trials(runs=len(groups), samples=samples))
    return data.with_runs(
        [r if g == "-" else replace(r, meta=replace(r.meta, group=g)) for r, g in zip(data.runs, groups, strict=True)]
    )


@pytest.mark.parametrize("groups", ["a----a--a---", "aabbccddeeff", "aaaaaaab", "abab", "------------", "---"])
@pytest.mark.parametrize("seed", range(5))
def test_no_fold_parts_a_group_and_every_run_is_held_out_once(groups, seed):
    data = grouped(groups)
    folds = _folds(data, seed)
    assert sorted(np.concatenate(folds).tolist()) == list(range(len(groups)))
    assert 2 <= len(folds) <= 5
    for group in {run.group for run in data.runs}:
        assert sum(any(data.runs[i].group == group for i in fold) for fold in folds) == 1
    largest = max(sum(run.group == g for run in data.runs) for g in {run.group for run in data.runs})
    assert max(map(len, folds)) <= -(-len(groups) // 5) + largest


def test_pieces_of_one_log_are_one_witness_of_the_gain():
    before, after = np.full(12, 10.0), np.array([5.0] * 6 + [9.0] * 6)
    alone = summarise(before, after, 0, [str(i) for i in range(12)])
    of_two_logs = summarise(before, after, 0, ["a"] * 6 + ["b"] * 6)
    assert of_two_logs.relative == alone.relative == pytest.approx(0.3)
    assert of_two_logs.ci95 == pytest.approx((0.1, 0.5))
    assert alone.ci95[0] > 0.15
    assert alone.ci95[1] < 0.45


@pytest.mark.long
def test_of_a_single_group_nothing_is_held_out_and_it_is_said():
    verdict = diagnose(grouped("aaaaaa", 80, Hidden(EFFECTS.get("heading_bias"), (0.06,))), gain=True)
    assert [c.effect for c in verdict.causes] == ["heading_bias"]
    assert verdict.gain is None
    assert any("all runs are one group" in w for w in verdict.warnings)


def test_a_part_in_a_process_of_its_own_takes_one_thread(monkeypatch):
    """Two processes on two cores with two threads each wait for each other: 24 runs with a current took 85 s, 12 s with
    one."""
    threads: list[int] = []

    def counted(*_: object) -> None:
        threads.extend(pool["num_threads"] for pool in threadpool_info() if pool["user_api"] == "blas")
        raise InterruptedError

    monkeypatch.setattr("shipbench.diagnosis.diagnose.causes_of", counted)
    with threadpool_limits(limits=2), pytest.raises(InterruptedError):
        _one_fold(0, 10.0, False, dataset=grouped("-" * 6), seed=0, only=None, settled=(), budget=Budget())
    assert threads
    assert set(threads) == {1}
