"""Parent process of a job's worker: all processes that the worker starts end with it, also those that left its session
or were orphaned.

It loads nothing but Python's library before it forks, so that it costs little and has no threads.
"""

from __future__ import annotations

import ctypes
import os
import resource
import signal
import sys
import threading
import time
from contextlib import suppress

_PR_SET_PDEATHSIG, _PR_SET_CHILD_SUBREAPER = 1, 36
"""Linux, prctl(2): a process ends with its parent; orphans below a process become its children, not those of process
1."""

_PASSES = 50
"""Most rounds of ending processes that start others meanwhile; 20 ms each."""


def main(alive: int) -> None:
    """Answer one question (`answering.answer`) in a child process, end all processes that it left, and exit with its
    exit code.

    Args:
        alive: reading end of a pipe that the study holds: it ends with the study, also by `kill -9`.
    """
    _prctl(_PR_SET_CHILD_SUBREAPER, 1)
    supervisor = os.getpid()
    worker = os.fork()
    if worker == 0:
        end_with_parent(supervisor)
        os.close(alive)
        os.setsid()  # a model that signals its own group does not reach this process
        from .answering import answer

        answer()
    os.close(0)
    os.dup2(2, 1)
    signal.signal(signal.SIGTERM, _stop)
    threading.Thread(target=_end_with_study, args=(alive,), daemon=True).start()
    _, status = os.waitpid(worker, 0)
    end_descendants()
    code = os.waitstatus_to_exitcode(status)
    if code < 0:
        resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
        signal.signal(-code, signal.SIG_DFL) if -code not in (signal.SIGKILL, signal.SIGSTOP) else None
        os.kill(os.getpid(), -code)
    os._exit(code)


def end_with_parent(parent: int) -> None:
    """Have this process killed when its parent, the process `parent`, ends."""
    _prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:  # it ended before its end was asked to be told
        os._exit(1)


def _prctl(option: int, value: int) -> None:
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(option, value, 0, 0, 0)


def end_descendants() -> None:
    """Kill all descendants of this process, until none is left."""
    import psutil

    for _ in range(_PASSES):
        below = [p for p in psutil.Process().children(recursive=True) if p.status() != psutil.STATUS_ZOMBIE]
        if not below:
            return
        for process in below:
            with suppress(psutil.NoSuchProcess):  # it has just ended
                process.kill()
        time.sleep(0.02)


def _stop(*_: object) -> None:
    end_descendants()
    os._exit(1)


def _end_with_study(alive: int) -> None:
    """Wait for the end of the study: it never writes to this pipe."""
    os.read(alive, 1)
    _stop()
