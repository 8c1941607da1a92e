"""A stranger's model under the local executor: what it does to its process, to others and to the truth harms its own
rows only."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import psutil
import pytest

from shipbench.bench.executors import Execution
from shipbench.bench.isolate import Limits
from shipbench.bench.results import Cell, read_summary
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.errors import InputError

MODELS = """
import asyncio, gc, os, signal, subprocess, sys, time
import numpy as np

class Plain:
    def fit(self, train, valid=None, *, seed=0):
        return self
    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1], axis=1)

class Moves(Plain):
    def fit(self, train, valid=None, *, seed=0):
        os.chdir("/")
        os.umask(0o777)
        np.seterr(all="raise")
        sys.stderr.close()
        return self

class Cancelled(Plain):
    def fit(self, train, valid=None, *, seed=0):
        raise asyncio.CancelledError("mine")

class Generator(Plain):
    def fit(self, train, valid=None, *, seed=0):
        raise GeneratorExit

class Interrupts(Plain):
    def predict(self, s0, U, history=None):
        raise KeyboardInterrupt

class Peeks(Plain):
    def predict(self, s0, U, history=None):
        states = lambda o: isinstance(o, np.ndarray) and o.shape[-1:] == (10,) and o.ndim == 3
        found = [o for o in gc.get_objects() if type(o).__name__ == "Batch" or states(o)]
        assert not found, found
        return super().predict(s0, U)

class Orphans(Plain):
    def fit(self, train, valid=None, *, seed=0):
        sleeper = [sys.executable, "-c", "import time; time.sleep(300)  # orphan of a test"]
        code = f"import subprocess; subprocess.Popen({sleeper!r}, start_new_session=True)"
        subprocess.run([sys.executable, "-c", code])  # its parent ends at once
        return self

class OrphansAndCrashes(Orphans):
    def fit(self, train, valid=None, *, seed=0):
        super().fit(train)
        os.kill(os.getpid(), signal.SIGSEGV)

class OrphansAndHangs(Orphans):
    def fit(self, train, valid=None, *, seed=0):
        super().fit(train)
        time.sleep(100)

class Links(Plain):
    def save(self, path):
        os.makedirs(path)
        os.symlink("/etc/passwd", path / "passwd")
"""


@pytest.fixture
def study(toy_folder, tmp_path, monkeypatch):
    """Runs models of the file above, or by name, on the toy ship's folder, with relative paths; one fold is scored."""
    data, file = toy_folder(runs=4), tmp_path / "models.py"
    file.write_text(MODELS)
    monkeypatch.chdir(tmp_path)
    config = {"dataset": str(data.relative_to(tmp_path)), "horizon_s": 20, "folds": 2, "valid_runs": 1}

    def run(*models, **options):
        specs = [f"models.py:{m}" if m[0].isupper() else m for m in models]
        return run_tasks([make_task({**config, "models": specs})], "out", **options)

    return run


def _status(outcome):
    rows = outcome.rows.assign(name=outcome.rows["model"].str.rpartition(":")[2])
    return {name: (set(part["status"]), part["reason"].iloc[0]) for name, part in rows.groupby("name", sort=False)}


def test_what_a_model_does_to_its_process_harms_its_own_rows_only(study):
    found = _status(study("Moves", "Cancelled", "Generator", "Interrupts", "Peeks", "hold"))
    assert found["Moves"] == found["Peeks"] == found["hold"] == ({"ok"}, "")
    assert found["Cancelled"] == ({"failed"}, "fit: CancelledError: mine")
    assert found["Generator"] == ({"failed"}, "fit: GeneratorExit")
    assert found["Interrupts"] == ({"failed"}, "fit or prediction: KeyboardInterrupt")


@pytest.mark.long
@pytest.mark.skipif(sys.platform != "linux", reason="only Linux gives orphans to the process that asks for them")
def test_processes_that_a_model_leaves_behind_end_with_it(study):
    found = _status(study("Orphans", "OrphansAndCrashes"))
    assert found["Orphans"][0] == {"ok"}
    assert "SIGSEGV" in found["OrphansAndCrashes"][1]
    found = _status(study("OrphansAndHangs", resume=True, execution=Execution(limits=Limits(seconds=3))))
    assert "time limit of 3 s" in found["OrphansAndHangs"][1]
    left = [p for p in psutil.process_iter(["cmdline"]) if "# orphan of a test" in str(p.info["cmdline"])]
    assert not left


def test_a_link_that_a_model_saves_is_not_followed(study):
    outcome = study("Links")
    assert not list((outcome.out / "cells").rglob("passwd"))


HELPED = """
import numpy as np
import helpers
from parts import sizes

class Scaled:
    def fit(self, train, valid=None, *, seed=0):
        return self
    def predict(self, s0, U, history=None):
        from late import SHIFT
        return np.repeat(s0[:, None], U.shape[1], axis=1) * helpers.GAIN + sizes.SIZE + SHIFT
"""


@pytest.fixture
def helped(study, tmp_path):
    """The study with a model of several files, in a folder of its own."""
    folder = tmp_path / "mine"
    (folder / "parts").mkdir(parents=True)
    files = {
        "model.py": HELPED,
        "helpers.py": "GAIN = 1.0",
        "parts/__init__.py": "",
        "parts/sizes.py": "SIZE = 0.0",
        "late.py": "SHIFT = 0.0",
    }
    for name, text in files.items():
        (folder / name).write_text(text)

    def run(**options):
        (tmp_path / "models.py").write_text(MODELS)
        data = next(p.parent.name for p in tmp_path.glob("*/dataset.toml"))
        task = make_task(
            {"dataset": data, "models": ["mine/model.py:Scaled"], "horizon_s": 20, "folds": 2, "valid_runs": 1}
        )
        return run_tasks([task], "out", **options)

    return run, folder


@pytest.mark.long
@pytest.mark.parametrize("change", ["helpers.py:GAIN = 1.5", "parts/sizes.py:SIZE = 5.0", "late.py:SHIFT = 7.0"])
def test_resume_runs_again_where_a_module_of_the_model_changed(helped, change):
    run, folder = helped
    first = run().rows
    assert set(first["status"]) == {"ok"}
    kept = run(resume=True).rows
    pd.testing.assert_frame_equal(first, kept)  # times and all: nothing was run again
    name, _, text = change.partition(":")
    (folder / name).write_text(text)
    resumed, anew = run(resume=True).rows["ed"].to_numpy(), run().rows["ed"].to_numpy()
    np.testing.assert_array_equal(resumed, anew)
    assert not np.allclose(resumed, first["ed"])


def test_code_that_the_key_does_not_cover_is_told_and_run_again(helped):
    run, folder = helped
    (folder / "model.py").write_text(
        HELPED.replace("from late import SHIFT", "import importlib; SHIFT = importlib.import_module('late').SHIFT")
    )
    outcome = run()
    summary = read_summary(outcome.out, Cell(*(outcome.summaries[0][k] for k in ("dataset", "model", "fold", "seed"))))
    assert summary["key"] == ""
    assert "late.py" in summary["key_note"]
    assert "--resume cannot tell" in summary["key_note"]
    (folder / "late.py").write_text("SHIFT = 7.0")
    assert not np.allclose(run(resume=True).rows["ed"], outcome.rows["ed"])


@pytest.mark.long
@pytest.mark.parametrize("when", ["import", "predict"])
def test_a_data_file_that_a_model_reads_is_told_and_its_change_is_seen(helped, when):
    run, folder = helped
    read = "(Path(__file__).parent / 'gain.txt').read_text()"
    text = HELPED.replace("from late import SHIFT", f"SHIFT = float({'TEXT' if when == 'import' else read})")
    (folder / "model.py").write_text(f"from pathlib import Path\nTEXT = {read}\n{text}")
    (folder / "gain.txt").write_text("0.0")
    outcome = run()
    summary = read_summary(outcome.out, Cell(*(outcome.summaries[0][k] for k in ("dataset", "model", "fold", "seed"))))
    assert summary["key"] == ""
    assert "gain.txt" in summary["key_note"]
    (folder / "gain.txt").write_text("7.0")
    assert not np.allclose(run(resume=True).rows["ed"], outcome.rows["ed"])


@pytest.mark.parametrize("raised", ["KeyboardInterrupt", "GeneratorExit", "SystemExit(0)"])
def test_a_model_that_cannot_be_made_is_one_message_whatever_it_raises(study, raised, capfd):
    Path("models.py").write_text(f"class Plain:\n    def __init__(self):\n        raise {raised}\n")
    with pytest.raises(
        InputError, match=rf"models.py:Plain' cannot be made: {raised.partition('(')[0]}: ?\d?\. Correct its file"
    ):
        study("Plain")
    assert "Traceback" not in capfd.readouterr().err


def test_a_model_that_empties_the_import_path_or_raises_in_del_keeps_its_rows(study, capfd):
    Path("models.py").write_text(
        MODELS + "class Empties(Plain):\n    def fit(self, *a, **k):\n        sys.path.clear()\n        return self\n"
        "    def __del__(self):\n        raise BaseException('mine')\n"
    )
    assert set(study("Empties").rows["status"]) == {"ok"}
    assert "Traceback" not in capfd.readouterr().err


def test_a_process_that_cannot_answer_is_one_message(study):
    Path("models.py").write_text("import os; os._exit(3)")
    with pytest.raises(InputError, match=r"models.py:Plain' cannot be made: its process ended with exit code 3"):
        study("Plain")
