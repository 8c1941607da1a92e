"""The worker's side of `isolate`: it takes one question from a pipe and sends its answer back."""

from __future__ import annotations

import os
import pickle
import sys


def _tell_unraisable(what: sys.UnraisableHookArgs) -> None:
    """One line instead of a traceback on what a model raises in `__del__`, where no row can say it."""
    print(f"note: the model raised {what.exc_type.__name__} while it was removed", file=sys.stderr)


def answer() -> None:
    """The worker: a question from stdin, its answer to stdout; what the model prints goes to stderr."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.unraisablehook = _tell_unraisable
    function, count = pickle.load(sys.stdin.buffer)  # a pipe from our own parent, never a file
    parts = [pickle.load(sys.stdin.buffer) for _ in range(count)]
    pickle.dump(function(*parts), answers)
    answers.close()
    os._exit(0)  # without waiting for threads that a model has left behind
