"""A pool of processes that leaves the user's script alone: it needs no `if __name__ == "__main__":`."""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, ClassVar


class _Process(SpawnProcess):
    """A process that does not run the main script again: nothing of it is needed, and it would start the same work once
    more."""

    def start(self) -> None:
        main = sys.modules["__main__"]
        sys.modules["__main__"] = ModuleType("__main__")  # without a file, there is none to run
        try:
            super().start()
        finally:
            sys.modules["__main__"] = main


class _Context(SpawnContext):
    Process: ClassVar[Any] = _Process


def process_pool(workers: int) -> ProcessPoolExecutor:
    """A pool of `workers` new processes; what is sent to it must be importable, and not from the main script."""
    return ProcessPoolExecutor(workers, mp_context=_Context())
