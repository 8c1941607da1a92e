"""Executors: the same numbers wherever a cell runs; a model that hangs, eats memory or crashes fails alone."""

from __future__ import annotations

import dataclasses
import time

import numpy as np
import pandas as pd
import psutil
import pytest
from every_day import every

from shipbench.bench.executors import Execution
from shipbench.bench.isolate import Limits
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
from shipbench.errors import InputError, WorkError

MODELS = '''
import ctypes, os, random, sys, time
from pathlib import Path
import numpy as np

class Good:
    """Writes into its data, prints, draws from global generators."""
    def fit(self, train, valid=None, *, seed=0):
        print("a model may print")
        self.bias = np.random.normal() + random.random() + sum(r.states.sum() for r in train.runs) * 1e-9
        for r in train.runs:
            r.states[:] = 0.0
        return self
    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1], axis=1) + self.bias

class Together(Good):
    @classmethod
    def fit_group(cls, models, trains, valids, seeds):
        for m, t in zip(models, trains):
            m.bias = len(models) + np.random.normal() + t.runs[0].states.sum() * 1e-6

class OneOfGroup(Good):
    @classmethod
    def fit_group(cls, models, trains, valids, seeds):
        raise KeyError("one of them")
    def fit(self, train, valid=None, *, seed=0):
        if any(r.id.startswith("r00") for r in train.runs):
            raise ValueError("r00 is odd")
        return super().fit(train, valid, seed=seed)

class Hangs(Good):
    def fit(self, train, valid=None, *, seed=0):
        time.sleep(600)

class Eats(Good):
    def fit(self, train, valid=None, *, seed=0):
        self.eaten = []
        while True:
            self.eaten.append(np.ones(2_000_000))
            time.sleep(0.01)

class Crashes(Good):
    def fit(self, train, valid=None, *, seed=0):
        ctypes.string_at(0)

class Leaves(Good):
    def fit(self, train, valid=None, *, seed=0):
        os._exit(0)

class Exits(Good):
    def predict(self, s0, U, history=None):
        sys.exit("enough")

class SkipFails(Good):
    def skip(self, dataset):
        raise OSError("no such library")

class NaN(Good):
    def predict(self, s0, U, history=None):
        return np.full((*U.shape[:2], 10), np.nan)

class Edits(Good):
    def fit(self, train, valid=None, *, seed=0):
        with open(__file__, "a") as f:
            f.write("# edited\\n")
        return super().fit(train, valid, seed=seed)
'''


@pytest.fixture
def study(toy_folder, tmp_path):
    """Runs models of the file above, or by name, on the toy ship's folder."""
    data, file = toy_folder(runs=6), tmp_path / "models.py"
    file.write_text(MODELS)

    def run(*models, execution=None, out="out", **task):
        specs = [f"{file}:{m}" if m[0].isupper() else m for m in models]
        settings = {"dataset": str(data), "models": specs, "horizon_s": 20, "folds": 2, "valid_runs": 1, **task}
        return run_tasks([make_task(settings)], tmp_path / out, execution=execution)

    return run


def scores(outcome):
    return outcome.rows.drop(columns=["fit_s", "predict_s"])


@pytest.mark.long
def test_processes_give_the_numbers_of_this_process_bit_for_bit(study, capfd):
    models = ("hold", "Good", "Together", "mlp[epochs=2,seed=1]")
    here = study(*models, seeds=[0, 3])
    there = study(*models, seeds=[0, 3], execution=Execution("processes", workers=2), out="there")
    pd.testing.assert_frame_equal(scores(here), scores(there), check_exact=True)
    assert (here.rows["status"] == "ok").mean() > 0.7
    for a, b in zip(here.summaries, there.summaries, strict=True):
        assert (a["key"], a["params"], a["fit_shared_by"]) == (b["key"], b["params"], b["fit_shared_by"])
    saved = [sorted(p.relative_to(o.out) for p in o.out.rglob("cells/**/*") if p.is_file()) for o in (here, there)]
    assert saved[0] == saved[1]
    assert any(p.name == "arrays.npz" for p in saved[0])


def test_what_a_model_does_to_its_data_and_to_global_generators_stays_its_own(study):
    alone = scores(study("Together"))
    after = scores(study("Good", "Together", out="after"))
    pd.testing.assert_frame_equal(
        alone, after[after["model"].isin(alone["model"])].reset_index(drop=True), check_exact=True
    )


@pytest.mark.parametrize("executor", every(2, ["local", "processes"]))
def test_models_get_one_memory_layout_wherever_the_data_come_from(toy, tmp_path, monkeypatch, executor):
    (tmp_path / "layout.py").write_text(
        "class Tells:\n"
        "    def fit(self, train, valid=None, *, seed=0):\n"
        "        raise ValueError([(r.states.strides, r.inputs.strides) for d in (train, valid) for r in d.runs])\n"
    )
    told = set()
    for order in (np.ascontiguousarray, np.asfortranarray):  # as made by a simulator, as read from files
        data = toy(runs=6, steps=20)
        data = data.with_runs(dataclasses.replace(r, states=order(r.states), inputs=order(r.inputs)) for r in data.runs)
        monkeypatch.setattr("shipbench.bench.runner.load_dataset", lambda _, data=data: data)
        task = make_task(
            {"dataset": "toy", "models": [f"{tmp_path}/layout.py:Tells"], "horizon_s": 20, "folds": 2, "max_runs": 4}
        )
        told |= set(run_tasks([task], tmp_path / "out", execution=Execution(executor)).rows["reason"])
    assert len(told) == 1


@pytest.mark.long
def test_a_model_that_hangs_eats_memory_or_crashes_fails_alone(study):
    limits = Limits(seconds=20, memory_gb=0.4)  # a process takes seconds to start where six start at once
    faulty = {
        "Hangs": "stopped at the time limit of 20 s",
        "Eats": "GB of memory; the limit is 0.4 GB",
        "Crashes": "its process ended by SIGSEGV before it answered",
        "Leaves": "its process ended with exit code 0 before it answered",
        "Exits": "predict: SystemExit: enough",
        "SkipFails": "OSError: no such library",
    }
    began = time.monotonic()
    outcome = study(*faulty, "Good", "NaN", "hold", execution=Execution("processes", workers=6, limits=limits))
    assert time.monotonic() - began < 120
    rows = outcome.rows.assign(name=outcome.rows["model"].str.rpartition(":")[2])
    for name, reason in faulty.items():
        part = rows[rows["name"] == name]
        assert set(part["status"]) == {"failed"}, name
        assert part["reason"].str.contains(reason).all(), part["reason"].iloc[0]
    assert set(rows[rows["name"].isin(["Good", "hold"])]["status"]) == {"ok"}
    assert set(rows[rows["name"] == "NaN"]["status"]) == {"diverged"}
    assert len(outcome.failed) == 2 * len(faulty)


def test_in_this_process_too_an_exit_or_a_failing_skip_is_only_a_failed_row(study):
    rows = study("Exits", "SkipFails", "hold").rows
    assert rows.groupby("model", sort=False)["status"].first().tolist() == ["failed", "failed", "ok"]


@pytest.mark.long
def test_limits_put_a_local_study_into_child_processes(study):
    outcome = study("Hangs", "hold", execution=Execution(limits=Limits(seconds=2.5)))
    assert outcome.rows.groupby("model", sort=False)["status"].first().tolist() == ["failed", "ok"]


def test_a_group_that_cannot_be_fitted_together_is_fitted_one_by_one(study):
    rows = study("OneOfGroup", valid_runs=0).rows
    assert sorted(rows.groupby("fold")["status"].first()) == ["failed", "ok"]
    assert set(rows.loc[rows["status"] == "failed", "reason"]) == {"fit: ValueError: r00 is odd"}
    assert set(rows["fit_shared_by"]) == {1}


def test_a_model_file_that_changes_under_the_study_stops_it(study):
    with pytest.raises(WorkError, match=r"models.py was changed while the study ran.*--resume"):
        study("hold", "Edits")


def test_children_get_the_thread_settings_of_the_study(study, tmp_path, monkeypatch):
    (tmp_path / "threads.py").write_text(
        "import os, numpy as np\nclass Tells:\n    def fit(self, train, valid=None, *, seed=0): raise "
        "ValueError(os.environ.get('OMP_NUM_THREADS'))\n"
    )
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    rows = study(f"{tmp_path}/threads.py:Tells", execution=Execution("processes", workers=2)).rows
    assert set(rows["reason"]) == {"fit: ValueError: 7"}


def test_no_process_and_no_temporary_folder_is_left(study, tmp_path, monkeypatch):
    scratch = tmp_path / "scratch"
    scratch.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(scratch))
    before = set(psutil.Process().children(recursive=True))  # of other tests
    study("Hangs", "Good", execution=Execution("processes", workers=2, limits=Limits(seconds=2.5)))
    assert list(scratch.iterdir()) == []
    assert (
        set(psutil.Process().children(recursive=True)) <= before
    )  # neither running nor ended without being waited for


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"executor": "slurm"}, "--executor slurm: unknown. Accepted: local, processes, dask"),
        ({"executor": "dask"}, "needs --scheduler"),
        ({"scheduler": "tcp://a:1"}, "belongs to --executor dask"),
        ({"workers": 3}, "give --executor processes"),
        ({"executor": "processes", "workers": 0}, "accepted: 1 or more"),
        ({"limits": Limits(seconds=0)}, "--time-limit 0; accepted: more than 0"),
        ({"limits": Limits(memory_gb=float("nan"))}, "--memory-limit nan; accepted: more than 0"),
    ],
)
def test_options_that_cannot_be_are_refused(options, message):
    with pytest.raises(InputError, match=message.replace("(", r"\(")):
        Execution(**options)
