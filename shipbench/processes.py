"""Pool of processes for scripts without `if __name__ == "__main__":`."""

from __future__ import annotations

import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing.context import SpawnContext, SpawnProcess
from types import ModuleType
from typing import Any, ClassVar


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


def process_pool(workers: int) -> ProcessPoolExecutor:
    """Pool of `workers` new processes; functions and data sent to it must be importable, and not from the main
    script."""
    return ProcessPoolExecutor(workers, mp_context=_Context())
