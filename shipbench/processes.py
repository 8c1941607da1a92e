"""Pool of processes for scripts without `if __name__ == "__main__":`."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, ClassVar

from .errors import WorkError


class _Process(SpawnProcess):
    """Process that does not run the main script again: that would start the same work once more."""

    def start(self) -> None:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")  # without a file, there is none to run
        try:
            super().start()
        finally:
            sys.modules["__main__"] = main


class _Context(SpawnContext):
    Process: ClassVar[Any] = _Process


@contextmanager
def process_pool(workers: int, advice: str) -> Iterator[ProcessPoolExecutor]:
    """Pool of `workers` new processes; functions and data sent to it must be importable, and not from the main
    script.

    Raises:
        WorkError: a process was ended before it answered; `advice` closes the message.
    """
    try:
        with ProcessPoolExecutor(workers, mp_context=_Context()) as pool:
            yield pool
    except BrokenProcessPool:
        raise WorkError(
            "a process was ended before it answered: by the system where memory runs out, or by the code of a model "
            f"or simulation. {advice}"
        ) from None
