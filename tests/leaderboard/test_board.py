"""The leaderboard: statistics by hand, order, refusals, and pages rendered from rows."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from made_results import many, results

from shipbench.bench.regimes import COLUMNS as REGIME_COLUMNS
from shipbench.bench.results import PROTOCOL
from shipbench.bench.submissions import Results
from shipbench.errors import InputError
from shipbench.leaderboard.pages import build_board, write_boards
from shipbench.leaderboard.statistics import Matched
from shipbench.leaderboard.tables import PAPER
from shipbench.metrics.trial_indices import NAMES as TRIAL_NAMES
from shipbench.render.table import Table, TableColumn, number, significant

REGIMES = REGIME_COLUMNS[:5]


def first_table(board):
    return {row["model"]: row for row in board.tables[0].rows}


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


def test_reasons_of_runs_without_a_score_are_printed():
    status = build_board(results({"m": [[1, None]]}), "toy").tables[-1]
    assert status.rows[0]["diverged"] == 1
    assert any("`m` diverged in 1 rows (fold 0, run r01): u is nan at t = 3 s." in note for note in status.notes)


def test_a_table_without_any_scored_run_keeps_its_rows():
    board = build_board(results({"m": [[None, None], [None, None]]}), "toy")
    assert board.ranking == ["m"]
    assert np.isnan(first_table(board)["m"]["ed_mean"])
    assert "0/4" in board.tables[0].markdown()


def test_undefined_scores_are_counted():
    found = results({"m": [[1, 2]]})
    found.rows.loc[0, "cvdm"] = np.nan
    assert any(
        note.startswith("In 1 rows the true ship does not move") for note in build_board(found, "toy").tables[0].notes
    )


def test_angles_and_forces_are_shown_in_the_units_that_people_read():
    text = build_board(results({"m": [[1, 3]]}), "toy").markdown("cmd")
    assert "heading error [deg] |" in text
    assert f"{np.rad2deg(0.02):.2f}" in text
    assert "RMSE F_b [kN]" in text


def test_harbour90_stands_beside_the_papers_table():
    board = build_board(results({"physics": [[6, 12]], "mlp": [[20, 30]]}, "harbour90"), "harbour90")
    rows = first_table(board)
    assert [rows["paper: physics"][f"ed_{s}"] for s in ("mean", "median", "std", "iqr")] == list(
        PAPER["paper: physics"]["ed"]
    )
    claim = {row["where"]: row for row in board.tables[1].rows}
    assert claim["here"]["ed_mean"] == pytest.approx(100 * (1 - 9 / 25))
    assert claim["paper"]["ed_mean"] == pytest.approx(100 * (1 - 13.52 / 20.84))
    assert "paper: physics" not in first_table(build_board(results({"physics": [[6]]}), "toy"))


def by_title(board, words):
    return next(t for t in board.tables if words in t.title)


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


def test_ranking_gives_skill_win_rate_and_the_test_against_the_next_better():
    board = build_board(results({"hold": many(1, offset=3.0), "good": many(1), "better": many(2, offset=-0.5)}), "toy")
    table = by_title(board, "Ranking")
    rows = {row["model"]: row for row in table.rows}
    assert board.ranking == ["better", "good", "hold"]
    assert rows["hold"]["skill"] == 0.0
    assert rows["good"]["skill"] == pytest.approx(100 * (1 - rows["good"]["ed_mean"] / rows["hold"]["ed_mean"]))
    assert rows["good"]["skill_low"] < rows["good"]["skill"] < rows["good"]["skill_high"]
    assert sum(row["wins"] for row in table.rows) == pytest.approx(150)  # every comparison is won once
    assert "p_above" not in rows["better"]
    pairs = {(r["first"], r["second"]): r for r in by_title(board, "Paired").rows}
    assert rows["hold"]["p_above"] == pairs["good", "hold"]["p_holm"] == pytest.approx(3 / 5000)
    assert pairs["good", "hold"]["difference"] == pytest.approx(-3.0)
    assert pairs["good", "hold"]["better"] == "30/30"


def test_the_baseline_can_be_named_and_must_be_there():
    models = {"hold": many(1, offset=3.0), "physics": many(1)}
    table = by_title(build_board(results(models), "toy", "physics"), "Ranking")
    assert "skill against `physics` [%]" in {c.header for c in table.columns}
    with pytest.raises(InputError, match=r"--baseline: .*'physic'.*Did you mean 'physics'"):
        build_board(results(models), "toy", "physic")
    without = by_title(build_board(results({"a": many(0), "b": many(1)}), "toy"), "Ranking")
    assert "skill" not in without.rows[0]
    assert without.notes[0].startswith("No skill: no rows of the baseline `hold`")


def test_a_model_with_unscored_runs_is_not_tested_and_its_missing_runs_are_lost():
    board = build_board(results({"a": many(1), "b": many(2), "lucky": [[0.01] * 14 + [None], [0.01] * 15]}), "toy")
    table = by_title(board, "Paired")
    assert [(r["first"], r["second"]) for r in table.rows] in ([("a", "b")], [("b", "a")])
    assert any(note.startswith("Not tested: `lucky`") for note in table.notes)
    assert next(r for r in by_title(board, "Ranking").rows if r["model"] == "lucky")["wins"] == pytest.approx(
        100 * 29 / 30, abs=0.2
    )


def test_pairs_are_tested_once_for_all_tables(monkeypatch):
    """They grow with the square of the number of models: most of the time of a page of 200."""
    calls, pairs = [], Matched.pairs
    monkeypatch.setattr(Matched, "pairs", lambda self, models: calls.append(len(models)) or pairs(self, models))
    board = build_board(results({f"m{i}": many(i) for i in range(5)}), "toy")
    assert len(by_title(board, "Paired").rows) == 10
    assert calls == [5]


def test_the_ceiling_is_in_no_pair():
    board = build_board(results({"oracle": many(1), "a": many(2), "b": many(3)}), "toy")
    assert all("oracle" not in (r["first"], r["second"]) for r in by_title(board, "Paired").rows)


def with_seeds(found, seeds):
    """The same rows under more seeds, each with its own factor on every error."""
    parts = [found.rows.assign(seed=seed, ed=found.rows["ed"] * factor) for seed, factor in seeds.items()]
    return Results(pd.concat(parts, ignore_index=True), found.summaries, found.sources)


def test_seeds_are_averaged_inside_a_run_and_their_spread_has_a_column():
    one = results({"m": many(4), "other": many(5)})
    several = with_seeds(one, {0: 0.5, 1: 1.0, 2: 1.5})
    plain, table = (by_title(build_board(r, "toy"), "Ranking") for r in (one, several))
    first, second = plain.rows[0], next(r for r in table.rows if r["model"] == plain.rows[0]["model"])
    assert second["ed_mean"] == pytest.approx(first["ed_mean"])
    assert (second["ed_mean_low"], second["ed_mean_high"]) == pytest.approx(
        (first["ed_mean_low"], first["ed_mean_high"])
    )  # no more runs than before
    assert (second["seeds"], second["seed_spread"]) == (3, pytest.approx(0.5 * first["ed_mean"]))
    assert "ED \u03c3 over seeds [m]" in {c.header for c in table.columns}
    assert "seeds" not in {c.header for c in plain.columns}
    pair, again = (by_title(build_board(r, "toy"), "Paired").rows[0] for r in (one, several))
    assert again["p"] == pytest.approx(pair["p"])


def test_pieces_of_one_log_are_drawn_together():
    found = results({"a": many(1), "b": many(2)})
    number = found.rows["run"].map({run: i for i, run in enumerate(found.rows["run"].unique())})
    grouped = with_columns(found, {"group": (number // 5).map("log{}".format)})
    assert "over 30 runs" in by_title(build_board(found, "toy"), "Paired").notes[0]
    assert "over 6 runs" in by_title(build_board(grouped, "toy"), "Paired").notes[0]
    older = with_columns(
        grouped, {"group": grouped.rows["group"].where(grouped.rows["model"] == "a")}
    )  # rows of b from before the column
    assert "over 6 runs" in by_title(build_board(older, "toy"), "Paired").notes[0]


def test_the_papers_figures_stand_beside_its_own_task_only():
    found = results({"physics": [[6, 12]], "mlp": [[20, 30]]}, "harbour90")
    for summary in found.summaries:
        summary["task"] = summary["task"] | {"split": "speed"}
    board = build_board(found, "harbour90")
    assert "paper: physics" not in first_table(board)
    assert "trained on the slower runs, scored on the fastest" in board.head[0]


def windows_of(found, **values):
    frame = found.rows.drop_duplicates(["fold", "run"])[["dataset", "fingerprint", "task", "fold", "run"]].reset_index(
        drop=True
    )
    blank = dict.fromkeys(REGIMES, 0.0) | dict.fromkeys(TRIAL_NAMES, np.nan)
    return frame.assign(**(blank | values))


def test_slices_are_means_over_the_windows_of_each_regime():
    found = results({"m": [[1, 2, 3], [4, 5, 6]]})
    found.__dict__["windows"] = windows_of(
        found, speed=[1.0, 2, 3, 4, 5, 6], astern=[0, 0, 0, 0, 0.1, 0.5]
    )  # a cached property
    table = by_title(build_board(found, "toy"), "Regime")
    rows = {row["slice"]: (row["windows"], row["m0"]) for row in table.rows}
    assert rows == {
        "speed below 2.67 m/s": ("2", 1.5), "speed 2.67 to 4.33 m/s": ("2", 3.5), "speed above 4.33 m/s": ("2", 5.5),
        "never astern": ("4", 2.5), "astern": ("2", 5.5),
    }  # fmt: skip


def test_without_windows_there_are_no_slices():
    assert not any("Regime" in t.title for t in build_board(results({"m": [[1, 2]]}), "toy").tables)


def test_indices_of_manoeuvres_stand_beside_the_true_ones():
    found = results({"m": [[1, 2], [3, 4]]})
    found.__dict__["windows"] = windows_of(
        found, advance=[3.0, 5.0, np.nan, np.nan], overshoot_1=[np.nan, np.nan, 0.1, np.nan]
    )  # a cached property
    errors = {
        "advance_error": [-0.5, np.nan, np.nan, np.nan],
        "overshoot_1_error": [np.nan, np.nan, np.deg2rad(2.0), np.nan],
    }
    table = by_title(build_board(with_columns(found, errors), "toy"), "Indices")
    rows = {row["index"]: row for row in table.rows}
    assert list(rows) == ["advance [L]", "first overshoot [deg]"]
    assert rows["advance [L]"] == {
        "index": "advance [L]",
        "model": "m",
        "windows": 2,
        "reached": 1,
        "true": 4.0,
        "error": 0.5,
        "bias": -0.5,
    }
    assert rows["first overshoot [deg]"]["error"] == pytest.approx(2.0)


def with_columns(found, columns):
    made = Results(found.rows.assign(**columns), found.summaries, found.sources)
    made.__dict__["windows"] = found.windows  # a cached property
    return made


def test_kinds_of_manoeuvre_get_a_table():
    board = build_board(results({"m": [[1, 2, 3, 4]]}, kinds=("turn", "zigzag")), "toy")
    table = next(t for t in board.tables if "kind" in t.title)
    assert (table.rows[0]["turn"], table.rows[0]["zigzag"]) == (2.0, 3.0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fingerprint": "f2"}, r"different data \(fingerprints\).*f1: a; f2: b"),
        ({"protocol": PROTOCOL + 1}, r"different protocol versions"),
        ({"task": "t2"}, r"different tasks"),
    ],
)
def test_rows_of_different_kind_are_never_mixed(changes, message):
    first, second = results({"a": [[1]]}), results({"b": [[2]]}, **changes)
    mixed = Results(pd.concat([first.rows, second.rows]), first.summaries + second.summaries, [Path()] * 2)
    with pytest.raises(InputError, match=message):
        build_board(mixed, "toy")


def test_rows_of_an_older_protocol_are_refused():
    with pytest.raises(InputError, match=r"protocol 0, this version ranks protocol"):
        build_board(results({"a": [[1]]}, protocol=0), "toy")


def test_a_page_is_written_per_data_set_with_what_made_it(tmp_path):
    one, two = results({"a": [[1, 2]]}, "one"), results({"a": [[1, 2]]}, "two")
    both = Results(pd.concat([one.rows, two.rows]), one.summaries + two.summaries, [Path()] * 2)
    written = write_boards(both, tmp_path, "shipbench leaderboard x", plots=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one.md", "two.md"]
    text = written[0][1].read_text()
    for part in (
        "`f1`",
        f"protocol {PROTOCOL}",
        "2026-01-02",
        "`shipbench run -m x`",
        "`shipbench leaderboard x`",
        "source abc",
        "Note: depth unknown.",
    ):
        assert part in text


def test_a_table_escapes_what_would_break_markdown_and_gives_null_for_nan():
    table = Table("T", [TableColumn("m|n", "m"), TableColumn("v", "v", number(1))], [{"m": "a|b", "v": float("nan")}])
    assert "| m\\|n | v |" in table.markdown()
    assert "| a\\|b | - |" in table.markdown()
    assert table.as_json()["rows"] == [{"m": "a|b", "v": None}]


@pytest.mark.parametrize(
    ("value", "text"),
    [(12.345, "12.3"), (0.01234, "0.0123"), (1234.5, "1234"), (4e-14, "0"), (1.5e7, "1.5e+07"), (None, "-")],
)
def test_significant_digits(value, text):
    assert significant(3)(value) == text


def test_numbers_too_large_for_a_column_are_written_in_powers_of_ten():
    assert (number(2)(13.518), number(2)(2.5e9)) == ("13.52", "2.50e+09")


def test_a_board_is_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        build_board(results({"m": [[1, 2]]}), "toy").dataset = "x"  # pyright: ignore[reportAttributeAccessIssue]
