"""Results of several people: merged, refused with a message, recomputed; files in, files and exit codes out."""

from __future__ import annotations

import json
import os
import re
import shutil
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow.parquet as pq
import pytest
from toy_ship import write_toy_folder
from typer.testing import CliRunner

from shipbench.bench.results import read_truth
from shipbench.bench.runner import run_tasks
from shipbench.bench.submissions import read_results
from shipbench.bench.task import make_task
from shipbench.cli.app import app
from shipbench.leaderboard.strips import strips
from shipbench.render.table import Table, TableColumn, number

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
            run_tasks(
                [make_task({"dataset": "./toyset", "models": [model], "horizon_s": 20, "folds": 2})], Path("runs", name)
            )
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


def edit_windows(folder: Path, change) -> None:
    change(pd.read_parquet(folder / "windows.parquet")).to_parquet(folder / "windows.parquet", index=False)


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
    assert [x for x in again.splitlines() if "Rendered by" not in x] == [
        x for x in page.splitlines() if "Rendered by" not in x
    ]


@pytest.mark.long
def test_every_format_is_written_and_holds_the_same_figure(cli, two, tmp_path):
    result = cli("leaderboard", two / "anna", two / "ben", "--format", "md,latex,csv,html", "--out", "pages", "-q")
    assert result.exit_code == 0, result.output
    assert sorted(p.name for p in (tmp_path / "pages").iterdir() if p.is_file()) == [
        "toyset.csv",
        "toyset.html",
        "toyset.md",
        "toyset.tex",
    ]
    table = pd.read_csv(tmp_path / "pages/toyset.csv")
    figure = table[table["figure"].eq("ED [m]") & table["row"].eq("hold")].iloc[0]
    assert figure["low"] < figure["value"] < figure["high"]
    shown = f"{figure['value']:.2f}"
    assert f"| hold | {shown}<br>" in (tmp_path / "pages/toyset.md").read_text()
    assert rf"hold & \shortstack[r]{{{shown}\\" in (tmp_path / "pages/toyset.tex").read_text()
    html = (tmp_path / "pages/toyset.html").read_text()
    assert re.search(
        rf'<th scope="row" class="model" data-by="hold">hold</th>\s*<td[^>]*>16/16</td>\s*<td[^>]*>{shown}<br><small>',
        html,
    )
    tags = Tags()
    tags.feed(html)
    assert tags.open == []
    assert not {"img", "link", "iframe"} & set(tags.seen)
    assert (
        len(json.loads(re.search(r'<script type="application/json">(.*?)</script>', html, re.DOTALL)[1])["runs"]) == 16
    )


class Tags(HTMLParser):
    """Open tags that never close, and tags by name."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag, attrs):
        self.seen.append(tag)
        if tag not in ("meta", "br", "img", "wbr", "path", "line", "circle", "rect", "input"):
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.seen.append(tag)

    def handle_endtag(self, tag):
        if tag == "path":
            return
        assert self.open.pop() == tag


def test_a_models_name_cannot_break_the_page_or_the_tables(cli, two, tmp_path):
    name = "<script>alert(1)</script>&_%$#|{}"
    edit_rows(two / "ben", lambda rows: rows.assign(model=name))
    edit_summary(two / "ben", lambda s: s.update(model=name))
    assert (
        cli("leaderboard", two / "ben", "--no-plots", "-q", "--format", "html,latex", "--out", "pages").exit_code == 0
    )
    tags = Tags()
    tags.feed((tmp_path / "pages/toyset.html").read_text())
    assert tags.open == []
    assert tags.seen.count("script") == 2  # sorts tables, copies lines; nothing of the name
    html = (tmp_path / "pages/toyset.html").read_text()
    assert "&lt;script&gt;alert(1)&lt;/script&gt;&amp;_%$#|{}" in html
    assert "<script>alert" not in html
    assert r"$<$script$>$alert(1)$<$/script$>$\&\_\%\$\#$|$\{\}" in (tmp_path / "pages/toyset.tex").read_text()


@pytest.mark.long
def test_the_page_says_first_who_is_first_and_shows_intervals(cli, two, tmp_path):
    assert cli("leaderboard", two / "anna", two / "ben", "--format", "html,md", "--out", "pages", "-q").exit_code == 0
    html = (tmp_path / "pages/toyset.html").read_text()
    lead = re.search(r'<p class="lead">(.*?)</p>', html)[1]
    assert re.match(r"&#39;.*&#39; is first: mean position error \(ED\) [\d.]+ m, ", lead)
    assert html.index(lead) < html.index('<dl class="tiles">') < html.index("<nav") < html.index("<table")
    tiles = dict(re.findall(r"<dt>(.*?)</dt><dd[^>]*>(.*?)<small>", html))
    assert {"First", "Second", "Windows", "Models", "Not scored"} <= set(tiles)
    assert (tiles["Windows"], tiles["Models"], tiles["Not scored"]) == ("16", "2", "0")
    assert {tiles["First"], tiles["Second"]} == {"hold", "mine.py:Still"}
    assert html.count('<circle class="dot c0"') == 3  # ED, EDH, cVDM
    assert "<code>shipbench leaderboard" in html


def test_strips_place_the_mean_in_its_interval_and_skip_what_has_no_score():
    columns = [TableColumn("model", "model"), TableColumn("ED", "ed_mean", number(2), interval=True)]
    rows = [
        {"model": "a", "ed_mean": 2.0, "ed_mean_low": 1.0, "ed_mean_high": 3.0, "_ed_middle": (1.5, 2.5)},
        {"model": "b", "ed_mean": float("nan")}, {"model": "paper", "ed_mean": 4.0, "_reference": True},
    ]  # fmt: skip
    [drawn] = strips(Table("t", columns, rows))
    [(model, text, svg)] = drawn["rows"]
    assert (model, text) == ("a", "2.00 (1.00 to 3.00)")
    low, high = (float(x) for x in re.search(r'class="interval c0" x1="([\d.]+)%" x2="([\d.]+)%"', svg).groups())
    assert low < float(re.search(r'cx="([\d.]+)%"', svg)[1]) < high < 100.0
    assert drawn["title"] == "Position error ED [m]"
    assert strips(Table("t", columns, [{"model": "a", "ed_mean": float("nan")}]))[0]["rows"] == []
    rows[0] |= {"ed_mean": 200.0, "ed_mean_low": 150.0, "ed_mean_high": 300.0}
    assert strips(Table("t", columns, [*rows, {"model": "c", "ed_mean": 1.0}]))[0]["title"].endswith("logarithmic")


def test_verify_passes_what_the_predictions_give_and_names_the_row_that_differs(cli, two):
    good = cli("leaderboard", two / "anna", two / "ben", "--verify", "--no-plots")
    assert good.exit_code == 0, good.output
    assert "Verified: 32 rows are what the saved predictions give." in good.stdout
    edit_rows(
        two / "ben",
        lambda rows: rows.assign(edh=np.where(rows["run"] == rows["run"].iloc[3], 0.5 * rows["edh"], rows["edh"])),
    )
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
        (
            lambda f: edit_summary(f, lambda s: s.update(protocol=2)),
            "is of protocol 2, this version ranks protocol 1. Run the models again",
        ),
        (lambda f: edit_summary(f, lambda s: s["task"].update(metric="x")), "this version does not know the task"),
        (lambda f: edit_summary(f, lambda s: s["task"].update(horizon_s=10.0)), "unknown task '"),
        (
            lambda f: edit_summary(f, lambda s: s.update(task_key="abc")),
            "unknown task 'abc'; the task that is written beside it has the key",
        ),
        (lambda f: edit_summary(f, lambda s: s.pop("runs")), "an entry of summary.json lacks runs"),
        (
            lambda f: edit_summary(f, lambda s: s.update(seed=4)),
            "rows of toyset mine.py:Still fold 0 seed 0 have no entry in summary.json",
        ),
        (lambda f: edit_rows(f, lambda r: pd.concat([r, r.iloc[:1]])), "stands twice"),
        (
            lambda f: edit_rows(f, lambda r: r.iloc[1:]),
            "the runs of the rows are not the scored runs of summary.json (7 and 8)",
        ),
        (lambda f: edit_rows(f, lambda r: r.iloc[:8]), "fold 1 seed 0 has an entry in summary.json and no rows"),
        (
            lambda f: edit_rows(f, lambda r: r.drop(columns=["cvdm", "parent"])),
            "rows.parquet lacks the columns parent, cvdm",
        ),
        (lambda f: edit_rows(f, lambda r: r.assign(fingerprint="other")), "fingerprint is other in the rows and"),
        (
            lambda f: edit_rows(f, lambda r: r.assign(status="fine")),
            "unknown status 'fine'; accepted: ok, diverged, failed, skipped",
        ),
        (lambda f: edit_rows(f, lambda r: r.assign(ed=np.nan)), "status 'ok' with ED = nan"),
        (lambda f: edit_rows(f, lambda r: r.assign(status="failed")), "status 'failed' with ED = "),
        (lambda f: edit_rows(f, lambda r: r.assign(ed=-1.0)), "status 'ok' with ED = -1.0"),
        (lambda f: edit_rows(f, lambda r: r.assign(ed=np.inf)), "status 'ok' with ED = inf"),
        (lambda f: edit_rows(f, lambda r: r.assign(ed=1e6)), "status 'ok' with ED = 1000000.0"),
        (lambda f: edit_rows(f, lambda r: r.assign(edh=np.nan)), "status 'ok' with edh = nan"),
        (lambda f: edit_rows(f, lambda r: r.assign(rmse_psi=-0.1)), "status 'ok' with rmse_psi = -0.1"),
        (lambda f: edit_rows(f, lambda r: r.assign(advance_error=-np.inf)), "status 'ok' with advance_error = -inf"),
        (lambda f: edit_rows(f, lambda r: r.assign(ed="x")), "column 'ed' is of type str; accepted: numbers"),
        (
            lambda f: edit_rows(f, lambda r: r.assign(fold=r["fold"].astype(str))),
            "column 'fold' is of type str; accepted: whole numbers",
        ),
        (
            lambda f: edit_rows(f, lambda r: r.assign(kind=None)),
            "column 'kind' is of type object; accepted: text in every row",
        ),
        (lambda f: edit_rows(f, lambda r: r.assign(kind="\x1b[2J")), "kind = '\\x1b[2J' holds control characters"),
        (lambda f: edit_rows(f, lambda r: r.assign(fit_s=-1.0)), "fit_s = -1.0; accepted: seconds, at least 0"),
        (lambda f: edit_rows(f, lambda r: r.assign(predict_s=1e-9)), "predict_s is 1e-09 in the rows and"),
        (lambda f: edit_summary(f, lambda s: s.update(fit_s=float("nan"))), "fit_s = nan; accepted: a finite number"),
        (lambda f: edit_summary(f, lambda s: s.update(ship_L=0)), "ship_L = 0; accepted: greater than 0"),
        (lambda f: edit_summary(f, lambda s: s.update(dt=0.0)), "dt = 0.0; accepted: greater than 0"),
        (lambda f: edit_summary(f, lambda s: s.update(dt=1e-300)), "dt = 1e-300 s for a horizon of 20 s"),
        (lambda f: edit_summary(f, lambda s: s.update(dt="1")), "dt = '1'; accepted: a valid number"),
        (lambda f: edit_summary(f, lambda s: s.update(notes="x")), "notes = 'x'; accepted: a valid list"),
        (lambda f: edit_summary(f, lambda s: s.pop("notes")), "an entry of summary.json lacks notes"),
        (lambda f: edit_summary(f, lambda s: s["code"].pop("git")), "an entry of summary.json lacks code.git"),
        (lambda f: edit_summary(f, lambda s: s.update(columns=[1, 2])), "columns.0 = 1; accepted: a valid dictionary"),
        (lambda f: edit_summary(f, lambda s: s["columns"].pop()), "columns are not those of task.metrics"),
        (
            lambda f: edit_summary(f, lambda s: s["columns"][0].update(label="EDH")),
            "columns are not those of task.metrics",
        ),
        (
            lambda f: edit_summary(f, lambda s: s["task"].update(metrics=["ed"])),
            "columns are not those of task.metrics: ed, ed_at_10s",
        ),
        (
            lambda f: edit_summary(f, lambda s: s["task"].update(horizon_s="20")),
            "this version does not know the task (task: horizon_s",
        ),
        (lambda f: edit_summary(f, lambda s: s["task"].pop("history_s")), "task lacks history_s"),
        (
            lambda f: edit_summary(f, lambda s: s.update(run_status=["ok"])),
            "1 statuses in run_status for 8 scored runs",
        ),
        (
            lambda f: edit_summary(f, lambda s: s.update(status="diverged")),
            "status is 'diverged' in summary.json; its rows make it 'ok'",
        ),
        (
            lambda f: edit_summary(f, lambda s: s.update(parameters=-5)),
            "parameters = -5; accepted: greater than or equal to 0",
        ),
        (lambda f: edit_summary(f, lambda s: s.update(dataset="../../x")), "dataset = '../../x' is no name"),
        (lambda f: edit_summary(f, lambda s: s.update(model="\x9b2J")), "model = '\\x9b2J' holds control characters"),
        (
            lambda f: edit_summary(f, lambda s: s.update(ship_B=2.0 + s["fold"])),
            "ship_B of 'toyset' is 2.0; another entry",
        ),
        (lambda f: (f / "summary.json").write_text("5"), "summary.json is no list of entries"),
        (lambda f: (f / "summary.json").write_text("[5]"), "summary.json: an entry = 5; accepted:"),
        (
            lambda f: (f / "summary.json").write_text("[" * 100_000),
            "summary.json is not valid JSON: it is nested too deeply",
        ),
        (lambda f: [(f / "summary.json").unlink(), os.mkfifo(f / "summary.json")], "summary.json: it is a named pipe"),
        (
            lambda f: edit_windows(f, lambda w: w.assign(speed="fast")),
            "windows.parquet column 'speed' is of type str; accepted: numbers",
        ),
        (
            lambda f: edit_windows(f, lambda w: w.assign(speed=np.nan)),
            "windows.parquet holds values that no window has",
        ),
        (lambda f: edit_windows(f, lambda w: w.drop(columns="drift")), "windows.parquet lacks the columns drift"),
        (
            lambda f: edit_windows(f, lambda w: pd.concat([w, w.iloc[:1].assign(run="r99")])),
            "windows.parquet holds a window that was not scored: run r99",
        ),
        (lambda f: edit_windows(f, lambda w: pd.concat([w, w])), "windows.parquet holds a window twice"),
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
        (
            ["runs/anna", "runs/anna"],
            "'hold' on 'toyset', fold 0, seed 0 stands in runs/anna and in runs/anna; leave one of them out.",
        ),
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


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (lambda f: edit_rows(f, lambda r: r.assign(parent="one", kind="turn")), "parent is 'one' in the rows, 'r0"),
        (lambda f: edit_rows(f, lambda r: r.assign(group="one")), "group is 'one' in the rows, 'r0"),
        (lambda f: edit_rows(f, lambda r: r.assign(edh=1e90)), "edh is 1e+90 in the rows"),
        (lambda f: edit_windows(f, lambda w: w.assign(speed=w["speed"] + 1.0)), "in windows.parquet, "),
        (
            lambda f: edit_summary(f, lambda s: s.update(ship_L=60.0)),
            "ship_L of 'toyset' is 60.0 in summary.json, 50.0 in the data set.",
        ),
        (
            lambda f: edit_summary(f, lambda s: s.update(ship="queen")),
            "ship of 'toyset' is queen in summary.json, toy in the data set.",
        ),
        (
            lambda f: edit_summary(f, lambda s: s["runs"].update(train=s["runs"]["train"] + s["runs"]["test"])),
            "runs.train of 'toyset', fold 0, is",
        ),
        (
            lambda f: edit_summary(f, lambda s: s.update(parameters=3)),
            "parameters is 3 in summary.json, 0 in the saved model.",
        ),
    ],
)
def test_verify_computes_again_what_is_no_score(cli, two, spoil, message):
    spoil(two / "anna")
    result = cli("leaderboard", two / "anna", "--verify", "--no-plots", "--out", "none")
    assert result.exit_code == 1, result.output
    assert message in result.stderr
    assert not Path("none").exists()


def test_verify_computes_the_reason_of_a_diverged_run_again(cli, two):
    [file] = (two / "ben/cells").glob("toyset/*/fold0-seed0/predictions.npz")
    S = np.load(file)["S"]
    S[2, 5:, 0] = np.nan
    np.savez_compressed(file, S=S)
    lost = (pd.read_parquet(two / "ben/rows.parquet")["fold"] == 0).to_numpy() & (np.arange(16) == 2)
    numbers = list(pd.read_parquet(two / "ben/rows.parquet").columns)
    scores = numbers[numbers.index("ed") : numbers.index("fit_s")]

    def diverged(rows):
        rows.loc[lost, ["status", "reason"]] = ["diverged", "it was the weather"]
        rows.loc[lost, scores] = np.nan
        return rows

    edit_rows(two / "ben", diverged)
    edit_summary(
        two / "ben",
        lambda s: s["fold"] or s.update(status="diverged", run_status=["ok", "ok", "diverged"] + ["ok"] * 5),
    )
    result = cli("leaderboard", two / "ben", "--verify", "--no-plots")
    assert result.exit_code == 1
    assert (
        "the reason is 'it was the weather' in the rows, 'x is nan at t = 6 s after the start' from the predictions."
        in result.stderr
    )


def test_a_failed_model_with_predictions_is_noticed(cli, two):
    rows = pd.read_parquet(two / "ben/rows.parquet")
    scores = list(rows.columns)[list(rows.columns).index("ed") : list(rows.columns).index("fit_s")]
    edit_rows(two / "ben", lambda r: r.assign(status="failed", reason="no", **dict.fromkeys(scores, np.nan)))
    edit_summary(two / "ben", lambda s: s.update(status="failed", run_status=["failed"] * 8))
    result = cli("leaderboard", two / "ben", "--verify", "--no-plots")
    assert result.exit_code == 1
    assert (
        "toyset mine.py:Still fold 0 seed 0: status is 'failed' in the rows, and there are predictions."
        in result.stderr
    )


@pytest.mark.long
def test_a_page_of_a_submission_says_in_one_line_that_there_are_no_plots(cli, two, tmp_path):
    assert cli("leaderboard", two / "anna", two / "ben", "--no-plots", "-q", "--submission", "sub").exit_code == 0
    result = cli("leaderboard", "sub", "--out", "pages")
    assert result.exit_code == 0, result.output
    assert result.stdout.count("no plots: no saved predictions.") == 1
    assert [p.name for p in (tmp_path / "pages").iterdir()] == ["toyset.md"]
    part = cli("leaderboard", two / "anna", "sub", "--out", "pages")
    assert part.exit_code == 2  # the same cells twice
    shutil.rmtree(two / "ben/cells")
    half = cli("leaderboard", two / "anna", two / "ben", "--out", "pages")
    assert half.exit_code == 0, half.output
    assert "toyset: plots without mine.py:Still: no saved predictions." in half.stdout
    assert len(list((tmp_path / "pages/toyset").iterdir())) == 3


def test_a_submission_never_replaces_a_study(cli, two):
    before = {p: p.read_bytes() for p in two.rglob("*") if p.is_file()}
    for target in (two / "anna", two / "ben/../anna", two / "ben"):
        result = cli("leaderboard", two / "anna", "--no-plots", "--submission", target, "--out", "none")
        assert result.exit_code == 2
        assert "which it would replace. Give another folder." in result.stderr
    assert {p: p.read_bytes() for p in two.rglob("*") if p.is_file()} == before
    assert not Path("none").exists()


def test_what_pandas_wrote_of_itself_into_a_table_decides_nothing(cli, two):
    table = pq.read_table(two / "ben/rows.parquet")
    pq.write_table(table.replace_schema_metadata({"pandas": "{" * 100_000}), two / "ben/rows.parquet")
    assert cli("leaderboard", two / "ben", "--no-plots", "-q").exit_code == 0


def test_a_column_that_no_entry_names_reaches_no_page(cli, two):
    """A metric of one model's rows must not ride on another model's entry."""

    def only_ed(summary):
        summary["task"]["metrics"] = ["ed"]
        summary["columns"] = [c for c in summary["columns"] if c["name"] == "ed" or c["name"].startswith("ed_at")]

    edit_summary(two / "anna", only_ed)
    assert "edh" not in read_results([two / "anna"]).rows
    both = pd.concat([pd.read_parquet(two / name / "rows.parquet") for name in ("anna", "ben")])
    entries = [s for name in ("anna", "ben") for s in json.loads((two / name / "summary.json").read_text())]
    both.to_parquet(two / "ben/rows.parquet", index=False)
    (two / "ben/summary.json").write_text(json.dumps(entries))
    result = cli("leaderboard", two / "ben", "--no-plots")
    assert result.exit_code == 2
    assert "the rows hold edh, which is not among its columns in summary.json" in result.stderr


def test_verify_without_predictions_says_what_it_needs(cli, two):
    shutil.rmtree(two / "ben/cells")
    result = cli("leaderboard", two / "ben", "--verify", "--no-plots")
    assert result.exit_code == 2
    assert (
        "no saved predictions of toyset mine.py:Still fold 0 seed 0; --verify needs the whole folder" in result.stderr
    )
