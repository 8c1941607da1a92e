"""Predicted trajectories in a study: a row for every window, scored where they cover it, compared on common windows."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest
from made_tracks import MOTION, apart, predicted, rows_of, written
from typer.testing import CliRunner

import shipbench as sb
from shipbench.bench.submissions import read_results
from shipbench.cli.app import app
from shipbench.data.files import write_dataset
from shipbench.errors import InputError
from shipbench.leaderboard.pages import build_board, scores_of
from shipbench.leaderboard.verify import verify
from shipbench.replay.bind import bound
from shipbench.specs import parse_spec

LINES: dict[str, Any] = {"horizon": 20, "folds": 2, "quiet": True}


@pytest.fixture
def data(toy):
    return apart(toy(runs=6, steps=40))


@pytest.fixture
def half(data, tmp_path):
    """Trajectories of four of the six runs, two of them under names of their own."""
    table = predicted(data.subset([0, 1, 2, 3]), MOTION)
    table["trajectory"] = table["trajectory"].replace({"r02": "theirs_1", "r03": "theirs_2"})
    return written(table, tmp_path / "theirs")


def study(data, folder, out, **more):
    return sb.benchmark([f"predictions:{folder}", "hold"], data, out=out, **LINES, **more)


@pytest.mark.long
def test_windows_that_are_not_covered_are_skipped_and_the_others_scored(data, half, tmp_path, undrawn):
    model = f"predictions:{half}"
    models = {name: name for name in (model, "hold")} | {"still": lambda s0, U, dt: np.repeat(s0[:, None], 20, axis=1)}
    scores = sb.benchmark(models, data, out=tmp_path / "out", **LINES)
    rows = scores.results.rows
    own = rows[rows["model"] == model]
    assert own["status"].value_counts().to_dict() == {"ok": 8, "skipped": 4}
    assert set(own.loc[own["status"] == "skipped", "parent"]) == {"r04", "r05"}
    assert set(own.loc[own["status"] == "skipped", "reason"]) == {
        "no predicted trajectory covers it: none is of this run"
    }
    off = own.loc[own["run"] == "r00@0s", "final_displacement"]
    assert off.tolist() == pytest.approx([0.02 * 20], abs=1e-6)
    results = read_results(tmp_path / "out")
    assert verify(results) == ([], []) or not verify(results)[0]
    board = build_board(results, "toy")
    first, texts = board.tables[0], board.markdown("x")
    assert {row["model"]: row["runs"] for row in first.rows}[model] == "8/12"
    assert board.ranking[-1] == model  # below all complete models, whatever its error
    assert f"`{model}` covers 8 of 12 windows; its means are of those." in texts
    assert "theirs_1 -> r02 from t = 0 s, by start state: 0 m, 0 deg off" in texts
    assert "2 trajectories matched by run id" in texts
    assert "8 windows: median 0.2 m, maximum 0.4 m; median 0 deg" in texts
    pairs = {(p.first, p.second): p for p in scores_of(results, "toy").pairs}
    assert {p.windows for pair, p in pairs.items() if model in pair} == {8}
    assert {p.windows for pair, p in pairs.items() if model not in pair} == {12}
    assert f"`{model}` is compared on the 8 of 12 windows that it covers." in texts
    assert (tmp_path / "out" / "rows.parquet").exists()


@pytest.mark.long
def test_a_study_resumes_until_a_file_changes_and_processes_give_the_same(data, half, tmp_path, undrawn):
    write_dataset(data, tmp_path / "toy")
    here = study(str(tmp_path / "toy"), half, tmp_path / "here")
    apart_ = study(str(tmp_path / "toy"), half, tmp_path / "apart", executor="processes", workers=2)
    columns = ["model", "run", "status", "ed"]
    assert here.results.rows[columns].equals(apart_.results.rows[columns])
    place = tmp_path / "here"

    def finished() -> list[str]:
        summaries = json.loads((place / "summary.json").read_text())
        return [s["finished"] for s in summaries if "predictions" in s["model"] and s["key"]]

    before = finished()
    study(str(tmp_path / "toy"), half, place, resume=True)
    assert finished() == before
    assert len(before) == 2
    written(predicted(data.subset([0, 1]), growth=0.05), half)
    study(str(tmp_path / "toy"), half, place, resume=True)
    rows = read_results(place).rows
    assert rows.loc[rows["model"].str.startswith("predictions"), "status"].value_counts()["ok"] == 4


def test_nothing_covered_is_a_skipped_cell_with_the_reason(data, tmp_path, undrawn):
    short = predicted(data)
    folder = written(short[short["t"] <= 10.0], tmp_path / "theirs")
    scores = study(data, folder, tmp_path / "out")
    [status] = {s["status"] for s in scores.results.summaries if "predictions" in s["model"]}
    assert status == "skipped"
    reasons = {s["reason"] for s in scores.results.summaries if "predictions" in s["model"]}
    assert reasons == {"no predicted trajectory covers it: those of its run last 10 s, the window 20 s"}
    assert not verify(read_results(tmp_path / "out"))[0]


@pytest.mark.long
def test_the_command_takes_predictions_and_a_mapping(data, half, tmp_path, monkeypatch, undrawn):
    monkeypatch.chdir(tmp_path)
    write_dataset(data, tmp_path / "trial")
    logs = tmp_path / "logs"
    for run in data.runs:
        rows = rows_of(predicted(data), run.id).drop(columns="trajectory")
        written(rows.assign(psi=np.rad2deg(rows["psi"])), logs, f"{run.id}.csv")
    channels = "".join(
        f'{name} = {{column = "{name}", unit = "{unit}"}}\n'
        for name, unit in zip(MOTION, ("m", "m", "deg", "m/s", "m/s", "rad/s"), strict=True)
    )
    (tmp_path / "m.toml").write_text(f'name = "theirs"\ndt = 1.0\n[time]\ncolumn = "t"\n[channels]\n{channels}')
    words = ["run", "-d", "trial", "-m", "hold", "--horizon", "20", "--folds", "2", "-q"]
    done = CliRunner().invoke(app, [*words, "--predictions", "theirs", "-o", "a"])
    assert done.exit_code == 0, done.output
    assert "predictions:theirs" in done.output
    done = CliRunner().invoke(app, [*words, "--predictions", "logs", "--mapping", "m.toml", "-o", "b", "--json"])
    assert done.exit_code == 0, done.output
    assert json.loads(done.stdout)["leaderboards"]["toy"]["ranking"] == ["predictions:logs[mapping=m.toml]", "hold"]
    done = CliRunner().invoke(app, [*words, "--mapping", "m.toml"])
    assert done.exit_code == 2
    assert "belongs to --predictions" in " ".join(done.output.split())


def test_a_frame_that_differs_is_told_and_not_corrected(data, tmp_path):
    folder = written(predicted(data).assign(psi=lambda t: np.rad2deg(t["psi"])), tmp_path / "theirs")
    spec = bound(parse_spec(f"predictions:{folder}"), data)
    assert "angles in degrees; correct the files by psi = radians(psi)" in spec.matched.notes[-1]
    assert spec.matched.runs["r00"][0].states[0, 2] == pytest.approx(np.rad2deg(data.runs[0].states[0, 2]))
    assert bound(parse_spec("physics"), data).matched is None


def test_a_folder_that_is_a_data_set_may_lack_actuators(data, tmp_path):
    write_dataset(data, tmp_path / "theirs", format="csv")
    path = tmp_path / "theirs" / "trajectories.csv"
    lines = [",".join(line.split(",")[:8]) for line in path.read_text().splitlines()]
    path.write_text("\n".join(lines) + "\n")
    spec = bound(parse_spec(f"predictions:{tmp_path / 'theirs'}"), data)
    assert np.isnan(spec.matched.runs["r00"][0].states[:, 6:]).all()


def test_predictions_of_other_runs_are_one_message(data, tmp_path):
    table = predicted(data)
    other = table.assign(trajectory="sim_" + table["trajectory"], x=table["x"] + 9000.0, psi=table["psi"] + 2.0)
    with pytest.raises(InputError, match=r"no trajectory matches a run of 'toy'. Ids received: sim_r00"):
        study(data, written(other, tmp_path / "theirs"), tmp_path / "out")
