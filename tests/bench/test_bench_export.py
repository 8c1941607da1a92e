"""Exported predictions give the published scores again, in every format."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.io import loadmat
from toy_ship import write_toy_folder
from typer.testing import CliRunner

from shipbench.bench.results import Cell, read_predictions, read_truth
from shipbench.cli.app import app
from shipbench.signals import STATES

BROKEN = """
import numpy as np
class Wild:
    def fit(self, train, valid=None, *, seed=0): return self
    def predict(self, s0, U, history=None):
        S = np.repeat(s0[:, None], U.shape[1], axis=1); S[0, 3:] = np.nan; return S
class Broken(Wild):
    def predict(self, s0, U, history=None): raise RuntimeError('boom')
"""


def shipbench(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture
def cli(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return shipbench


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Two folds of a model that works, one that diverges in one window, and one that fails."""
    folder = tmp_path_factory.mktemp("made")
    (folder / "mine.py").write_text(BROKEN)
    data = write_toy_folder(folder / "toyset")
    models = ("-m", "hold", "-m", "mine.py:Wild", "-m", "mine.py:Broken")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setattr("shipbench.leaderboard.plots.draw_all", lambda *_: [])
        shipbench("run", *models, "-d", data, "--horizon", "20", "--folds", "2", "-q", "--out", "r")
    return folder / "r"


@pytest.fixture
def study(made, tmp_path) -> Path:
    """A copy of what was made, to be spoiled."""
    return shutil.copytree(made, tmp_path / "r")


@pytest.mark.parametrize("format", ["csv", "parquet"])
def test_tables_hold_every_prediction_and_give_ed_again(cli, study, format):
    result = cli("data", "export", study, "--out", "o", "--format", format)
    assert result.exit_code == 0, result.output
    table = pd.read_csv("o/predictions.csv") if format == "csv" else pd.read_parquet("o/predictions.parquet")
    rows = pd.read_parquet(study / "rows.parquet")
    assert len(table) == len(rows) * 20, "no window is left out, whatever became of it"
    assert sorted(table.model.unique()) == ["hold", "mine.py:Broken", "mine.py:Wild"]
    scored = table[table.status == "ok"]
    ed = (
        np.hypot(scored.x - scored.true_x, scored.y - scored.true_y)
        .groupby([scored.model, scored.fold, scored.run])
        .mean()
    )
    published = rows[rows.status == "ok"].set_index(["model", "fold", "run"])["ed"]
    pd.testing.assert_series_equal(ed.sort_index(), published.sort_index(), check_names=False, rtol=1e-12)
    one = table[(table.model == "hold") & (table.fold == 1)]
    np.testing.assert_array_equal(
        one[list(STATES)].to_numpy(), read_predictions(study, Cell("toyset", "hold", 1, 0)).reshape(-1, 10)
    )
    starts = pd.read_csv("o/starts.csv") if format == "csv" else pd.read_parquet("o/starts.parquet")
    np.testing.assert_array_equal(starts[starts.fold == 1][list(STATES)], read_truth(study, "toyset", 1).s0)
    assert json.loads(Path("o/summary.json").read_text()) == json.loads((study / "summary.json").read_text())


def test_the_mat_file_gives_ed_again_in_the_way_of_the_docs(cli, study):
    result = cli("data", "export", study, "--out", "p.mat")
    assert result.exit_code == 0, result.output
    cells = loadmat("p.mat")["predictions"][0]
    rows = pd.read_parquet(study / "rows.parquet")
    assert [(str(c["model"][0]), int(c["fold"][0, 0])) for c in cells] == [
        (m, f) for m in ("hold", "mine.py:Wild", "mine.py:Broken") for f in (0, 1)
    ]
    for c in cells:
        ed = np.mean(
            np.hypot(c["S"][:, :, 0] - c["truth"][:, :, 0], c["S"][:, :, 1] - c["truth"][:, :, 1]), axis=1
        )  # as in docs/matlab.md
        ok = np.array([str(s[0][0]) == "ok" for s in c["run_status"]])
        np.testing.assert_allclose(ed[ok], c["ED"][ok, 0], rtol=1e-12)
        own = rows[(rows.model == str(c["model"][0])) & (rows.fold == int(c["fold"][0, 0]))]
        np.testing.assert_array_equal(c["ED"][:, 0], own["ed"].to_numpy(float))
        assert [str(r[0][0]) for r in c["run"]] == own["run"].tolist()
        assert np.isnan(c["ED"][~ok]).all()
    assert {str(c["status"][0]) for c in cells} == {"ok", "diverged", "failed"}
    assert json.loads(str(cells[0]["summary"][0])) == json.loads((study / "summary.json").read_text())[0]
    page = (Path(__file__).parents[2] / "docs/matlab.md").read_text()
    assert "mean(hypot(c.S(:,:,1) - c.truth(:,:,1), c.S(:,:,2) - c.truth(:,:,2)), 2)" in page


@pytest.mark.parametrize("damage", ["truth gone", "truth cut", "predictions cut", "rows only"])
def test_damaged_results_are_one_message(cli, study, damage):
    truth, predicted = study / "truth/toyset/fold0.npz", study / "cells/toyset/hold/fold0-seed0/predictions.npz"
    if damage == "truth gone":
        truth.unlink()
    elif damage == "rows only":
        shutil.rmtree(study / "truth")
        shutil.rmtree(study / "cells")
    else:
        path = truth if damage == "truth cut" else predicted
        path.write_bytes(path.read_bytes()[:200])
    result = cli("data", "export", study, "--out", "o", "--format", "csv")
    assert result.exit_code == 2, result.output
    assert "the saved predictions of toyset hold fold 0 seed 0 cannot be read" in result.stderr
    assert not Path("o").exists()


def test_the_results_themselves_are_not_overwritten(cli, study):
    before = sorted(p.name for p in study.iterdir())
    assert cli("data", "export", study, "--out", study, "--format", "parquet").exit_code == 2
    assert sorted(p.name for p in study.iterdir()) == before
