"""A result folder that is full, read-only, busy or damaged: one clear message, an exit code, and nothing lost."""

from __future__ import annotations

import fcntl
import json
import os
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from shipbench.bench.results import Cell, read_truth, truth_path
from shipbench.bench.runner import run_tasks
from shipbench.bench.submissions import read_results
from shipbench.bench.task import make_task
from shipbench.errors import InputError, WorkError

MODELS = """
from pathlib import Path
import numpy as np

class Drawn:
    def fit(self, train, valid=None, *, seed=0):
        with Path(__file__).with_suffix(".log").open("a") as log:
            log.write(f"{seed}\\n")
        self.bias = np.random.default_rng(seed).normal(size=(400, 1, 10))
        return self
    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1], axis=1) + self.bias[:len(s0)]
"""


@pytest.fixture
def study(toy_folder, tmp_path):
    """Runs two folds of two seeds of the model above; `study.fits()` counts its fits."""
    data, file, out = toy_folder(runs=6), tmp_path / "models.py", tmp_path / "out"
    file.write_text(MODELS)

    def run(resume=False, model=f"{file}:Drawn", **task):
        settings = {"dataset": str(data), "models": [model], "horizon_s": 20, "folds": 2, "seeds": [0, 1], **task}
        return run_tasks([make_task(settings)], out, resume=resume).rows.drop(columns=["fit_s", "predict_s"])

    run.fits = lambda: len(file.with_suffix(".log").read_text().split())
    run.out, run.data, run.file = out, data, file
    run.cell = lambda fold, seed: out / Cell("toyset", f"{file}:Drawn", fold, seed).folder
    return run


def command(study, *more: str, limit: int) -> subprocess.CompletedProcess[str]:
    """`shipbench run` on the same study, where no file may be larger than `limit` bytes."""
    options = [
        "-m",
        f"{study.file}:Drawn",
        "-d",
        str(study.data),
        "--horizon",
        "20",
        "--folds",
        "2",
        "--seeds",
        "0,1",
        "-o",
        str(study.out),
        "-q",
    ]
    path = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, sys.path)])

    return subprocess.run(
        [sys.executable, "-m", "shipbench", "run", *options, *more],
        env={**os.environ, "PYTHONPATH": path}, capture_output=True, text=True, check=False,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit)),
    )  # fmt: skip


@pytest.mark.long
def test_a_full_disk_stops_with_a_message_keeps_what_is_finished_and_resume_goes_on(study):
    before = study()
    shutil.rmtree(study.cell(1, 1))
    table = (study.out / "rows.parquet").read_bytes()
    room = (
        max(path.stat().st_size for path in study.out.glob("truth/*/*")) + 100
    )  # enough for the truth, too little for a cell
    assert room < max(path.stat().st_size for path in study.cell(1, 0).iterdir())
    full = command(study, "--resume", limit=room)
    assert full.returncode == 1
    assert full.stderr.startswith("error: the study stopped: ")
    assert "File too large. What is finished is kept in" in full.stderr
    assert "run the same command again with --resume" in full.stderr
    assert full.stderr.count("\n") == 1
    assert not study.cell(1, 1).exists()
    assert not list(study.out.rglob("*.tmp*"))
    assert (study.out / "rows.parquet").read_bytes() == table
    after = study(resume=True)
    assert study.fits() == 4 + 1 + 1
    pd.testing.assert_frame_equal(before, after, check_exact=True)


@pytest.fixture
def somebody_else():
    """For root no folder is read-only: it becomes somebody else for the test."""
    root = os.geteuid() == 0
    if root:
        os.seteuid(65534)
    yield
    if root:
        os.seteuid(0)


def test_a_read_only_folder_is_refused_before_anything_is_fitted(study, request):
    study()
    for folder in [*study.out.parents][:-2]:
        folder.chmod(folder.stat().st_mode | 0o755)
    study.out.chmod(0o555)
    request.getfixturevalue("somebody_else")
    with pytest.raises(
        InputError, match=r"cannot write to .*out: Permission denied. Give another folder with out=FOLDER."
    ):
        study(model="hold")  # a model file would need a process, and Python here may not be somebody else's to run
    assert study.fits() == 4


def test_a_file_in_the_place_of_the_folder_is_refused(study):
    study.out.write_text("mine")
    with pytest.raises(InputError, match=r"cannot write to .*out: .*Give another folder"):
        study()
    assert study.out.read_text() == "mine"


def test_two_studies_do_not_write_into_one_folder(study):
    study()
    handle = os.open(study.out, os.O_RDONLY)
    fcntl.flock(handle, fcntl.LOCK_EX)
    with pytest.raises(InputError, match="another study is being written to"):
        study()
    os.close(handle)
    study(resume=True)


def test_leftovers_of_killed_studies_are_taken_away_and_no_other_hidden_file(study):
    study()
    left = [
        study.out / ".rows.parquet.123.tmp",
        study.cell(0, 0).parent / ".fold0-seed0.123.tmp",
        study.out / "truth/toyset/.fold0.npz.123.tmp",
    ]
    for path in left:
        path.mkdir()
    (study.out / ".mine").write_text("kept")
    study(resume=True)
    assert not any(path.exists() for path in left)
    assert (study.out / ".mine").read_text() == "kept"


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("summary.json", b""),
        ("summary.json", b"{half"),
        ("summary.json", b"[1, 2]"),
        ("summary.json", b"\xff\xfe\x00"),
        ("summary.json", None),
        ("rows.parquet", b""),
        ("rows.parquet", b"PAR1 nothing PAR1"),
        ("rows.parquet", None),
        ("predictions.npz", b"PK half a zip"),
        ("predictions.npz", None),
    ],
)
def test_a_damaged_cell_is_made_again_and_the_others_are_kept(study, name, content):
    before = study()
    path = study.cell(1, 0) / name
    path.unlink() if content is None else path.write_bytes(content)
    pd.testing.assert_frame_equal(before, study(resume=True), check_exact=True)
    assert study.fits() == 4 + 1


@pytest.mark.long
def test_one_changed_byte_of_the_rows_is_seen(study):
    before = study()
    path = study.cell(1, 0) / "rows.parquet"
    content = bytearray(path.read_bytes())
    content[len(content) // 3] ^= 1
    path.write_bytes(content)
    pd.testing.assert_frame_equal(before, study(resume=True), check_exact=True)


@pytest.mark.long
@pytest.mark.parametrize("name", ["rows.parquet", "summary.json", "study.json", "truth/toyset/fold0.npz"])
def test_a_damaged_table_of_the_study_is_refused_by_its_readers_and_mended_by_resume(study, name):
    before = study()
    (study.out / name).write_bytes(b"\x00 nothing")
    if name in ("rows.parquet", "summary.json"):
        with pytest.raises(InputError, match="holds no results"):
            read_results([study.out])
    pd.testing.assert_frame_equal(before, study(resume=True), check_exact=True)
    assert study.fits() == 4
    assert len(read_results([study.out]).rows) == len(before)


@pytest.mark.long
def test_resume_tries_failed_cells_again(study):
    text = study.file.read_text()
    study.file.write_text(
        text.replace(
            "self.bias =",
            'if seed == 1 and not Path(__file__).with_suffix(".ok").exists(): raise ValueError\n        self.bias =',
        )
    )
    assert sorted(set(study()["status"])) == ["failed", "ok"]
    study.file.with_suffix(".ok").touch()
    assert set(study(resume=True)["status"]) == {"ok"}
    assert study.fits() == 4 + 2


@pytest.mark.long
def test_resume_sees_runs_that_moved_to_another_fold(study):
    study()
    toml = study.data / "dataset.toml"
    toml.write_text(
        toml.read_text() + '\n[runs.r00]\ngroup = "a"\n\n[runs.r01]\ngroup = "a"\n\n[runs.r02]\ngroup = "a"\n'
    )
    fingerprints = [json.loads((study.cell(0, 0) / "summary.json").read_text())["fingerprint"]]
    study(resume=True)
    fingerprints.append(json.loads((study.cell(0, 0) / "summary.json").read_text())["fingerprint"])
    assert fingerprints[0] == fingerprints[1]  # the samples are the same, the folds are not
    assert study.fits() == 8


@pytest.mark.long
def test_a_study_that_finishes_nothing_leaves_the_older_table(study, monkeypatch):
    before = study()

    def lost(*_):
        raise WorkError("the workers are lost")

    monkeypatch.setattr("shipbench.bench.runner.answers_of", lost)
    with pytest.raises(WorkError):
        study()
    pd.testing.assert_frame_equal(
        read_results([study.out]).rows.drop(columns=["fit_s", "predict_s"]), before, check_exact=True
    )


@pytest.mark.long
def test_nothing_that_the_study_did_not_make_is_removed(study):
    study()
    mine = [
        study.out / ".mine.tmp" / "data",
        study.out / ".notes.txt.tmp",
        study.out / "cells" / "x" / "y" / ".z.tmp" / "data",
        study.cell(0, 0) / "notes.txt",
    ]
    elsewhere = study.out.parent / "elsewhere"
    mine.append(elsewhere / ".fold0.npz.12.tmp")
    for path in mine:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("precious")
    (study.out / "truth" / "link").symlink_to(elsewhere)
    (study.out / ".rows.parquet.77.tmp").symlink_to(elsewhere)
    leftover = study.out / "truth" / "toyset" / ".fold0.npz.4242.tmp"
    leftover.write_text("half")
    study()
    assert [path.read_text() for path in mine] == ["precious"] * len(mine)
    assert not leftover.exists()
    assert not (study.out / ".rows.parquet.77.tmp").is_symlink()


@pytest.mark.long
def test_another_study_is_replaced_only_where_resume_is_asked_for(study):
    before = study()
    with pytest.raises(
        InputError, match=r"out holds the results of another study.*another folder with out=FOLDER.*resume=True"
    ):
        study(horizon_s=10)
    refused = command(study, "--folds", "3", limit=10**9)
    assert (refused.returncode, refused.stderr.count("\n")) == (2, 1)
    assert "another folder with --out. To go on there, give --resume" in refused.stderr
    assert study.fits() == 4
    pd.testing.assert_frame_equal(before, study(), check_exact=True)  # the same study may be run again
    assert len(study(resume=True, seeds=[0])) == len(before) / 2
    (study.out / "study.json").unlink()
    with pytest.raises(InputError, match="another study"):
        study(seeds=[0])


@pytest.mark.parametrize("link", ["cells", "truth", "cells/toyset", "truth/toyset"])
def test_a_study_writes_through_no_link_in_its_folder(study, link):
    elsewhere = study.out.parent / "elsewhere"
    elsewhere.mkdir()
    (study.out / link).parent.mkdir(parents=True, exist_ok=True)
    (study.out / link).symlink_to(elsewhere)
    with pytest.raises(
        InputError, match=f"out/{link} is a link; accepted: (folders|a folder), so that a study writes only below .*out"
    ):
        study()
    assert not list(elsewhere.iterdir())


def test_a_truth_of_a_single_id_is_no_truth(tmp_path):
    path = truth_path(tmp_path, "toyset", 0)
    path.parent.mkdir(parents=True)
    np.savez(path, ids=np.array("r00"), s0=np.zeros((1, 10)), U=np.zeros((1, 5, 4)), truth=np.zeros((1, 5, 10)))
    with pytest.raises(InputError, match="are no truth of windows"):
        read_truth(tmp_path, "toyset", 0)
