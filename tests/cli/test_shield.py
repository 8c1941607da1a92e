"""Commands whose process a model's code ends."""

from __future__ import annotations

import signal
import subprocess
import sys
import time

import psutil
import pytest
from every_day import every

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only on Linux a command goes on in a child process")

MODEL = """
import os, time
def aborting(s0, U, dt): os.abort()
def leaving(s0, U, dt): os._exit(0)
def hanging(s0, U, dt): print("begun", flush=True); time.sleep(60)
"""
ENDS = {"aborting": "by SIGABRT", "leaving": "with exit code 0"}


@pytest.fixture
def command(tmp_path):
    (tmp_path / "sim.py").write_text(MODEL)

    def start(*words: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "shipbench", *words], cwd=tmp_path, text=True, stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        )  # fmt: skip

    return start


@pytest.mark.parametrize("function", every(2, ENDS))
def test_code_that_ends_the_process_is_one_message_and_exit_code_one(command, function):
    run = command("check", f"sim.py:{function}")
    out, err = run.communicate(timeout=60)
    assert (run.returncode, out) == (1, "")
    assert err.startswith(f"error: the process ended {ENDS[function]} before the command was done.")
    assert err.rstrip().endswith(f"python -X faulthandler -m shipbench check sim.py:{function}")


def test_what_the_command_says_itself_passes_through(command):
    run = command("check", "nothing")
    out, err = run.communicate(timeout=60)
    assert (run.returncode, out) == (2, "")
    assert err.startswith("error: unknown predictor 'nothing'")


@pytest.mark.parametrize("sent", every(2, [signal.SIGTERM, signal.SIGKILL]))
def test_no_process_outlives_the_command(command, sent):
    run = command("check", "sim.py:hanging")
    assert run.stderr is not None
    assert run.stderr.readline() == "begun\n"  # a model's prints go there
    children = psutil.Process(run.pid).children()
    run.send_signal(sent)
    run.wait(10)
    until = time.monotonic() + 5
    while (left := [c for c in children if _runs(c)]) and time.monotonic() < until:
        time.sleep(0.02)
    assert children
    assert not left
    for pipe in (run.stdout, run.stderr):
        pipe.close()


def _runs(process: psutil.Process) -> bool:
    return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
