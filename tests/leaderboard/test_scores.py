"""Scores of a data set: statistics, order of the models, baseline."""

from __future__ import annotations

import numpy as np
import pytest
from made_results import by_title, first_table, many, results

from shipbench.errors import InputError
from shipbench.leaderboard.pages import build_board


def test_statistics_are_taken_per_fold_and_then_averaged():
    row = first_table(build_board(results({"m": [[1, 2, 6], [10, 10, 40]]}), "toy"))["m"]
    assert row["ed_mean"] == pytest.approx((3 + 20) / 2)
    assert row["ed_median"] == pytest.approx((2 + 10) / 2)
    assert row["ed_std"] == pytest.approx((np.sqrt(7) + np.sqrt(300)) / 2)
    assert row["ed_iqr"] == pytest.approx((2.5 + 15) / 2)  # linear quantiles: 4 - 1.5 and 25 - 10
    assert row["cvdm_mean"] == pytest.approx(3 * 11.5)


def test_models_are_sorted_by_mean_ed_and_incomplete_ones_come_after_all_complete_ones():
    board = build_board(
        results({"bad": [[9, 9]], "good": [[1, 3]], "dead": [[None, None]], "lucky": [[0.1, None]]}), "toy"
    )
    assert board.ranking == ["good", "bad", "lucky", "dead"]
    rows = first_table(board)
    assert (rows["lucky"]["runs"], rows["dead"]["runs"]) == ("1/2", "0/2")
    assert np.isnan(rows["dead"]["ed_mean"])
    assert any("ranks below all complete ones" in note for note in board.tables[0].notes)


def test_a_model_that_lacks_a_fold_is_incomplete():
    assert build_board(results({"full": [[5, 5], [5, 5]], "half": [[1, 1]]}), "toy").ranking == ["full", "half"]


def test_the_ceiling_has_no_rank():
    rows = first_table(build_board(results({"oracle": [[0, 0]], "m": [[1, 1]]}), "toy"))
    assert (rows["oracle"]["rank"], rows["m"]["rank"]) == ("", "1")


def test_every_figure_of_table_iii_has_an_interval_around_it():
    row = first_table(build_board(results({"m": many(0)}), "toy"))["m"]
    for metric in ("ed", "edh", "cvdm"):
        for statistic in ("mean", "median", "std", "iqr"):
            low, high = row[f"{metric}_{statistic}_low"], row[f"{metric}_{statistic}_high"]
            assert low < row[f"{metric}_{statistic}"] < high
    text = build_board(results({"m": many(0)}), "toy").tables[0].markdown()
    assert f"{row['ed_mean']:.2f}<br><sub>{row['ed_mean_low']:.2f} to\u00a0{row['ed_mean_high']:.2f}</sub>" in text


def test_the_interval_of_the_mean_is_that_of_the_mean_over_folds():
    """Folds of different size: each counts the same, as in the figure itself."""
    row = first_table(build_board(results({"m": [[0.0] * 20 + [1.0] * 20, [10.0, 11.0]]}), "toy"))["m"]
    assert row["ed_mean"] == pytest.approx(5.5)
    assert row["ed_mean_low"] < 5.5 < row["ed_mean_high"]


def test_the_baseline_can_be_named_and_must_be_there():
    models = {"hold": many(1, offset=3.0), "physics": many(1)}
    table = by_title(build_board(results(models), "toy", "physics"), "Ranking")
    assert "skill against `physics` [%]" in {c.header for c in table.columns}
    with pytest.raises(InputError, match=r"--baseline: .*'physic'.*Did you mean 'physics'"):
        build_board(results(models), "toy", "physic")
    without = by_title(build_board(results({"a": many(0), "b": many(1)}), "toy"), "Ranking")
    assert "skill" not in without.rows[0]
    assert without.notes[0].startswith("No skill: no rows of the baseline `hold`")
