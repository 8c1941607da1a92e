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


def readme_table(results_folder: Path, dataset: str) -> list[str]:
    """Lines of the README's short table of a data set."""
    board = build_board(read_results([results_folder]), dataset)
    rows = {row["model"]: row for row in board.tables[0].rows if not row.get("_reference")}
    rest = {row["model"]: row for row in board.tables[1 + (dataset == "harbour90")].rows}
    lines = []
    for model in board.ranking:
        row, more = rows[model], rest[model]
        figures = (row["ed_mean"], row["ed_std"], row["edh_mean"], row["cvdm_mean"], more["position_rmse"])
        lines.append(f"| `{model}` | " + " | ".join(f"{x:.2f}" for x in figures) + " |")
    return lines


@pytest.mark.parametrize(("study", "dataset"), [("paper", "harbour90"), ("paper", "harbour90_noisy"), ("esso_osaka", "esso_osaka")])
def test_the_readmes_tables_are_the_committed_rows(study, dataset):
    readme = (FOLDER.parent / "README.md").read_text()
    assert "\n".join(readme_table(FOLDER / "results" / study, dataset)) in readme
