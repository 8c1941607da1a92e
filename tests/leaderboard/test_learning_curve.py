"""Learning curve: a command that gives a table, a page and a plot; and what it refuses."""

from __future__ import annotations

import json

import pandas as pd
import pytest
from toy_ship import write_toy_folder
from typer.testing import CliRunner

from shipbench.bench.submissions import read_results
from shipbench.bench.task import make_task
from shipbench.cli.app import app
from shipbench.leaderboard.learning_curve import draw, run_curve
from shipbench.leaderboard.pages import scores_of

MODEL = """
import numpy as np
class Learner:
    '''Its error is 100 m over the number of runs that it saw; with fewer than four it fails.'''
    def fit(self, train, valid=None, *, seed=0):
        self.n = len({r.parent for d in (train, valid) if d for r in d.runs})
        if self.n < 4:
            raise ValueError("too few runs")
        return self
    def predict(self, s0, U, history=None):
        S = np.repeat(s0[:, None], U.shape[1], axis=1)
        S[..., 0] += 1000.0 / self.n
        return S
"""


@pytest.fixture
def cli(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_toy_folder(tmp_path / "toyset", 12, 20)
    (tmp_path / "m.py").write_text(MODEL)
    return lambda *arguments: CliRunner().invoke(app, ["learning-curve", *[str(a) for a in arguments]])


QUICK = ("-d", "./toyset", "--horizon", "20", "--folds", "2", "--out", "c", "-q")


@pytest.mark.long
def test_a_curve_has_a_figure_for_every_model_and_number_of_runs(cli, tmp_path):
    result = cli("-m", "m.py:Learner", "-m", "hold", *QUICK, "--sizes", "6,4", "--json")
    assert result.exit_code == 0, result.output
    document = json.loads(result.stdout)
    rows = {row["model"]: row for row in document["curve"]["tables"][0]["rows"]}
    assert document["curve"]["tables"][0]["columns"] == {"model": "model", "n4": "4 runs", "n6": "6 runs"}
    assert rows["hold"]["n4"] == rows["hold"]["n6"]  # nothing is learnt, and the scored runs are the same
    assert rows["m.py:Learner"]["n4"] > rows["m.py:Learner"]["n6"] > rows["m.py:Learner"]["n6_low"]
    page = (tmp_path / "c/learning-curve.md").read_text()
    assert "# Learning curve: toyset" in page
    assert "![learning curve](learning-curve.png)" in page
    assert (tmp_path / "c/learning-curve.png").read_bytes()[:4] == b"\x89PNG"
    assert set(pd.read_parquet(tmp_path / "c/train004/rows.parquet")["status"]) == {"ok"}


@pytest.mark.long
def test_a_size_at_which_a_model_fails_is_a_gap_with_its_reason_and_exit_code_one(cli, tmp_path):
    result = cli("-m", "m.py:Learner", *QUICK, "--sizes", "2,4")
    assert result.exit_code == 1
    assert "2 training runs: toyset m.py:Learner fold 0 seed 0: fit: ValueError: too few runs" in result.stderr
    page = (tmp_path / "c/learning-curve.md").read_text()
    assert "| m.py:Learner | - | " in page
    assert "`m.py:Learner` has runs without a score with 2 training runs" in page


def test_resume_keeps_what_is_finished(cli):
    arguments = ("-m", "hold", "-d", "./toyset", "--horizon", "20", "--folds", "2", "--out", "c", "--sizes", "4,6")
    assert "(kept)" not in cli(*arguments).stderr
    again = cli(*arguments, "--resume").stderr
    assert again.count("(kept)") == 4
    assert "[2/2] toyset hold fold 1 seed 0: ok (kept)" in again  # each number of runs counts from one


@pytest.mark.parametrize(
    ("sizes", "message"),
    [
        ("4,20", "train_runs = 20, but fold 0 has 6 training runs; give at most 6"),
        ("1,4", "--sizes 1, 4; accepted: numbers of training runs of 2 and more"),
        ("", "--sizes (none); accepted"),
        ("a", "--sizes a: not a list of whole numbers"),
    ],
)
def test_impossible_sizes_are_refused_before_anything_is_fitted(cli, tmp_path, sizes, message):
    result = cli("-m", "hold", *QUICK, "--sizes", sizes)
    assert result.exit_code == 2, result.output
    assert message in result.stderr
    assert not (tmp_path / "c").exists()


def test_the_plot_has_a_point_for_every_number(cli, tmp_path):
    task = make_task({"dataset": "./toyset", "models": ["hold"], "horizon_s": 20, "folds": 2})
    run_curve(task, [4, 6], tmp_path / "c")
    found = {n: scores_of(read_results([tmp_path / f"c/train00{n}"]), "toyset") for n in (4, 6)}
    [line] = [x for x in draw(found, "toyset").axes[0].lines if x.get_label() == "hold"]
    assert line.get_xdata().tolist() == [4, 6]
    assert line.get_ydata()[0] == pytest.approx(found[4].means("ed")["hold"]["mean"])
