"""Crew of worker processes that simulate an FMU: an FMU that crashes or hangs ends its process, never the user's."""

from __future__ import annotations

import mmap
import os
import signal
import struct
import subprocess
import sys
import tempfile
import time
import weakref
from collections import deque
from collections.abc import Sequence
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any

import numpy as np

from ...errors import WorkError
from . import worker as _worker
from .plan import Answer, Plan

_LEAST_START_S = 60.0
"""Least time [s] that an FMU has to be loaded in, beside its limit of a run: a busy machine starts Python slowly."""
_SHARES = 4
"""Parts of the work a process: it gets the next one when it has answered the last, so that none waits for long."""


class _Worker:
    """Worker process, its connection, and the time that it has simulated to."""

    def __init__(self, plan: Plan) -> None:
        self.connection, theirs = Pipe()
        alive, self._held = os.pipe()
        file = tempfile.TemporaryFile()  # noqa: SIM115 - it lives as long as the process
        file.write(bytes(_worker.PROGRESS_BYTES))
        file.flush()
        self._at = mmap.mmap(file.fileno(), _worker.PROGRESS_BYTES)
        given = (theirs.fileno(), alive, file.fileno())
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", f"from {_worker.__name__} import main; main{given}"],
            stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, pass_fds=given,
            start_new_session=True, env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
        )  # fmt: skip
        theirs.close()
        os.close(alive)
        file.close()
        self.since = time.monotonic()
        self.starting = True
        self.connection.send(plan)

    @property
    def reached(self) -> float:
        """Simulated time [s]."""
        return float(struct.unpack("d", self._at[: _worker.PROGRESS_BYTES])[0])

    def end(self) -> None:
        """Kill the process."""
        self.process.kill()
        self.process.wait()
        self.connection.close()
        if self._held >= 0:
            os.close(self._held)
            self._held = -1


def _end_all(workers: list[_Worker]) -> None:
    while workers:
        workers.pop().end()


class Crew:
    """Worker processes of one plan; they start with the first work and end with `close` or with this object.

    Args:
        plan: the FMU.
        name: of the FMU, in messages.
        limit: longest time of one run [s].
        most: number of processes, 0 for one a core.
    """

    def __init__(self, plan: Plan, name: str, limit: float, most: int = 0) -> None:
        self.plan, self.name, self.limit = plan, name, limit
        self.most = most or len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else most or 1
        self._workers: list[_Worker] = []
        self._inputs: list[np.ndarray] = []
        self._end = weakref.finalize(self, _end_all, self._workers)

    def close(self) -> None:
        """End the processes."""
        _end_all(self._workers)

    def start(self, jobs: int) -> None:
        """Start the processes that so many jobs need; they load the FMU while the caller goes on."""
        while len(self._workers) < min(self.most, jobs):
            self._workers.append(_Worker(self.plan))
            self._workers[-1].connection.send(("data", self._inputs))

    def load(self, inputs: Sequence[np.ndarray]) -> None:
        """Hold the inputs (K, inputs) of each run, in the FMU's units, for the calls of `run`."""
        self._inputs = list(inputs)
        for one in self._workers:
            one.connection.send(("data", self._inputs))

    def run(self, jobs: Sequence[tuple[int, np.ndarray]]) -> list[Answer]:
        """Simulate the jobs (run, values that are set before it) and return their answers in this order.

        Raises:
            WorkError: the FMU cannot be loaded, crashed, or exceeded the limit of a run.
        """
        try:
            return self._run(jobs)
        except BaseException:  # also Ctrl-C: answers on their way would be taken for those of the next call
            self.close()
            raise

    def _run(self, jobs: Sequence[tuple[int, np.ndarray]]) -> list[Answer]:
        self.start(len(jobs))
        size = max(1, -(-len(jobs) // (_SHARES * len(self._workers))))
        numbered = [(place, run, values) for place, (run, values) in enumerate(jobs)]
        parts = deque(numbered[i : i + size] for i in range(0, len(numbered), size))
        answers: list[Answer | None] = [None] * len(jobs)
        left = {one: 0 for one in self._workers}
        for one in self._workers:
            self._give(one, parts, left)
        while any(left.values()):
            busy = [one for one in self._workers if left[one]]
            for one in self._ready(busy):
                got = self._received(one)
                if isinstance(got, str):
                    if got:
                        raise WorkError(f"{self.name}: {got}")
                    continue
                for answer in got:
                    answers[answer.place] = answer
                left[one] -= len(got)
                if not left[one]:
                    self._give(one, parts, left)
        return [answer for answer in answers if answer is not None]

    def _give(self, one: _Worker, parts: deque[Any], left: dict[_Worker, int]) -> None:
        if parts:
            part = parts.popleft()
            left[one] = len(part)
            one.since = time.monotonic()
            one.connection.send(("run", part))

    def _ready(self, busy: list[_Worker]) -> list[_Worker]:
        """Workers with an answer, or that have ended.

        Raises:
            WorkError: one of them has given no answer for longer than the limit.
        """
        ends = {one: one.since + self._limit(one) for one in busy}
        found = wait([one.connection for one in busy], max(0.0, min(ends.values()) - time.monotonic()))
        by_connection = {one.connection: one for one in busy}
        ready = [by_connection[c] for c in found if isinstance(c, Connection)]
        for one in busy:
            if one not in ready and time.monotonic() >= ends[one]:
                raise WorkError(
                    f"{self.name} gave no answer within {self._limit(one):g} s and was stopped{self._where(one)}. "
                    f"Correct the FMU, or allow more time: {self.name}[limit={2 * self._limit(one):g}]"
                )
        return ready

    def _limit(self, one: _Worker) -> float:
        return max(self.limit, _LEAST_START_S) if one.starting else self.limit

    def _received(self, one: _Worker) -> Any:
        try:
            got = one.connection.recv()
        except (EOFError, OSError):
            one.process.wait()
            code = one.process.returncode
            how = f"crashed ({signal.Signals(-code).name})" if code < 0 else f"ended its process (exit code {code})"
            raise WorkError(f"{self.name} {how}{self._where(one)}. Correct the FMU.") from None
        one.starting, one.since = False, time.monotonic()
        return got

    def _where(self, one: _Worker) -> str:
        return " while it was loaded" if one.starting else f" at t = {one.reached:.4g} s of a run"
