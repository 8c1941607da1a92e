"""Tables on the certainty of a leaderboard: skill, win rate, pairs, slices, manoeuvres."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest
from made_results import by_title, many, results, windows_of, with_columns

from shipbench.bench.submissions import Results
from shipbench.leaderboard.pages import build_board
from shipbench.leaderboard.statistics import Matched


def with_seeds(found, seeds):
    """The same rows under more seeds, each with its own factor on every error."""
    parts = [found.rows.assign(seed=seed, ed=found.rows["ed"] * factor) for seed, factor in seeds.items()]
    return Results(pd.concat(parts, ignore_index=True), found.summaries, found.sources)


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
