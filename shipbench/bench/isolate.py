"""Job in a process of its own, which can be killed. Where a model hangs, exhausts the memory or crashes, only the cells
of its job fail.

The process is a plain `python -c`, not one of `multiprocessing`: workers of Dask are daemons, which may not have such
children, and a user's script needs no `if __name__ == "__main__"`.
"""

from __future__ import annotations

import math
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from . import supervise
from .work import Answer, FoldData, Job, work

THREADS = ("OMP_NUM_THREADS", "MKL_NUM_THREADS", "OPENBLAS_NUM_THREADS")
"""Environment variables of thread counts. Sums in another number of threads round differently: the study's settings go
with its jobs."""

_LOOK_EVERY = 0.1
"""Time between two readings of the memory [s]. A model may exceed its limit by the memory it fills meanwhile, about 0.2
GB."""

_running: set[subprocess.Popen[bytes]] = set()


@dataclass(frozen=True)
class Limits:
    """Most time [s] and memory [GB, 1e9 bytes] of one cell, or None; cells that are fitted together share the sum of
    their times."""

    seconds: float | None = None
    memory_gb: float | None = None

    def __bool__(self) -> bool:
        return self.seconds is not None or self.memory_gb is not None


def thread_settings() -> dict[str, str]:
    """Settings of `THREADS` in this environment."""
    return {name: os.environ[name] for name in THREADS if name in os.environ}


def work_isolated(
    job: Job,
    folds: Sequence[FoldData],
    limits: Limits,
    threads: Mapping[str, str],
    stopped: threading.Event | None = None,
) -> list[Answer]:
    """Run `work` in a process of its own; where it does not answer, each of its cells fails with the reason."""
    answers, reason = call_isolated(_work_on, (job, *folds), limits, threads, cells=len(folds), stopped=stopped)
    return [Answer("failed", f"fit or prediction: {reason}") for _ in folds] if reason else answers


def _work_on(job: Job, *folds: FoldData) -> list[Answer]:
    try:
        return work(job, folds)
    except KeyboardInterrupt:  # nobody presses Ctrl-C here: the model raised it
        return [Answer("failed", "fit or prediction: KeyboardInterrupt") for _ in folds]


def call_isolated(
    function: Callable[..., Any],
    parts: Sequence[Any],
    limits: Limits | None = None,
    threads: Mapping[str, str] | None = None,
    cells: int = 1,
    stopped: threading.Event | None = None,
) -> tuple[Any, str]:
    """Result of `function(*parts)` in a process of its own, or None and the reason why there is none.

    All processes that it started end with it. The parts are sent separately: objects shared by two of them are copied.
    `stopped` is set before `stop_all`: a process that another thread starts at that moment is ended too.
    """
    limits, threads = limits or Limits(), thread_settings() if threads is None else threads
    alive, held = os.pipe()
    with tempfile.TemporaryDirectory(prefix="shipbench-") as scratch:
        environment = {name: value for name, value in os.environ.items() if name not in THREADS}
        environment |= {**threads, "PYTHONPATH": os.pathsep.join(filter(None, sys.path)), "TMPDIR": scratch}
        try:
            process = subprocess.Popen(
                [sys.executable, "-P", "-c", f"from {supervise.__name__} import main; main({alive})"],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, pass_fds=[alive], start_new_session=True,
                env=environment,
            )  # fmt: skip
        except OSError as error:
            os.close(alive)
            os.close(held)
            return None, f"no process of its own can be started: {error.strerror}"
        _running.add(process)
        try:
            if stopped is not None and stopped.is_set():
                return None, "the study was stopped"
            question = b"".join(pickle.dumps(part) for part in ((function, len(parts)), *parts))
            answer, reason = _attend(process, question, limits, cells)
            return (None, reason) if reason else (pickle.loads(answer), "")
        finally:
            _kill(process)
            _running.discard(process)
            os.close(alive)
            os.close(held)


def stop_all() -> None:
    """Kill every process of `work_isolated` that still runs (the study ends early)."""
    for process in list(_running):
        _kill(process)


def _attend(process: subprocess.Popen[bytes], question: bytes, limits: Limits, cells: int) -> tuple[bytes, str]:
    """Answer of the process, or the reason why there is none: wait until it ends or exceeds a limit."""
    ended, exceeded = threading.Event(), list[str]()
    watch = threading.Thread(target=_watch, args=(process, limits, cells, ended, exceeded))
    watch.start()
    try:
        answer, _ = process.communicate(question)
    finally:
        ended.set()
        watch.join()
    return answer, "" if process.returncode == 0 and answer else (exceeded or [_ending(process.returncode)])[0]


def _watch(
    process: subprocess.Popen[bytes], limits: Limits, cells: int, ended: threading.Event, exceeded: list[str]
) -> None:
    """Kill the process when it exceeds a limit, and record which."""
    end = math.inf if limits.seconds is None else time.monotonic() + limits.seconds * cells
    look_every = math.inf if limits.memory_gb is None else _LOOK_EVERY
    while not ended.wait(min(end - time.monotonic(), look_every, threading.TIMEOUT_MAX)):
        if time.monotonic() >= end:
            shared = f" for each of {cells} cells that are fitted together" if cells > 1 else ""
            exceeded.append(f"stopped at the time limit of {limits.seconds:g} s{shared}")
        elif limits.memory_gb is not None and (used := _memory_gb(process.pid)) > limits.memory_gb:
            exceeded.append(f"stopped at {used:.2f} GB of memory; the limit is {limits.memory_gb:g} GB")
        if exceeded:
            _end_group(process)
            return


def _memory_gb(pid: int) -> float:
    """Resident memory of a process and all that it started."""
    import psutil

    total = 0
    try:
        first = psutil.Process(pid)
        for process in (first, *first.children(recursive=True)):
            total += process.memory_info().rss
    except psutil.NoSuchProcess:
        pass  # one of them has just ended
    return total / 1e9


def _ending(code: int) -> str:
    if code == -signal.SIGKILL:
        return "its process was killed from outside (by the system where memory runs out)"
    how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
    return f"its process ended {how} before it answered"


def _end_group(process: subprocess.Popen[bytes]) -> None:
    """Ask the process to end all that it started, and itself; kill it where it does not within two seconds."""
    with suppress(ProcessLookupError):
        process.terminate()
    try:
        process.wait(2.0)
    except subprocess.TimeoutExpired:
        process.kill()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill the process and all that it started."""
    _end_group(process)
    process.wait()
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()
