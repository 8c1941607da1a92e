"""No leak: folds by run, groups together, windows after the split."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.bench.folds import make_folds, mean_speed, select_runs
from shipbench.bench.severity import measured, severities
from shipbench.bench.task import make_task
from shipbench.errors import InputError
from shipbench.signals import DELTA, U, V


def task(**changes):
    return make_task({"dataset": "toy", "models": ["hold"], "horizon_s": 20, **changes})


def parents(dataset):
    return {r.parent for r in dataset.runs} if dataset else set()


def sides(fold):
    return parents(fold.train), parents(fold.valid), parents(fold.test)


def disjoint(*parts):
    return sum(len(p) for p in parts) == len(set().union(*parts))


def test_ninety_runs_give_five_folds_of_64_8_and_18(toy):
    for fold in make_folds(toy(90), task()):
        assert [len(s) for s in sides(fold)] == [64, 8, 18]


def test_every_run_is_tested_once_and_never_seen_in_its_own_fold(toy):
    data = toy(23)
    folds = make_folds(data, task(folds=4))
    tested = [r for f in folds for r in sides(f)[2]]
    assert sorted(tested) == [r.id for r in data.runs]
    for fold in folds:
        train, valid, test = sides(fold)
        assert disjoint(train, valid, test)
        assert len(train | valid | test) == 23


def test_folds_depend_on_their_seed_only(toy):
    first, again, other = (make_folds(toy(20), task(fold_seed=s)) for s in (0, 0, 1))
    assert [sides(f) for f in first] == [sides(f) for f in again]
    assert [sides(f) for f in first] != [sides(f) for f in other]


def test_runs_of_one_group_stay_on_one_side(toy):
    data = toy(24, meta=lambda i: {"group": f"log{i // 3}"})
    groups = {r.id: r.meta.group for r in data.runs}
    folds = make_folds(data, task(folds=4, valid_runs=3))
    assert [len(sides(f)[2]) for f in folds] == [6, 6, 6, 6]
    for fold in folds:
        train, valid, test = ({groups[r] for r in side} for side in sides(fold))
        assert disjoint(train, valid, test)


def test_windows_are_cut_after_the_split_and_share_no_sample_across_it(toy):
    data = toy(8, steps=65)
    for fold in make_folds(data, task(folds=4, stride_s=5)):
        train, valid, test = sides(fold)
        assert disjoint(train, valid, test)
        seen = {tuple(row) for part in (fold.train, fold.valid) for r in part.runs for row in r.states}
        scored = {tuple(row) for r in fold.test.runs for row in r.states}
        assert not seen & scored


def test_folds_share_the_windows_of_a_run(toy):
    folds = make_folds(toy(8, steps=65), task(folds=4))
    windows = [window for fold in folds for part in (fold.train, fold.valid, fold.test) for window in part.runs]
    assert len({id(window) for window in windows}) == len({window.id for window in windows}) < len(windows)


def test_scored_windows_follow_the_stride_and_training_windows_do_not_overlap(toy):
    [fold, *_] = make_folds(toy(4, steps=60), task(folds=2, stride_s=10, valid_runs=0))
    assert [r.id for r in fold.test.runs][:5] == [f"{sorted(parents(fold.test))[0]}@{t}s" for t in (0, 10, 20, 30, 40)]
    assert [int(r.t[0]) for r in fold.train.runs] == [0, 20, 40] * 2


def test_a_run_of_exactly_the_horizon_is_used_and_a_shorter_one_is_told(toy):
    data = toy(4, steps=20)
    cut = data.with_runs([*data.runs[:3], data.runs[3].slice(0, 20)])
    kept, notes = select_runs(cut, task())
    assert [r.id for r in kept.runs] == ["r00", "r01", "r02"]
    assert "1 of 4 runs are shorter than the horizon and left out: r03" in notes[0]
    assert len(select_runs(data, task())[0]) == 4


def test_history_comes_before_the_scored_window(toy):
    data = toy(4, steps=25)
    [fold, *_] = make_folds(data, task(folds=2, history_s=5))
    batch = fold.test.batch(5)
    run = next(r for r in data.runs if r.id == batch.ids[0])
    np.testing.assert_array_equal(batch.s0[0], run.states[5])
    np.testing.assert_array_equal(batch.truth[0], run.states[6:])
    np.testing.assert_array_equal(batch.history[0][0], run.states[:5])


def test_max_runs_spreads_over_the_data_set(toy):
    kept, notes = select_runs(toy(90), task(max_runs=4))
    assert [r.id for r in kept.runs] == ["r00", "r30", "r59", "r89"]
    assert "4 of 90 runs" in notes[0]


def test_the_published_split_is_one_fold_and_its_validation_runs_come_from_training(toy):
    data = toy(10, meta=lambda i: {"split": "test" if i >= 8 else "train"} if i >= 1 else {})
    [fold] = make_folds(data, task(split="published", valid_runs=2))
    train, valid, test = sides(fold)
    assert test == {"r08", "r09"}
    assert train | valid == {f"r0{i}" for i in range(1, 8)}
    assert len(valid) == 2


def test_a_group_on_both_sides_of_the_published_split_is_told(toy):
    data = toy(4, meta=lambda i: {"split": "test" if i == 3 else "train", "group": f"log{i // 2}"})
    assert select_runs(data, task(split="published"))[1] == (
        "the published split has pieces of 'log1' both in training and in test",
    )


@pytest.mark.parametrize(
    ("changes", "meta", "message"),
    [
        ({"folds": 5}, lambda i: {"group": "log"}, r"'toy' is one run or one group of runs.*remove `group`"),
        ({"folds": 11}, lambda i: {}, r"folds = 11, but data set 'toy' has 10 runs; give at most 10"),
        ({"folds": 3}, lambda i: {"group": i % 2}, r"has 2 groups of runs"),
        ({"horizon_s": 21}, lambda i: {}, r"no run is as long as the horizon.*\(21 s\).*Shorten the horizon"),
        ({"split": "published"}, lambda i: {}, r"no usable run of data set 'toy' has split = \"train\""),
        ({"valid_runs": 8}, lambda i: {}, r"valid_runs = 8, but only 8 training runs"),
    ],
)
def test_what_cannot_be_split_is_refused(toy, changes, meta, message):
    def split():
        make_folds(select_runs(toy(10, meta=meta), task(**changes))[0], task(**changes))

    with pytest.raises(InputError, match=message):
        split()


def test_leaving_a_kind_of_manoeuvre_out_trains_on_all_others(toy):
    kinds = ("zigzag", "turn", "stop")
    data = toy(12, meta=lambda i: {"manoeuvre": kinds[i % 3]})
    kind = {r.id: r.meta.manoeuvre for r in data.runs}
    folds = make_folds(data, task(split="kind"))
    assert [{kind[r] for r in sides(f)[2]} for f in folds] == [{"stop"}, {"turn"}, {"zigzag"}]
    for fold in folds:
        train, valid, test = sides(fold)
        assert len(train | valid) == 8
        assert len(test) == 4
        assert not {kind[r] for r in train | valid} & {kind[r] for r in test}
    notes = select_runs(data, task(split="kind"))[1]
    assert notes[0] == "fold 0 scores 'stop' (4 runs) after training on the other kinds (8 runs)"


def test_a_piece_of_a_scored_log_trains_nothing(toy):
    """Group log0 holds a run of each kind: where one is scored, the other must not be trained on."""
    data = toy(8, meta=lambda i: {"manoeuvre": "turn" if i % 2 else "stop", "group": f"log{i // 2 if i < 2 else i}"})
    for fold in make_folds(data, task(split="kind", valid_runs=0)):
        train, _, test = sides(fold)
        assert len({"r00", "r01"} & train) == 0
        assert len({"r00", "r01"} & test) == 1


def test_the_split_by_speed_scores_the_fastest_runs_only(toy):
    data = toy(20)
    speed = {r.id: mean_speed(r) for r in data.runs}
    [fold] = make_folds(data, task(split="speed", folds=4))
    train, valid, test = sides(fold)
    assert len(test) == 5
    assert min(speed[r] for r in test) > max(speed[r] for r in train | valid)
    [note] = select_runs(data, task(split="speed", folds=4))[1]
    assert note.startswith("trained on 15 runs with mean speeds of ")
    assert f"to {max(speed.values()):.3g} m/s" in note


def steered(dataset, rudder):
    """The runs at 5 m/s without drift; run i has its rudder at rudder[i] degrees."""
    runs = []
    for run, angle in zip(dataset.runs, rudder, strict=True):
        states = run.states.copy()
        states[:, U], states[:, V], states[:, DELTA] = 5.0, 0.0, np.deg2rad(angle)
        runs.append(replace(run, states=states))
    return dataset.with_runs(runs)


def test_extrapolation_tests_every_run_beyond_all_training_runs(toy):
    data = toy(20)
    severity = dict(zip((r.id for r in data.runs), severities(measured(data.runs)), strict=True))
    [fold] = make_folds(data, task(split="extrapolate", valid_runs=2))
    train, valid, test = sides(fold)
    assert [len(side) for side in (train, valid, test)] == [10, 2, 8]
    assert min(severity[r] for r in test) > max(severity[r] for r in train | valid)
    largest = measured([data[r] for r in sorted(train | valid)]).max(axis=0)
    assert (measured([data[r] for r in sorted(test)]) > largest).any(axis=1).all()


def test_extrapolation_says_which_ranges_were_trained_and_tested(toy):
    data = steered(toy(10), [10, -20, 5, 35, -4, 15.2, 8, 11.8, 25, 2])
    assert select_runs(data, task(split="extrapolate"))[1] == (
        "trained on the 6 least severe runs: rudder up to 11.8 deg, drift angle up to 0 deg, speed up to 5.00 m/s",
        "tested on runs beyond: rudder 15.2 to 35.0 deg in 4 of 4",
    )


def test_extrapolation_leaves_out_the_mild_runs_of_a_group_that_is_tested(toy):
    rudder = [2, 35, 3, 30, 4, 5, 6, 7, 8, 9]
    data = steered(toy(10, meta=lambda i: {"group": i // 2 if i < 4 else i}), rudder)
    [fold] = make_folds(data, task(split="extrapolate", valid_runs=0))
    assert sides(fold) == ({"r04", "r05", "r06", "r07", "r08", "r09"}, set(), {"r01", "r03"})
    assert select_runs(data, task(split="extrapolate"))[1][-1] == (
        "left out: 2 runs that are no more severe than the training runs"
    )


@pytest.mark.parametrize(
    ("group", "rudder", "message"),
    [
        (
            lambda i: {},
            [10] * 10,
            r"all runs are alike: severity 1 at most, 1 in the training runs, and more than 1\.1",
        ),
        (lambda i: {}, [10.0 + 0.1 * i for i in range(10)], r"in data set 'toy' rudder, drift angle and speed of all"),
        (lambda i: {"group": 1}, range(10), r"all runs are one group, which no split may part\. Add runs"),
    ],
)
def test_runs_that_are_alike_have_nothing_to_extrapolate_to(toy, group, rudder, message):
    with pytest.raises(InputError, match=message):
        make_folds(steered(toy(10, meta=group), rudder), task(split="extrapolate"))


def test_fewer_training_runs_are_among_the_more_and_are_scored_on_the_same(toy):
    data = toy(30)
    found = {n: make_folds(data, task(folds=3, train_runs=n, valid_runs=4)) for n in (4, 8, 20)}
    for few, more, all_ in zip(*found.values(), strict=True):
        assert sides(few)[2] == sides(more)[2] == sides(all_)[2]
        known = [sides(f)[0] | sides(f)[1] for f in (few, more, all_)]
        assert [len(k) for k in known] == [4, 8, 20]
        assert known[0] < known[1] < known[2]
        assert [len(sides(f)[1]) for f in (few, more, all_)] == [1, 2, 4]
    whole = make_folds(data, task(folds=3, valid_runs=4))
    assert [sides(f)[0] | sides(f)[1] for f in whole] == [sides(f)[0] | sides(f)[1] for f in found[20]]


@pytest.mark.parametrize(
    ("changes", "meta", "message"),
    [
        ({"split": "kind"}, lambda i: {"manoeuvre": "turn"}, r"every run has manoeuvre = 'turn'; name the kinds"),
        ({"split": "kind"}, lambda i: {}, r"every run has manoeuvre = ''"),
        (
            {"split": "kind"},
            lambda i: {"manoeuvre": "ab"[i % 2], "group": 1},
            r"without 'a' no run is left to train on",
        ),
        ({"split": "speed"}, lambda i: {"group": 1}, r"has one group of runs only"),
        ({"train_runs": 9}, lambda i: {}, r"train_runs = 9, but fold 0 has 8 training runs; give at most 8"),
        (
            {"train_runs": 3, "folds": 2},
            lambda i: {"group": i // 2},
            r"in fold 0 that is fewer than two groups of runs",
        ),
    ],
)
def test_a_split_that_cannot_be_made_says_why(toy, changes, meta, message):
    with pytest.raises(InputError, match=message):
        make_folds(toy(10, meta=meta), task(**changes))
