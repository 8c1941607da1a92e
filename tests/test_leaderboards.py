"""The committed leaderboards: every table is what the committed rows render to."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from shipbench.bench.folds import make_folds, select_runs
from shipbench.bench.regimes import window_features
from shipbench.bench.results import PROTOCOL, STATUSES
from shipbench.bench.submissions import Results, read_results
from shipbench.bench.task import load_tasks
from shipbench.data.base import load_dataset
from shipbench.leaderboard.overall import over_data_sets
from shipbench.leaderboard.pages import build_board, scores_of

FOLDER = Path(__file__).parent.parent / "leaderboards"
STUDIES = sorted(p.parent for p in FOLDER.glob("results/*/rows.parquet"))


FINGERPRINTS = {
    "harbour90": "e102babe79cc29d8", "harbour90_noisy": "10a8bd89a404cf35", "esso_osaka": "97bfd8cf5c3a1622",
    "esso_osaka_no_wind": "f82dbf16459d1fd4",
}  # fmt: skip
KNOWN = {
    task.dataset: task
    for path in (FOLDER.parent / "configs").glob("*.toml")
    for task in load_tasks(path)
    if path.stem not in ("smoke", "extrapolate")
}
"""The tasks of the shipped configs, by data set: what a committed submission may be of."""
ALLOWED = {"rows.parquet", "summary.json", "windows.parquet"}
MOST_BYTES = 2_000_000


def test_there_are_results():
    assert {p.name for p in STUDIES} >= {"paper", "esso_osaka"}


def test_every_folder_of_results_is_a_submission():
    assert sorted(p for p in (FOLDER / "results").iterdir()) == STUDIES


@pytest.mark.parametrize("study", STUDIES, ids=lambda p: p.name)
def test_a_submission_holds_rows_summary_and_windows_and_nothing_else(study):
    names = {p.name for p in study.iterdir()}
    assert {"rows.parquet", "summary.json"} <= names <= ALLOWED
    assert sum(p.stat().st_size for p in study.iterdir()) < MOST_BYTES


@pytest.fixture(scope="module", params=STUDIES, ids=lambda p: p.name)
def results(request):
    return read_results([request.param])


def test_rows_are_complete_and_not_repeated(results):
    rows = results.rows  # schema, protocol, statuses and duplicates are checked by read_results
    assert not rows.duplicated(["dataset", "model", "fold", "seed", "run"]).any()
    assert set(rows["status"]) <= set(STATUSES)
    assert rows.loc[rows["status"] == "ok", "ed"].notna().all()
    for _, part in rows.groupby("dataset"):
        assert part.groupby(["model", "seed"])["run"].nunique().nunique() == 1, "every model has a row for every run"


def test_the_task_is_that_of_a_shipped_config_on_one_known_data_set(results):
    for summary in results.summaries:
        task = KNOWN[summary["task"]["dataset"]]
        assert summary["task_key"] == task.key(FINGERPRINTS[summary["dataset"]])
        assert summary["fingerprint"] == FINGERPRINTS[summary["dataset"]]
        assert summary["protocol"] == PROTOCOL


def test_no_submission_repeats_or_contradicts_another():
    together = read_results(STUDIES)
    assert len(together.rows) == sum(len(read_results([study]).rows) for study in STUDIES)


def test_extrapolation_is_scored_by_its_config_and_rendered_from_its_rows():
    results = read_results([FOLDER / "extrapolate/results"])
    tasks = {task.dataset: task for task in load_tasks(FOLDER.parent / "configs/extrapolate.toml")}
    for summary in results.summaries:
        assert summary["task_key"] == tasks[summary["dataset"]].key(FINGERPRINTS[summary["dataset"]])
    for dataset in tasks:
        text = (FOLDER / f"extrapolate/{dataset}.md").read_text()
        assert "shipbench run --config configs/extrapolate.toml" in text
        for row in build_board(results, dataset).tables[0].rows:
            if not row.get("_reference"):
                assert f"| {row['model']} | " in text
                assert f"{row['ed_mean']:.2f}" in text
        assert "\n".join(short_table(dataset, results)) in (FOLDER / "README.md").read_text()


@cache
def results_on(dataset: str) -> Results:
    """Rows of all committed studies of a data set, of which its page is rendered."""
    there = [study for study in STUDIES if dataset in read_results([study]).rows["dataset"].unique()]
    return read_results(there)


@pytest.mark.parametrize("dataset", FINGERPRINTS)
def test_every_figure_of_the_page_comes_from_the_rows(dataset):
    page = (FOLDER / f"{dataset}.md").read_text()
    tables = build_board(results_on(dataset), dataset).tables
    for table in tables:
        assert table.markdown().strip() in page
    assert page.count("\n## ") == len(tables), "nothing stands on the page that is not rendered"


def test_the_page_over_data_sets_is_that_of_the_paper():
    overall = over_data_sets([scores_of(results_on(name), name) for name in ("harbour90", "harbour90_noisy")])
    assert overall.board.tables[0].markdown().strip() in (FOLDER / "over-data-sets.md").read_text()


@pytest.mark.parametrize("dataset", ["harbour90", "harbour90_noisy"])
def test_the_windows_are_those_of_the_data_set(dataset):
    """What stands in `windows.parquet` is computed again from the data set itself."""
    task = KNOWN[dataset]
    data, _ = select_runs(load_dataset(dataset), task)
    assert data.fingerprint == FINGERPRINTS[dataset]
    windows = read_results([FOLDER / "results/paper"]).windows
    for fold in make_folds(data, task):
        batch = fold.test.batch()
        there = (
            windows[(windows["dataset"] == dataset) & (windows["fold"] == fold.index)]
            .set_index("run")
            .loc[list(batch.ids)]
        )
        for name, values in window_features(batch, data.ship.L).items():
            np.testing.assert_allclose(there[name], values, rtol=1e-9, err_msg=name)


def test_pages_name_the_command_that_made_them(results):
    for dataset in results.rows["dataset"].unique():
        assert "shipbench run --config configs/" in (FOLDER / f"{dataset}.md").read_text()


def short_table(dataset: str, results: Results | None = None) -> list[str]:
    """Lines of the short table of a data set in leaderboards/README.md, from `results` or the committed studies."""
    board = build_board(results or results_on(dataset), dataset)
    rows = {row["model"]: row for row in board.tables[0].rows if not row.get("_reference")}
    rest = {row["model"]: row for row in next(t for t in board.tables if t.title == "Error against horizon").rows}
    lines = []
    for model in board.ranking:
        row, more = rows[model], rest[model]
        figures = (row["ed_mean"], row["ed_std"], row["edh_mean"], row["cvdm_mean"], more["position_rmse"])
        lines.append(f"| `{model}` | " + " | ".join(f"{x:.2f}" for x in figures) + " |")
    return lines


@pytest.mark.parametrize("dataset", ["harbour90", "harbour90_noisy", "esso_osaka"])
def test_the_short_tables_are_the_committed_rows(dataset):
    assert "\n".join(short_table(dataset)) in (FOLDER / "README.md").read_text()


@pytest.mark.parametrize(("column", "dataset"), [(2, "harbour90_noisy"), (3, "esso_osaka")])
def test_the_readmes_figures_are_the_committed_rows(column, dataset):
    lines = [
        line.split("|") for line in (FOLDER.parent / "README.md").read_text().splitlines() if line.startswith("| `")
    ]
    said = {re.match(r" `([^`]+)`", cells[1])[1]: cells[column].strip() for cells in lines}
    board = build_board(results_on(dataset), dataset)
    ranking = {row["model"]: row for row in next(t for t in board.tables if t.title.startswith("Ranking")).rows}
    for model, figure in said.items():
        if figure:
            row = ranking[model]
            assert figure == f"{row['ed_mean']:.2f} ({row['ed_mean_low']:.2f} to {row['ed_mean_high']:.2f})", model


def test_the_figures_of_the_diagnosis_in_readme_and_docs_are_those_of_its_table():
    table = r"^\| ([^|]+) \| ([\d.]+) \| (?:[\d.]+|-) \| (?:[\d.]+|-) \| (\d+) \|"
    found = re.findall(table, (FOLDER / "diagnosis.md").read_text(), re.MULTILINE)
    figure = {name: (float(share), int(n)) for name, share, n in found}

    def count(*names: str) -> str:
        """Of how many sets, such as `23 of 39`."""
        return f"{sum(round(share * n) for share, n in map(figure.get, names))} of {sum(figure[n][1] for n in names)}"

    trust = (FOLDER.parent / "docs/trust.md").read_text()
    rows = [line.split("|")[2].strip() for line in trust.splitlines() if line.startswith("| ")][1:11]
    assert rows == [
        count("first-named cause right, 1x"), count("oracle test detects it, 1x"),
        count("first-named cause right, 0.3x"), count("oracle test detects it, 0.3x"), count("two effects, exact pair"),
        count("false alarms, same structure", "false alarms, other structure"),
        count("nothing hidden, a wrong name, ships of the literature"), count("outside: unknown and right variable"),
        f"{figure['size: median relative error'][0]:.0%}".replace("%", " %"),
        f"{figure['size: coverage of the 95 % intervals'][0]:.0%}".replace("%", " %"),
    ]  # fmt: skip
    readme = " ".join((FOLDER.parent / "README.md").read_text().split())
    named, of = count("first-named cause right, 1x").split(" of ")
    assert f"On {of} hidden causes of typical size it names {named} first" in readme
    assert f"a test that knows the cause would see {count('oracle test detects it, 1x').split(' of ')[0]}." in readme
