"""What is held out is held out whole: pieces of one log, or copies, are never on both sides; nor do they count as so
many runs of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from every_day import every
from threadpoolctl import threadpool_info, threadpool_limits

import shipbench
from shipbench.diagnosis.diagnose import _folds, _one_fold, _proposed, diagnose
from shipbench.diagnosis.evaluation.held_out_gain import fold_errors, mean_interval, on_fitted_runs, summarise
from shipbench.diagnosis.result import Calibrated
from shipbench.diagnosis.selection.analysis import THRESHOLD, causes_of, plain_model
from shipbench.effects.base import EFFECTS
from shipbench.estimation.budget import Budget
from shipbench.estimation.calibration import calibrated, estimated
from shipbench.estimation.forward import Plant
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials


def grouped(groups: str, samples: int = 5, *hidden: Hidden) -> Dataset:
    """Runs whose groups are the letters; "-" is a run without one."""
    data = sea_trials(load_mmg_ship("kcs"), 3, hidden, Trials(runs=len(groups), samples=samples))
    return data.with_runs(
        [r if g == "-" else replace(r, meta=replace(r.meta, group=g)) for r, g in zip(data.runs, groups, strict=True)]
    )


@pytest.mark.parametrize("groups", ["a----a--a---", "aabbccddeeff", "aaaaaaab", "abab", "------------", "---"])
@pytest.mark.parametrize("seed", every(3, range(5)))
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
        _one_fold(0, 10.0, dataset=grouped("-" * 6), seed=0, only=None, settled=(), budget=Budget())
    assert threads
    assert set(threads) == {1}


def test_the_gain_is_that_of_the_proposed_model_as_the_benchmark_scores_it():
    """Errors of the same fold. The benchmark draws other validation runs, and its fit has white noise; where rollouts
    refine neither, both are the same maximum of the posterior."""
    current = Hidden(EFFECTS.get("current"), (0.25, -0.2))
    data = sea_trials(load_mmg_ship("container130"), 5, (current,), Trials(runs=10, samples=60))
    test = _folds(data, 0)[0]
    sides = ["test" if i in test else "train" for i in range(len(data))]
    runs = [replace(r, meta=replace(r.meta, split=side)) for r, side in zip(data.runs, sides, strict=True)]
    null = plain_model(Plant.of(data.with_runs([r for i, r in enumerate(runs) if i not in test])), ("current",))
    final, gears = causes_of(null, THRESHOLD, ("current",))
    found = fold_errors(data, test, null, final, gears)
    models = ["calibrated", "calibrated+current"]
    scores = shipbench.benchmark(models, data.with_runs(runs), horizon=59.0, split="published", quiet=True)
    expected = scores.results.rows.groupby("model").ed.mean()
    assert found.calibrated.mean() == pytest.approx(expected["calibrated"], rel=0.05)
    assert found.with_causes.mean() == pytest.approx(expected["calibrated+current"], rel=0.05)
    assert found.with_causes.mean() < 0.7 * found.calibrated.mean() < found.file.mean()


@pytest.fixture(scope="module")
def other() -> Dataset:
    """Runs of a ship with a rudder of half the area that the file states."""
    data = sea_trials(load_mmg_ship("container130"), 5, (), Trials(runs=6, samples=60, gusts=0.0, noise=0.1))
    rudder = data.ship.rudder.model_copy(update={"area": 2.0 * data.ship.rudder.area})
    return replace(data, ship=data.ship.model_copy(update={"rudder": rudder}))


def on_fitted(data: Dataset) -> Calibrated:
    plant = Plant.of(data)
    return on_fitted_runs(data, calibrated(plant, estimated(plant)), 0)


def test_a_ship_off_her_file_is_predicted_far_better_once_calibrated(other):
    found = on_fitted(other)
    assert found.after < 0.7 * found.before
    assert found.ci95[0] < found.after < found.ci95[1]
    assert found.seconds == pytest.approx(60.0, abs=1.0)
    assert not found.held_out


def test_commands_alone_are_enough(other):
    runs = (Run(r.id, r.t, np.concatenate([r.states[:, :6], r.inputs], axis=1), r.inputs) for r in other.runs)
    found = on_fitted(replace(other, actuators="commanded", runs=tuple(runs)))
    assert 0.0 < found.after < found.before


def test_the_interval_of_a_mean_error_is_that_of_its_groups():
    errors = np.array([1.0] * 6 + [3.0] * 6)
    assert mean_interval(errors, 0, ["a"] * 6 + ["b"] * 6) == pytest.approx((1.0, 3.0))
    low, high = mean_interval(errors, 0, [str(i) for i in range(12)])
    assert 1.2 < low < 2.0 < high < 2.8


def test_the_proposed_model_has_what_a_predictor_can_have():
    better, worse = (Calibrated(9.4, after, (0.0, 1.0), 120.0, True) for after in (1.4, 9.6))
    assert _proposed(["current", "hull_derivatives", "unit_or_sign_error"], better) == "calibrated+current"
    assert _proposed([], better) == _proposed(["hull_derivatives"], better) == "calibrated"
    assert _proposed([], worse) == _proposed([], None) == "physics"
    assert _proposed(["current"], None) == "calibrated+current"


@pytest.mark.long
def test_a_verdict_without_a_cause_states_held_out_errors_too(other):
    data = other.with_runs([replace(r, id=f"{r.id}{k}") for k in "ab" for r in other.runs])
    found = diagnose(data, only=())
    assert found.calibration is not None
    assert found.calibration.held_out
    assert found.gain is None
