"""Several data sets: ranks by hand, a diagram only where there are enough of them."""

from __future__ import annotations

import sys

import numpy as np
import pandas as pd
import pytest
from made_results import many, results

from shipbench.bench.submissions import Results
from shipbench.leaderboard.overall import NAME, data_sets_needed, over_data_sets
from shipbench.leaderboard.pages import scores_of, write_boards


def merged(sets):
    return Results(
        pd.concat([s.rows for s in sets], ignore_index=True),
        [x for s in sets for x in s.summaries],
        [p for s in sets for p in s.sources],
    )


def several(count, **offsets):
    """`count` data sets with runs of their own; each model has its own offset of ED."""
    found = []
    for i in range(count):
        models = {m: many(10 * i + j, runs=12, offset=x) for j, (m, x) in enumerate(offsets.items())}
        found.append(results(models, f"set{i:02d}", fingerprint=f"f{i}"))
    return merged(found)


def scores(found):
    return [scores_of(found, name) for name in dict.fromkeys(s["dataset"] for s in found.summaries)]


@pytest.mark.parametrize(("models", "needed"), [(2, 6), (3, 7), (6, 10), (10, 11)])
def test_the_number_of_data_sets_needed_is_where_the_smallest_p_passes(models, needed):
    pairs = models * (models - 1) // 2
    assert data_sets_needed(models) == needed
    assert 2 / 2**needed <= 0.05 / pairs < 2 / 2 ** (needed - 1)


def test_ranks_win_rates_and_skill_are_means_over_data_sets():
    found = merged(
        [
            results({"hold": [[4, 4]], "a": [[1, 1]], "b": [[2, 2]]}, "x"),
            results({"hold": [[9, 9]], "a": [[3, 3]], "b": [[1, 1]]}, "y"),
        ]
    )
    table = over_data_sets(scores(found)).board.tables[0]
    rows = {row["model"]: row for row in table.rows}
    assert [rows[m]["rank"] for m in ("a", "b", "hold")] == [1.5, 1.5, 3.0]
    assert [rows[m]["wins"] for m in ("a", "b", "hold")] == [75.0, 75.0, 0.0]
    assert rows["a"]["skill"] == pytest.approx(100 * (1 - np.sqrt(1 / 4 * 3 / 9)))


def test_too_few_data_sets_get_no_diagram_and_the_page_says_how_many_are_needed(tmp_path):
    found = several(3, a=0.0, b=0.5, hold=3.0)
    assert not over_data_sets(scores(found)).can_draw
    write_boards(found, tmp_path, "cmd", plots=False)
    text = (tmp_path / f"{NAME}.md").read_text()
    assert "No critical-difference diagram: 3 models need at least 7 data sets" in text
    assert "there are 3." in text
    assert not (tmp_path / NAME).exists()


def test_enough_data_sets_get_a_diagram(tmp_path):
    overall = over_data_sets(scores(several(8, a=0.0, b=0.5, hold=6.0)))
    assert overall.can_draw
    assert overall.draw(tmp_path).read_bytes()[:4] == b"\x89PNG"
    assert "Critical-difference diagram: Wilcoxon" in overall.board.tables[0].notes[-1]
    p = overall.p_values()
    assert p.loc["a", "hold"] == pytest.approx(3 * 2 / 2**8)  # hold is last on all of them; Holm over three pairs


def test_a_missing_library_is_a_reason_and_no_failure(monkeypatch):
    monkeypatch.setitem(sys.modules, "scikit_posthocs", None)
    overall = over_data_sets(scores(several(8, a=0.0, b=0.5, hold=6.0)))
    assert not overall.can_draw
    assert "needs scikit-posthocs, which is not installed" in overall.board.tables[0].notes[-1]


def test_models_that_lack_a_data_set_are_named_and_left_out():
    found = merged(
        [results({"a": many(0), "b": many(1), "c": many(2)}, "x"), results({"a": many(3), "b": many(4)}, "y")]
    )
    overall = over_data_sets(scores(found))
    assert sorted(overall.models) == ["a", "b"]
    assert any("`c`" in line for line in overall.board.head)


def test_one_data_set_or_one_common_model_has_no_such_page():
    assert over_data_sets(scores(results({"a": many(0), "b": many(1)}))) is None
    assert over_data_sets(scores(merged([results({"a": many(0)}, "x"), results({"b": many(1)}, "y")]))) is None
