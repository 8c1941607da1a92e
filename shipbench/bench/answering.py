"""Worker's side of `isolate`: it reads one question from a pipe and writes its answer back."""

from __future__ import annotations

import os
import pickle
import sys


def _tell_unraisable(what: sys.UnraisableHookArgs) -> None:
    """Print one line instead of a traceback for an exception in `__del__` of a model, which no row can report."""
    print(f"note: the model raised {what.exc_type.__name__} while it was removed", file=sys.stderr)


def answer() -> None:
    """Read a question from stdin and write its answer to stdout; the model's own prints go to stderr."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    sys.unraisablehook = _tell_unraisable
    function, count = pickle.load(sys.stdin.buffer)  # a pipe from our own parent, never a file
    parts = [pickle.load(sys.stdin.buffer) for _ in range(count)]
    pickle.dump(function(*parts), answers)
    answers.close()
    os._exit(0)  # without waiting for threads that a model has left behind
