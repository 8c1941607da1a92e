"""A real Dask cluster on loopback: the same table as the local one, also where a worker is killed; clear messages where
it is not there."""

from __future__ import annotations

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import pytest
from typer.testing import CliRunner

from shipbench.bench import executors
from shipbench.cli.app import app

pytest.importorskip("distributed", reason="needs shipbench[dask]")

MODELS = """
import time
import numpy as np

class Drawn:
    def fit(self, train, valid=None, *, seed=0):
        time.sleep(0.3)
        drawn = np.random.default_rng(seed).normal() + np.random.normal()
        self.bias = drawn + sum(r.states.sum() for r in train.runs) * 1e-9
        return self
    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1], axis=1) + self.bias

class Together(Drawn):
    @classmethod
    def fit_group(cls, models, trains, valids, seeds):
        for m, t in zip(models, trains):
            m.bias = len(models) + np.random.normal() + t.runs[0].states.sum() * 1e-9

class Raises(Drawn):
    def fit(self, train, valid=None, *, seed=0):
        raise ValueError("as it always does")
"""

LOCAL = """
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task
run_tasks([make_task(dict(dataset="toyset", models={models}, horizon_s=20, folds=2, seeds={seeds}))], "here")
"""


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def environment(**more: str) -> dict[str, str]:
    path = os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, sys.path)])
    return {**os.environ, "PYTHONPATH": path, **more}


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """A scheduler and two workers of one thread; the workers stand in another folder, with another number of threads
    and no data."""
    address, elsewhere, processes = f"tcp://127.0.0.1:{free_port()}", tmp_path_factory.mktemp("elsewhere"), []

    def start(*arguments: str) -> None:
        command = [sys.executable, "-m", f"distributed.cli.{arguments[0]}", *arguments[1:], "--no-dashboard"]
        env = environment(OMP_NUM_THREADS="2", SHIPBENCH_CACHE=str(elsewhere / "no cache"))
        log = (elsewhere / f"{len(processes)}.log").open("w")
        processes.append(
            subprocess.Popen(
                command, cwd=elsewhere, env=env, stdout=log, stderr=subprocess.STDOUT, start_new_session=True
            )
        )
        log.close()

    start("dask_scheduler", "--host", "127.0.0.1", "--port", address.rpartition(":")[2])
    for _ in range(2):
        start("dask_worker", address, "--nthreads", "1", "--no-nanny", "--local-directory", str(elsewhere))
    end = time.monotonic() + 60
    while sum("Starting established connection" in log.read_text() for log in elsewhere.glob("[12].log")) < 2:
        assert time.monotonic() < end, "the workers did not reach the scheduler"
        time.sleep(0.1)
    yield address, processes
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture
def command(tmp_path, toy_folder):
    """Starts `shipbench run` in `tmp_path` with relative paths of model and data."""
    (tmp_path / "models.py").write_text(MODELS)
    toy_folder(runs=6)

    def start(*options: str) -> subprocess.Popen[str]:
        arguments = ["run", "-d", "toyset", "--horizon", "20", "--folds", "2", *options]
        # a full terminal has no room for this: both streams go into one pipe, which is read at the end
        return subprocess.Popen(
            [sys.executable, "-m", "shipbench", *arguments], cwd=tmp_path, env=environment(OMP_NUM_THREADS="1"),
            stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip

    return start


@pytest.mark.long
def test_a_worker_killed_mid_run_changes_nothing_in_the_table(cluster, command, tmp_path):
    address, processes = cluster
    models = [
        "-m",
        "models.py:Drawn",
        "-m",
        "models.py:Together",
        "-m",
        "hold",
        "-m",
        "models.py:Raises",
        "--seeds",
        "0,1,2",
    ]
    dask = ["--executor", "dask", "--scheduler", address]
    study, end = command(*models, *dask, "-o", "there"), time.monotonic() + 60
    while len(list(tmp_path.glob("there/cells/toyset/models*/fold*"))) < 3:
        assert time.monotonic() < end
        assert study.poll() is None, study.communicate()[0]
        time.sleep(0.02)
    processes[2].send_signal(signal.SIGKILL)
    said, _ = study.communicate(timeout=100)
    assert study.returncode == 1, said  # the model that raises
    assert f"17 jobs sent to {address}, 2 workers now" in said
    assert "[20/20]" in said
    local = subprocess.run(
        [sys.executable, "-c", LOCAL.format(models=models[1:-2:2], seeds=[0, 1, 2])],
        cwd=tmp_path, env=environment(OMP_NUM_THREADS="1"), capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert local.returncode == 0, local.stderr
    tables = [
        pd.read_parquet(tmp_path / out / "rows.parquet").drop(columns=["fit_s", "predict_s"])
        for out in ("there", "here")
    ]
    pd.testing.assert_frame_equal(*tables, check_exact=True)
    statuses = tables[0].groupby("model")["status"].first()
    assert statuses["models.py:Raises"] == "failed"
    assert statuses["models.py:Drawn"] == "ok"
    saved = [
        sorted(p.relative_to(tmp_path / out) for p in (tmp_path / out / "cells").rglob("*"))
        for out in ("there", "here")
    ]
    assert saved[0] == saved[1]


def test_workers_with_other_code_are_refused(cluster, command, tmp_path):
    package = Path(__file__).parents[2] / "shipbench"
    shutil.copytree(package, tmp_path / "other" / "shipbench", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "other" / "shipbench" / "edited.py").write_text("")
    study = subprocess.run(
        [sys.executable, "-P", "-m", "shipbench", "run", "-m", "hold", "-d", "toyset", "--horizon", "20", "--folds",
            "2", "--executor", "dask",
         "--scheduler", cluster[0], "-q"],
        cwd=tmp_path, env={**os.environ, "PYTHONPATH": str(tmp_path / "other")}, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    assert study.returncode == 2, study.stderr
    assert study.stderr.startswith("error: the Dask worker on ")
    assert "has other code of shipbench" in study.stderr
    assert study.stderr.count("\n") == 1


@pytest.mark.parametrize(
    "address", [f"tcp://127.0.0.1:{free_port()}", "nonsense", "foo://host:1"], ids=["nobody", "nonsense", "foo"]
)
def test_a_scheduler_that_is_not_there_is_told_within_seconds(toy_folder, tmp_path, monkeypatch, address):
    toy_folder(runs=6)
    monkeypatch.chdir(tmp_path)
    assert executors.CONNECT_S < 10
    monkeypatch.setattr(executors, "CONNECT_S", 1.0)
    done = CliRunner().invoke(
        app, ["run", "-m", "hold", "-d", "toyset", "--horizon", "20", "--executor", "dask", "--scheduler", address]
    )
    assert done.exit_code == 2
    assert done.output.startswith(f"error: no Dask scheduler answers at {address} (")
    assert done.output.count("\n") == 1


def test_a_missing_package_is_told_with_what_to_install(monkeypatch):
    from shipbench.bench.executors import Execution, open_workers
    from shipbench.errors import InputError

    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(
        InputError, match=r"needs distributed, which is not installed\. Install it: pip install 'shipbench\[dask\]'"
    ):
        open_workers(Execution("dask", scheduler="tcp://127.0.0.1:1")).__enter__()


def test_a_job_that_kills_its_workers_fails_alone_and_lost_workers_stop_the_study():
    from concurrent.futures import Future

    from distributed import KilledWorker

    from shipbench.bench.executors import answers_of
    from shipbench.errors import InputError, WorkError

    def ended(error: BaseException) -> Future:
        future: Future = Future()
        future.set_exception(error)
        return future

    answers = answers_of(ended(KilledWorker("job", None, 3)), cells=2)
    assert [a.status for a in answers] == ["failed", "failed"]
    assert "all Dask workers that took it died" in answers[0].reason
    with pytest.raises(InputError, match="other code"):
        answers_of(ended(InputError("other code")), cells=2)
    lost: Future = Future()
    lost.cancel()
    with pytest.raises(WorkError, match=r"connection to the Dask scheduler is lost.*--resume"):
        answers_of(lost, cells=2)
    with pytest.raises(WorkError, match=r"cannot do their work: ModuleNotFoundError: no shipbench.*--resume"):
        answers_of(ended(ModuleNotFoundError("no shipbench")), cells=2)
