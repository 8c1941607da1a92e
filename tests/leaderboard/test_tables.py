"""Tables of scores: Table III, kinds of manoeuvre, status, units."""

from __future__ import annotations

import numpy as np
import pytest
from made_results import first_table, results

from shipbench.leaderboard.pages import build_board
from shipbench.leaderboard.tables import PAPER


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


def test_the_papers_figures_stand_beside_its_own_task_only():
    found = results({"physics": [[6, 12]], "mlp": [[20, 30]]}, "harbour90")
    for summary in found.summaries:
        summary["task"] = summary["task"] | {"split": "speed"}
    board = build_board(found, "harbour90")
    assert "paper: physics" not in first_table(board)
    assert "trained on the slower runs, scored on the fastest" in board.head[0]


def test_kinds_of_manoeuvre_get_a_table():
    board = build_board(results({"m": [[1, 2, 3, 4]]}, kinds=("turn", "zigzag")), "toy")
    table = next(t for t in board.tables if "kind" in t.title)
    assert (table.rows[0]["turn"], table.rows[0]["zigzag"]) == (2.0, 3.0)
