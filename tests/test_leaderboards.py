"""The committed leaderboards: every table is what the committed rows render to."""

from __future__ import annotations

from pathlib import Path

import pytest

from shipbench.bench.leaderboard import build_board
from shipbench.bench.results import STATUSES, read_results

FOLDER = Path(__file__).parent.parent / "leaderboards"
STUDIES = sorted(p.parent for p in FOLDER.glob("results/*/rows.parquet"))


def test_there_are_results():
    assert {p.name for p in STUDIES} >= {"paper", "esso_osaka"}


@pytest.fixture(scope="module", params=STUDIES, ids=lambda p: p.name)
def results(request):
    return read_results([request.param])


def test_rows_are_complete_and_not_repeated(results):
    rows = results.rows
    assert not rows.duplicated(["dataset", "model", "fold", "seed", "run"]).any()
    assert set(rows["status"]) <= set(STATUSES)
    assert rows.loc[rows["status"] == "ok", "ed"].notna().all()
    for _, part in rows.groupby("dataset"):
        assert part.groupby(["model", "seed"])["run"].nunique().nunique() == 1, "every model has a row for every run"


def test_every_figure_of_the_page_comes_from_the_rows(results):
    for dataset in results.rows["dataset"].unique():
        page = (FOLDER / f"{dataset}.md").read_text()
        for table in build_board(results, dataset).tables:
            assert table.markdown().strip() in page


def test_pages_name_the_command_that_made_them(results):
    for dataset in results.rows["dataset"].unique():
        assert "shipbench run --config configs/" in (FOLDER / f"{dataset}.md").read_text()
