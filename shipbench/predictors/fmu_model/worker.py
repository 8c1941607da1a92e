"""Worker process of an FMU: simulates the runs that its parent sends, and ends with it.

The FMU prints to nowhere. The parent reads the simulated time in shared memory, so that it can say where a crash or a
hang occurred.
"""

from __future__ import annotations

import os
import threading
import time
from multiprocessing.connection import Connection
from typing import Any

PROGRESS_BYTES = 8
"""Bytes of the shared memory: the simulated time [s]."""
_SEND_EVERY = 0.05
"""Longest time [s] that answers are kept back, so that short runs are sent together."""


def main(connection: int, alive: int, progress: int) -> None:
    """Answer questions until the parent ends.

    Args:
        connection: descriptor of the connection.
        alive: reading end of a pipe that ends with the parent.
        progress: descriptor of a file of `PROGRESS_BYTES`.
    """
    threading.Thread(target=_end_with, args=(alive,), daemon=True).start()
    import mmap

    import numpy as np

    at = np.frombuffer(mmap.mmap(progress, PROGRESS_BYTES), dtype=float)
    _answer(Connection(connection), at)


def _end_with(alive: int) -> None:
    os.read(alive, 1)
    os._exit(0)


def _answer(connection: Connection, at: Any) -> None:
    """Open the FMU of the first question, then simulate: questions are ("data", values (runs, ...), inputs by run) or
    ("run", [(place, run, values)])."""
    from .instance import Failed, instance_of
    from .plan import Answer

    try:
        instance = instance_of(connection.recv(), at)
    except Failed as error:
        connection.send(f"{error}")
        return
    except Exception as error:  # FMPy and the loader of the system raise anything
        connection.send(f"it cannot be loaded: {type(error).__name__}: {' '.join(str(error).split())[:300]}")
        return
    connection.send("")
    inputs: list[Any] = []
    checked = False
    while True:
        try:
            kind, content = connection.recv()
        except EOFError:
            os._exit(0)
        if kind == "data":
            inputs = content
            continue
        answers, sent, left = list[Answer](), time.monotonic(), len(content)
        for place, run, values in content:
            found, reason = instance.run(values, inputs[run])
            if not checked and not reason:
                checked = True
                again, _ = instance.run(values, inputs[run])
                instance.remake = not (again == found).all()
            answers.append(Answer(place, found, reason))
            if len(answers) == left or time.monotonic() - sent > _SEND_EVERY:
                connection.send(answers)
                left -= len(answers)
                answers, sent = [], time.monotonic()
