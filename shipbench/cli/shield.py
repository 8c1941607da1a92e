"""Child process of the commands that call a model in their own process.

A model is somebody's file, or a library behind it: it may abort, crash or exit. Then the parent says so in one message.
"""

from __future__ import annotations

import os
import shlex
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from ..bench.supervise import end_with_parent
from .common import say

COMMANDS = ("check", "data", "diagnose", "export", "predict")
"""First words of those commands; `run` has a process for every job."""


@contextmanager
def in_child() -> Iterator[None]:
    """Go on in a child process. The parent waits for it and exits with its exit code, or with 1 and a message where it
    was ended within.

    Elsewhere than on Linux nothing is done: frameworks of macOS do not bear a fork, Windows has none.
    """
    if sys.platform != "linux":
        yield
        return
    reading, writing = os.pipe()
    parent, child = os.getpid(), os.fork()
    if child == 0:
        os.close(reading)
        end_with_parent(parent)
        try:
            yield
        finally:
            os.write(writing, b"1")
        return
    os.close(writing)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C reaches the child as well
    signal.signal(signal.SIGTERM, lambda *_: os.kill(child, signal.SIGTERM))
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    if not _has_ended(reading):
        how = f"by {signal.Signals(-code).name}" if code < 0 else f"with exit code {code}"
        command = shlex.join(sys.argv[1:])
        say(
            f"error: the process ended {how} before the command was done. The code of a model or simulation, or of a "
            "library that it loads, ended it. Accepted: code that returns or raises. See where: "
            f"python -X faulthandler -m shipbench {command}",
            err=True,
        )
        code = 1
    os._exit(code)


def _has_ended(reading: int) -> bool:
    """Whether the child has come to its end. A process that it has left behind may hold the pipe open."""
    os.set_blocking(reading, False)
    try:
        return bool(os.read(reading, 1))
    except BlockingIOError:
        return False
