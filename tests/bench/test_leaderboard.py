"""The leaderboard: statistics by hand, order, refusals, and pages rendered from rows."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipbench.bench.board_tables import PAPER
from shipbench.bench.leaderboard import build_board, write_boards
from shipbench.bench.results import PROTOCOL, Results
from shipbench.bench.tables import Table, TableColumn, number, significant
from shipbench.errors import InputError

COLUMNS = [
    {"name": "ed", "label": "ED", "unit": "m"},
    {"name": "edh", "label": "EDH", "unit": "m"},
    {"name": "cvdm", "label": "cVDM", "unit": "%"},
    {"name": "heading_error", "label": "heading error", "unit": "rad"},
    {"name": "rmse_F_b", "label": "RMSE F_b", "unit": "N"},
    {"name": "ed_at_10s", "label": "ED at 10 s", "unit": "m"},
]


def results(models, dataset="toy", *, fingerprint="f1", protocol=PROTOCOL, task="t1", kinds=("",)):
    """Rows from `models`: name -> list over folds of the runs' ED; None is a diverged run. The other columns are multiples of ED."""
    rows, summaries = [], []
    for model, folds in models.items():
        for fold, errors in enumerate(folds):
            for i, error in enumerate(errors):
                value = np.nan if error is None else float(error)
                rows.append(
                    {
                        "protocol": protocol, "dataset": dataset, "fingerprint": fingerprint, "task": task, "model": model, "fold": fold,
                        "seed": 0, "run": f"r{fold}{i}", "parent": f"r{fold}{i}", "kind": kinds[i % len(kinds)],
                        "status": "diverged" if error is None else "ok", "reason": "u is nan at t = 3 s" if error is None else "",
                        "ed": value, "edh": 2 * value, "cvdm": 3 * value, "heading_error": value / 100, "rmse_F_b": 1000 * value,
                        "ed_at_10s": value / 2, "fit_s": 1.5, "fit_shared_by": 1, "predict_s": 0.002,
                    }
                )  # fmt: skip
            summaries.append(
                {
                    "dataset": dataset, "fingerprint": fingerprint, "protocol": protocol, "task_key": task, "model": model, "fold": fold,
                    "seed": 0, "columns": COLUMNS, "task": {"split": "folds", "horizon_s": 20, "history_s": 0}, "ship": "toy", "ship_L": 50.0,
                    "dt": 1.0, "source": "", "licence": "", "notes": ["depth unknown"], "command": "shipbench run -m x",
                    "finished": "2026-01-02T03:04:05", "code": {"shipbench": "0", "source": "abc", "git": ""},
                    "machine": {"cpus": 2, "python": "3", "torch": "2"},
                }
            )  # fmt: skip
    return Results(pd.DataFrame(rows), summaries, [Path()] * len(summaries))


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
    board = build_board(results({"bad": [[9, 9]], "good": [[1, 3]], "dead": [[None, None]], "lucky": [[0.1, None]]}), "toy")
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
    assert any(note.startswith("In 1 rows the true ship does not move") for note in build_board(found, "toy").tables[0].notes)


def test_angles_and_forces_are_shown_in_the_units_that_people_read():
    text = build_board(results({"m": [[1, 3]]}), "toy").markdown("cmd")
    assert "heading error [deg] |" in text
    assert f"{np.rad2deg(0.02):.2f}" in text
    assert "RMSE F_b [kN]" in text


def test_harbour90_stands_beside_the_papers_table():
    board = build_board(results({"physics": [[6, 12]], "mlp": [[20, 30]]}, "harbour90"), "harbour90")
    rows = first_table(board)
    assert [rows["paper: physics"][f"ed_{s}"] for s in ("mean", "median", "std", "iqr")] == list(PAPER["paper: physics"]["ed"])
    claim = {row["where"]: row for row in board.tables[1].rows}
    assert claim["here"]["ed_mean"] == pytest.approx(100 * (1 - 9 / 25))
    assert claim["paper"]["ed_mean"] == pytest.approx(100 * (1 - 13.52 / 20.84))
    assert "paper: physics" not in first_table(build_board(results({"physics": [[6]]}), "toy"))


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
    table = Table("T", [TableColumn("m", "m"), TableColumn("v", "v", number(1))], [{"m": "a|b", "v": float("nan")}])
    assert "| a\\|b | - |" in table.markdown()
    assert table.as_json()["rows"] == [{"m": "a|b", "v": None}]


@pytest.mark.parametrize(("value", "text"), [(12.345, "12.3"), (0.01234, "0.0123"), (1234.5, "1234"), (4e-14, "0"), (1.5e7, "1.5e+07"), (None, "-")])
def test_significant_digits(value, text):
    assert significant(3)(value) == text


def test_numbers_too_large_for_a_column_are_written_in_powers_of_ten():
    assert (number(2)(13.518), number(2)(2.5e9)) == ("13.52", "2.50e+09")


def test_a_board_is_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        build_board(results({"m": [[1, 2]]}), "toy").dataset = "x"  # pyright: ignore[reportAttributeAccessIssue]
