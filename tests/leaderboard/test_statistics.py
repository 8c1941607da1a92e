"""Intervals and paired tests: against values by hand and numpy, and how often they are right on drawn data."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from shipbench.leaderboard import statistics
from shipbench.leaderboard.statistics import Bootstrap, Matched, interval


def matched(errors, models=("a", "b"), codes=None, weights=None, resamples=999):
    """`errors` (windows, models); every window is a run of its own unless `codes` say otherwise."""
    errors = np.asarray(errors, float)
    codes = np.arange(len(errors)) if codes is None else np.asarray(codes)
    boot = Bootstrap([f"{i:04d}" for i in range(codes.max() + 1)], resamples)
    return Matched(
        list(models), errors, np.ones(len(errors)) if weights is None else np.asarray(weights, float), codes, boot
    )


def test_spread_of_a_resample_is_numpys_on_the_drawn_runs_written_out():
    boot = Bootstrap(list("abcdefg"), 50)
    values = np.array([3.0, 1.0, 4.0, 1.5, 9.0, 2.0, 6.0])
    found = boot.spread(np.arange(7), values)
    for counts, (median, std, iqr) in zip(boot.counts.astype(int), found, strict=True):
        drawn = np.repeat(values, counts)
        assert median == pytest.approx(np.median(drawn))
        assert std == pytest.approx(np.std(drawn, ddof=1), abs=1e-6)
        assert iqr == pytest.approx(np.subtract(*np.quantile(drawn, [0.75, 0.25])))


def test_blocks_of_resamples_are_the_whole(monkeypatch):
    names, values = [f"{i:03d}" for i in range(60)], np.random.default_rng(0).gamma(1.0, 10.0, 60)
    whole = Bootstrap(names, 99)
    spread = whole.spread(np.arange(60), values)
    monkeypatch.setattr(statistics, "_CELLS", 60 * 8)
    blocks = Bootstrap(names, 99)
    assert np.array_equal(
        blocks.counts, np.random.default_rng(statistics.DRAW_SEED).multinomial(60, np.full(60, 1 / 60), size=99)
    )
    assert np.array_equal(blocks.counts, whole.counts)
    np.testing.assert_allclose(blocks.spread(np.arange(60), values), spread, rtol=1e-13)


def test_mean_of_a_resample_weighs_windows_and_leaves_out_what_has_no_score():
    boot = Bootstrap(list("ab"), 200)
    drawn = boot.means(
        np.array([0, 0, 1, 1]), np.array([[1.0], [3.0], [10.0], [np.nan]]), np.array([[1.0], [1.0], [2.0], [5.0]])
    )[:, 0]
    expected = {(2, 0): 2.0, (1, 1): (1 + 3 + 2 * 10) / 4, (0, 2): 10.0}
    assert all(
        value == pytest.approx(expected[tuple(c)]) for value, c in zip(drawn, boot.counts.astype(int), strict=True)
    )


def test_windows_of_one_run_add_no_certainty():
    rng = np.random.default_rng(0)
    errors = rng.lognormal(size=(12, 2))
    alone, copied = matched(errors), matched(np.repeat(errors, 5, axis=0), codes=np.repeat(np.arange(12), 5))
    [first], [second] = alone.pairs(["a", "b"]), copied.pairs(["a", "b"])
    assert second.p == pytest.approx(first.p)
    assert (second.low, second.high) == pytest.approx((first.low, first.high))
    apart = matched(np.repeat(errors, 5, axis=0)).pairs(["a", "b"])[0]  # what counting windows as runs would claim
    assert apart.high - apart.low < 0.6 * (first.high - first.low)


def test_intervals_hold_the_truth_and_tests_are_not_fooled_as_often_as_they_say():
    rng = np.random.default_rng(3)
    boot, runs, windows, repeats = Bootstrap([f"{i:02d}" for i in range(20)], 499), 20, 3, 400
    codes, ones = np.repeat(np.arange(runs), windows), np.ones((runs * windows, 1))

    def drawn():
        return np.repeat(rng.standard_normal(runs), windows) + rng.standard_normal(runs * windows)

    covered = rejected = seen = 0
    for _ in range(repeats):
        low, high = interval(boot.means(codes, drawn()[:, None], ones)[:, 0], runs)
        covered += low <= 0 <= high
        totals = [boot.totals(codes, np.stack([drawn() - drawn() + shift, ones[:, 0]], axis=1)) for shift in (0.0, 2.0)]
        rejected += boot.p_value(totals[0][:, 0], totals[0][:, 1]) < 0.05
        seen += boot.p_value(totals[1][:, 0], totals[1][:, 1]) < 0.05
    assert 0.91 <= covered / repeats <= 0.985
    assert rejected / repeats <= 0.08
    assert seen / repeats >= 0.95  # the test can also see something


def test_few_runs_widen_the_interval_beyond_plain_percentiles():
    values = np.random.default_rng(1).standard_normal(4999)
    plain = np.quantile(values, [0.025, 0.975])
    few, many = interval(values, 6), interval(values, 2000)
    assert few[0] < 1.2 * plain[0]
    assert few[1] > 1.2 * plain[1]
    np.testing.assert_allclose(many, plain, rtol=0.02)
    assert np.isnan(interval(values, 1)).all()


def test_p_is_holms_step_down_over_all_pairs():
    rng = np.random.default_rng(5)
    errors = rng.normal(size=(30, 4)) + np.array([0.0, 0.4, 0.8, 1.2]) + 10.0
    pairs = matched(errors, "abcd").pairs(list("abcd"))
    assert [(p.first, p.second) for p in pairs] == [
        ("a", "b"),
        ("a", "c"),
        ("a", "d"),
        ("b", "c"),
        ("b", "d"),
        ("c", "d"),
    ]
    expected, running = {}, 0.0
    for i, pair in enumerate(sorted(pairs, key=lambda p: p.p)):
        running = max(running, min(1.0, (6 - i) * pair.p))
        expected[pair.first, pair.second] = running
    assert sum(p.p < p.p_holm < 1 for p in pairs) >= 4  # or the check could not tell Holm from Bonferroni
    for pair in pairs:
        assert pair.p_holm == pytest.approx(expected[pair.first, pair.second])


def test_equal_models_are_not_told_apart_and_p_has_a_floor():
    errors = np.random.default_rng(2).lognormal(size=(40, 1))
    [same] = matched(np.hstack([errors, errors])).pairs(["a", "b"])
    assert (same.difference, same.p, same.better) == (0.0, 1.0, 0)
    [apart] = matched(np.hstack([errors, errors + 10])).pairs(["a", "b"])
    assert (apart.difference, apart.better, apart.windows) == (pytest.approx(-10), 40, 40)
    assert apart.p == pytest.approx(1 / 1000)


def test_win_rate_counts_ties_half_and_missing_scores_as_lost():
    errors = [[1.0, 2.0, 3.0], [2.0, 2.0, 1.0], [np.nan, 1.0, np.nan]]
    found = matched(errors, "abc")
    np.testing.assert_allclose(found.wins("a", ["b", "c"]), [1.0, 0.25, 0.25])  # the last: lost to b, level with c
    assert found.win_rate("a", ["b", "c"])[0] == pytest.approx(0.5)
    assert found.complete == ["b"]


def test_skill_is_one_less_the_ratio_of_the_means():
    found = matched([[1.0, 4.0], [2.0, 4.0], [3.0, 4.0]])
    skill, low, high = found.skill("a", "b")
    assert skill == pytest.approx(0.5)
    assert low < skill < high
    assert found.skill("b", "a")[0] == pytest.approx(-1.0)
    assert np.isnan(matched([[1.0, 0.0], [2.0, 0.0]]).skill("a", "b")).all()  # nothing to be better than
    assert np.isnan(matched([[1.0, 4.0], [np.nan, 4.0]]).skill("a", "b")).all()


def test_a_window_that_a_model_is_not_asked_for_is_left_out_of_its_comparisons():
    rng = np.random.default_rng(3)
    errors = rng.lognormal(size=(12, 3)) + np.array([0.0, 5.0, 9.0])
    errors[8:, 1] = np.nan
    asked = np.isfinite(errors)
    found = replace(matched(errors, "abc"), asked=asked)
    first = matched(errors[:8], "abc")
    assert (found.complete, found.comparable) == (["a", "c"], ["a", "b", "c"])
    pairs = {(p.first, p.second): p for p in found.pairs("abc")}
    alone = {(p.first, p.second): p for p in first.pairs("abc")}
    assert {pair: p.windows for pair, p in pairs.items()} == {("a", "b"): 8, ("a", "c"): 12, ("b", "c"): 8}
    assert pairs["a", "b"].difference == pytest.approx(alone["a", "b"].difference)
    assert pairs["a", "b"].p == pytest.approx(alone["a", "b"].p)
    assert found.skill("b", "c")[0] == pytest.approx(first.skill("b", "c")[0])
    assert np.isnan(found.wins("b", ["a", "c"])[8:]).all()
    assert found.win_rate("b", ["a", "c"])[0] == pytest.approx(first.win_rate("b", ["a", "c"])[0])
    assert np.array_equal(found.wins("c", ["a", "b"])[8:], found.wins("c", ["a"])[8:])
    nothing = replace(found, asked=asked & [True, False, True])
    assert nothing.comparable == ["a", "c"]
    assert np.isnan(nothing.win_rate("b", ["a", "c"])).all()
    assert nothing.common("a", "b") is None


def test_draws_are_the_same_every_time():
    assert np.array_equal(Bootstrap(["x", "y", "z"]).counts, Bootstrap(["z", "x", "y"]).counts)
