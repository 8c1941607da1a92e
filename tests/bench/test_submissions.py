"""Results of several people: merged, refused with a message, recomputed; files in, files and exit codes out."""

from __future__ import annotations

import json
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from toy_ship import write_toy_folder
from typer.testing import CliRunner

from shipbench.bench.results import read_results, read_truth
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.cli import app

MODEL = """
import numpy as np
class Still:
    num_parameters = 7
    def fit(self, train, valid=None, *, seed=0): return self
    def predict(self, s0, U, history=None): return np.repeat(s0[:, None], U.shape[1], axis=1)
"""


@pytest.fixture
def cli(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return lambda *arguments: CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture(scope="module")
def template(tmp_path_factory):
    """Studies of two people on the same data, made once: runs/anna holds `hold`, runs/ben a model of his own."""
    folder = tmp_path_factory.mktemp("two")
    write_toy_folder(folder / "toyset", 8)
    (folder / "mine.py").write_text(MODEL)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for name, model in (("anna", "hold"), ("ben", "mine.py:Still")):
            run_tasks([make_task({"dataset": "./toyset", "models": [model], "horizon_s": 20, "folds": 2})], Path("runs", name))
    return folder


@pytest.fixture
def two(cli, template, tmp_path):
    """A copy of the two studies to spoil, in the folder that the command runs in."""
    shutil.copytree(template, tmp_path, dirs_exist_ok=True)
    return tmp_path / "runs"


def edit_summary(folder: Path, change) -> None:
    found = json.loads((folder / "summary.json").read_text())
    for summary in found:
        change(summary)
    (folder / "summary.json").write_text(json.dumps(found))


def edit_rows(folder: Path, change) -> None:
    change(pd.read_parquet(folder / "rows.parquet")).to_parquet(folder / "rows.parquet", index=False)


def test_rows_tell_which_runs_belong_together(two):
    rows = read_results([two / "anna"]).rows
    assert (rows["group"] == rows["parent"]).all()  # windows of one run; this data set names no groups
    assert rows["group"].nunique() == 8


def test_folders_of_several_people_become_one_table(cli, two):
    result = cli("leaderboard", two / "anna", two / "ben", "--no-plots", "--json")
    assert result.exit_code == 0, result.output
    board = json.loads(result.stdout)["toyset"]
    assert sorted(board["ranking"]) == ["hold", "mine.py:Still"]
    ranking = next(t for t in board["tables"] if t["title"].startswith("Ranking"))
    assert next(r for r in ranking["rows"] if r["model"] == "hold")["skill"] == 0.0
    cost = {r["model"]: r["parameters"] for r in board["tables"][-1]["rows"]}
    assert cost == {"hold": 0.0, "mine.py:Still": 7.0}


def test_a_submission_is_one_folder_of_three_files_that_renders_the_same_page(cli, two, tmp_path):
    first = cli("leaderboard", two / "anna", two / "ben", "--no-plots", "-q", "--submission", "mine")
    assert first.exit_code == 0, first.output
    assert sorted(p.name for p in (tmp_path / "mine").iterdir()) == ["rows.parquet", "summary.json", "windows.parquet"]
    page = (tmp_path / "leaderboards/toyset.md").read_text()
    assert "## Regime slices" in page
    assert cli("leaderboard", "mine", "--no-plots", "-q").exit_code == 0
    again = (tmp_path / "leaderboards/toyset.md").read_text()
    assert [x for x in again.splitlines() if "Rendered by" not in x] == [x for x in page.splitlines() if "Rendered by" not in x]


def test_every_format_is_written_and_holds_the_same_figure(cli, two, tmp_path):
    result = cli("leaderboard", two / "anna", two / "ben", "--format", "md,latex,csv,html", "--out", "pages", "-q")
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in (tmp_path / "pages").iterdir() if p.is_file()) == ["toyset.csv", "toyset.html", "toyset.md", "toyset.tex"]
    table = pd.read_csv(tmp_path / "pages/toyset.csv")
    figure = table[table["figure"].eq("ED [m]") & table["row"].eq("hold")].iloc[0]
    assert figure["low"] < figure["value"] < figure["high"]
    shown = f"{figure['value']:.2f}"
    assert f"| hold | {shown}<br>" in (tmp_path / "pages/toyset.md").read_text()
    assert rf"hold & \shortstack[r]{{{shown}\\" in (tmp_path / "pages/toyset.tex").read_text()
    html = (tmp_path / "pages/toyset.html").read_text()
    assert "<td>hold</td><td" in html.replace("\n", "")
    assert html.count("data:image/png;base64,") == 3
    assert "http" not in html.split("</style>")[1].split("data:image")[0]  # nothing is fetched


class Tags(HTMLParser):
    """Open tags that never close, and tags by name."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag not in ("meta", "br", "img"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_a_models_name_cannot_break_the_page_or_the_tables(cli, two, tmp_path):
    name = "<script>alert(1)</script>&_%$#|{}"
    edit_rows(two / "ben", lambda rows: rows.assign(model=name))
    edit_summary(two / "ben", lambda s: s.update(model=name))
    assert cli("leaderboard", two / "ben", "--no-plots", "-q", "--format", "html,latex", "--out", "pages").exit_code == 0
    tags = Tags()
    tags.feed((tmp_path / "pages/toyset.html").read_text())
    assert tags.open == []
    assert "script" not in tags.seen
    assert r"$<$script$>$alert(1)$<$/script$>$\&\_\%\$\#$|$\{\}" in (tmp_path / "pages/toyset.tex").read_text()


def test_verify_passes_what_the_predictions_give_and_names_the_row_that_differs(cli, two):
    good = cli("leaderboard", two / "anna", two / "ben", "--verify", "--no-plots")
    assert good.exit_code == 0, good.output
    assert "Verified: 32 rows are what the saved predictions give." in good.stdout
    edit_rows(two / "ben", lambda rows: rows.assign(edh=np.where(rows["run"] == rows["run"].iloc[3], 0.5 * rows["edh"], rows["edh"])))
    run = read_results([two / "ben"]).rows["run"].iloc[3]
    bad = cli("leaderboard", two / "anna", two / "ben", "--verify", "--no-plots", "--out", "none")
    assert bad.exit_code == 1
    assert f"toyset mine.py:Still fold 0 seed 0, run {run}: edh is" in bad.stderr
    assert bad.stderr.startswith("1 scores are not")
    assert not Path("none").exists()


def test_verify_notices_a_truth_that_is_not_the_data_sets(cli, two):
    path = two / "ben/truth/toyset/fold1.npz"
    batch = read_truth(two / "ben", "toyset", 1)
    np.savez_compressed(path, ids=np.array(batch.ids), s0=batch.s0, U=batch.U, truth=batch.truth + 1e-3)
    result = cli("leaderboard", two / "ben", "--verify", "--no-plots")
    assert result.exit_code == 1
    assert "toyset fold 1: the saved truth is not that of the data set." in result.stderr


def test_verify_says_where_the_data_set_is_not_at_hand(cli, two, tmp_path):
    shutil.rmtree(tmp_path / "toyset")
    result = cli("leaderboard", two / "ben", "--verify", "--no-plots", "-q")
    assert result.exit_code == 0
    assert "note: the truth of 'toyset' was not compared with the data set, which is not at hand" in result.stderr


def test_verify_counts_a_diverged_run_that_is_called_ok(cli, two):
    path = two / "ben/cells"
    [file] = path.glob("toyset/*/fold0-seed0/predictions.npz")
    S = np.load(file)["S"]
    S[2, 5:, 0] = np.nan
    np.savez_compressed(file, S=S)
    result = cli("leaderboard", two / "ben", "--verify", "--no-plots")
    assert result.exit_code == 1
    assert "status is 'ok' in the rows, 'diverged' from the predictions" in result.stderr


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: edit_summary(f, lambda s: s.update(protocol=2)), "is of protocol 2, this version ranks protocol 1. Run the models again"),
        (lambda f: edit_summary(f, lambda s: s["task"].update(metric="x")), "this version does not know the task"),
        (lambda f: edit_summary(f, lambda s: s["task"].update(horizon_s=10.0)), "unknown task '"),
        (lambda f: edit_summary(f, lambda s: s.update(task_key="abc")), "unknown task 'abc'; the task that is written beside it has the key"),
        (lambda f: edit_summary(f, lambda s: s.pop("runs")), "an entry of summary.json lacks runs"),
        (lambda f: edit_summary(f, lambda s: s.update(seed=4)), "rows of toyset mine.py:Still fold 0 seed 0 have no entry in summary.json"),
        (lambda f: edit_rows(f, lambda r: pd.concat([r, r.iloc[:1]])), "stands twice"),
        (lambda f: edit_rows(f, lambda r: r.iloc[1:]), "the runs of the rows are not the scored runs of summary.json (7 and 8)"),
        (lambda f: edit_rows(f, lambda r: r.iloc[:8]), "fold 1 seed 0 has an entry in summary.json and no rows"),
        (lambda f: edit_rows(f, lambda r: r.drop(columns=["cvdm", "parent"])), "rows.parquet lacks the columns parent, cvdm"),
        (lambda f: edit_rows(f, lambda r: r.assign(fingerprint="other")), "fingerprint is other in the rows and"),
        (lambda f: edit_rows(f, lambda r: r.assign(status="fine")), "unknown status 'fine'; accepted: ok, diverged, failed, skipped"),
        (lambda f: edit_rows(f, lambda r: r.assign(ed=np.nan)), "status 'ok' with ED = nan"),
        (lambda f: edit_rows(f, lambda r: r.assign(status="failed")), "status 'failed' with ED = "),
        (lambda f: (f / "rows.parquet").write_bytes(b"PAR1"), "holds no results"),
        (lambda f: (f / "windows.parquet").write_bytes(b"PAR1"), "windows.parquet cannot be read"),
    ],
)
def test_a_folder_that_contradicts_itself_is_refused_with_its_name(cli, two, spoil, message):
    spoil(two / "ben")
    result = cli("leaderboard", two / "anna", two / "ben", "--no-plots", "--out", "none")
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert f"{two / 'ben'}" in result.stderr
    assert result.stderr.count("\n") == 1
    assert not Path("none").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["runs/anna", "runs/anna"], "'hold' on 'toyset', fold 0, seed 0 stands in runs/anna and in runs/anna; leave one of them out."),
        (["runs/anna", "--format", "pdf"], "unknown format 'pdf'"),
        (["runs/anna", "--format", ","], "no format is given; accepted: md, latex, csv, html"),
        (["runs/anna", "--baseline", "physics"], "--baseline: data set 'toyset' has no rows of it"),
        (["runs/anna", "--submission", "mine.py/x"], "cannot write to mine.py/x"),
    ],
)
def test_what_cannot_be_done_is_one_message(cli, two, arguments, message):
    result = cli("leaderboard", *arguments, "--no-plots", "--out", "none")
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert "Traceback" not in result.output


def test_verify_without_predictions_says_what_it_needs(cli, two):
    shutil.rmtree(two / "ben/cells")
    result = cli("leaderboard", two / "ben", "--verify", "--no-plots")
    assert result.exit_code == 2
    assert "no saved predictions of toyset mine.py:Still fold 0 seed 0; --verify needs the whole folder" in result.stderr
