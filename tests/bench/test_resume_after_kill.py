"""`--resume` after `kill -9` at any moment: the same table, bit for bit but for times."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pandas as pd
import psutil
import pytest
from every_day import every

from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task

MODELS = '''
import time
import numpy as np

class Drawn:
    def fit(self, train, valid=None, *, seed=0):
        time.sleep(PAUSE)
        self.bias = np.random.default_rng(seed).normal() + len(train)
        return self
    def predict(self, s0, U, history=None):
        return np.repeat(s0[:, None], U.shape[1], axis=1) + self.bias
    def describe(self):
        return f"bias = {self.bias}"

class Together(Drawn):
    """As stacked networks do, its numbers depend on who is fitted beside it."""
    @classmethod
    def fit_group(cls, models, trains, valids, seeds):
        time.sleep(PAUSE)
        for m, s in zip(models, seeds):
            m.bias = s + 1.0 / len(models)
'''

TRAINED = '''
"""As a network that Lightning trains: it makes a SystemExit of Ctrl-C, and puts SIGTERM off until a batch has ended."""
import time
import lightning
import torch

class Net(lightning.LightningModule):
    automatic_optimization = False
    def training_step(self, batch, index):
        open("training", "a").write("x")
        time.sleep(20)
    def configure_optimizers(self):
        return torch.optim.SGD([torch.nn.Parameter(torch.zeros(1))], lr=1.0)

class Trained:
    def fit(self, train, valid=None, *, seed=0):
        lightning.Trainer(accelerator="cpu", max_epochs=1, barebones=True).fit(Net(), [0, 1])
        return self
    def predict(self, s0, U, history=None):
        raise NotImplementedError
'''

KILLED_AT_EVERY_STEP = '''
"""Forks a study that kills itself at its n-th step on the file system, then one that resumes; for every n given."""
import os, signal, sys
from pathlib import Path
import pandas as pd
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task

folder, data, first, every = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3]), int(sys.argv[4])
models = [f"{folder}/models.py:Drawn", f"{folder}/models.py:Together"]
task = make_task({"dataset": data, "models": models, "horizon_s": 20, "folds": 2, "valid_runs": 1})
STEPS = {"open", "os.rename", "os.mkdir", "os.rmdir", "os.remove", "shutil.rmtree"}

def forked(function, *arguments):
    """Exit status of the function in a process of its own: nothing that one study leaves in memory reaches the next."""
    pid = os.fork()
    if pid == 0:
        try:
            function(*arguments)
        except BaseException:
            import traceback
            traceback.print_exc()
            os._exit(1)
        os._exit(0)
    return os.waitpid(pid, 0)[1]

def study(out, resume=False, kill_at=None):
    left = kill_at
    def hook(event, arguments):
        nonlocal left
        if kill_at is not None and event in STEPS and str(out) in str(arguments[:2]):
            left -= 1
            if left <= 0:
                os.kill(os.getpid(), signal.SIGKILL)
    sys.addaudithook(hook)
    return run_tasks([task], out, resume=resume)

def resume(out):
    rows = study(out, resume=True).rows
    whole = pd.read_parquet(folder / "whole" / "rows.parquet").drop(columns=TIMES)
    for table in (rows, pd.read_parquet(out / "rows.parquet")):
        pd.testing.assert_frame_equal(table.drop(columns=TIMES), whole, check_exact=True)
    assert not list(out.rglob("*.tmp*")), "leftovers"

TIMES = ["fit_s", "predict_s"]
assert forked(study, folder / "whole") == 0
moment, killed = first, True
while killed:
    for older in (False, True):  # into an empty folder, and over the results of an older study
        out = folder / f"killed-{moment}-{older}"
        if older:
            assert forked(study, out) == 0
        status = forked(study, out, False, moment)
        killed = os.WIFSIGNALED(status)
        assert killed or status == 0, f"step {moment}: status {status}"
        assert forked(resume, out) == 0, f"not the same table after step {moment}, over older results: {older}"
    moment += every
print(moment)
'''


@pytest.fixture
def folder(tmp_path, toy_folder) -> Path:
    (tmp_path / "models.py").write_text(f"PAUSE = 0.0\n{MODELS}")
    toy_folder(runs=6)
    return tmp_path


def environment() -> dict[str, str]:
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(Path(__file__).parents[2]), *filter(None, sys.path)]),
        "OMP_NUM_THREADS": "1",
    }


@pytest.mark.long
def test_a_study_killed_at_any_step_on_the_file_system_resumes_to_the_same_table(folder):
    (folder / "driver.py").write_text(KILLED_AT_EVERY_STEP)
    command = [sys.executable, "driver.py", str(folder), str(folder / "toyset"), "2", "14"]
    done = subprocess.run(command, cwd=folder, env=environment(), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert int(done.stdout) > 60  # as many steps were there to be killed at


@pytest.mark.long
def test_the_command_killed_again_and_again_resumes_to_the_same_table(folder, monkeypatch):
    (folder / "models.py").write_text(f"PAUSE = 0.2\n{MODELS}")
    options = [
        "-m",
        "models.py:Drawn",
        "-m",
        "models.py:Together",
        "-d",
        "toyset",
        "--horizon",
        "20",
        "--folds",
        "2",
        "--seeds",
        "0,1,2",
    ]

    def start(out: str, *more: str) -> subprocess.Popen[str]:
        command = [sys.executable, "-m", "shipbench", "run", *options, "-o", out, *more]
        return subprocess.Popen(
            command, cwd=folder, env=environment(), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
        )

    monkeypatch.chdir(folder)
    models = ["models.py:Drawn", "models.py:Together"]
    run_tasks(
        [make_task({"dataset": "toyset", "models": models, "horizon_s": 20, "folds": 2, "seeds": [0, 1, 2]})], "whole"
    )
    for cells, more in (
        (1, ["--executor", "processes", "--workers", "2"]),
        (5, ["--resume"]),
        (9, ["--resume", "--executor", "processes"]),
    ):
        study, end = start("killed", *more), time.monotonic() + 60
        while len(list(folder.glob("killed/cells/*/*/fold*/summary.json"))) < cells:
            assert time.monotonic() < end
            time.sleep(0.005)
        study.send_signal(signal.SIGKILL)
        assert study.wait() == -signal.SIGKILL
        study.stdout.close()
    last = start("killed", "--resume")
    said, _ = last.communicate()
    assert last.returncode == 0, said
    assert said.count("(kept)") >= 6
    tables = [
        pd.read_parquet(folder / out / "rows.parquet").drop(columns=["fit_s", "predict_s"])
        for out in ("whole", "killed")
    ]
    pd.testing.assert_frame_equal(*tables, check_exact=True)


@pytest.mark.parametrize("sent", every(3, [signal.SIGKILL, signal.SIGTERM, signal.SIGINT]))
def test_no_process_outlives_a_study_that_is_stopped(folder, sent):
    (folder / "models.py").write_text(f"PAUSE = 600\n{MODELS}")
    # tests in the background inherit that it is ignored
    command = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "
    command += (
        "from shipbench.bench import executors, runner, task; runner.run_tasks([task.make_task(TASK)], "
        "'out', execution=HOW)"
    )
    settings = {"dataset": "toyset", "models": ["models.py:Drawn"], "horizon_s": 20, "folds": 2}
    command = command.replace("TASK", repr(settings)).replace("HOW", "executors.Execution('processes', workers=2)")
    study = subprocess.Popen([sys.executable, "-c", command], cwd=folder, env=environment(), stderr=subprocess.DEVNULL)
    end, children = time.monotonic() + 60, []
    while len(children) < 2:
        assert time.monotonic() < end
        assert study.poll() is None
        children = psutil.Process(study.pid).children(recursive=True)
        time.sleep(0.02)
    time.sleep(0.5)  # they are at work
    study.send_signal(sent)
    outlived = psutil.wait_procs([*children, psutil.Process(study.pid)], timeout=10)[1]
    for process in outlived:
        process.kill()
    study.wait()
    assert outlived == []


@pytest.mark.long
@pytest.mark.parametrize("sent", [signal.SIGTERM, signal.SIGINT])
def test_a_study_is_stopped_while_lightning_trains_and_counts_no_failure(folder, sent):
    (folder / "trained.py").write_text(TRAINED)
    command = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler); "  # as above
    command += "from shipbench.cli.app import main; main()"
    options = [
        "run",
        "-m",
        "trained.py:Trained",
        "-d",
        "toyset",
        "--horizon",
        "20",
        "--folds",
        "2",
        "-o",
        "out",
        "--executor",
        "local",
    ]
    study = subprocess.Popen(
        [sys.executable, "-c", command, *options], cwd=folder, env=environment(), stderr=subprocess.PIPE, text=True
    )
    end = time.monotonic() + 120
    while not (folder / "training").exists():
        assert time.monotonic() < end
        assert study.poll() is None
        time.sleep(0.02)
    study.send_signal(sent)
    try:
        _, said = study.communicate(timeout=10)
    finally:
        study.kill()
    assert study.returncode == 130
    assert "stopped after" in said
    assert "failed" not in said
    assert (folder / "training").read_text() == "x"  # no other fold was begun
