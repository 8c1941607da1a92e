"""Waiting for workers: a missing condition is reported after some seconds and then every minute, with an optional time
limit."""

from __future__ import annotations

import math
import time
from collections.abc import Collection
from concurrent.futures import FIRST_COMPLETED, Future, wait
from typing import Any

from ..errors import WorkError
from .durations import duration
from .executors import Workers
from .progress import Progress

LOOK_S, FIRST_S, AGAIN_S = 1.0, 5.0, 60.0
"""Time [s] between two checks, until the first report and until the next."""


class Patience:
    """Wait for the answers of `workers`, and report to `progress` where they have been unable to work for some seconds;
    give up after `wait_s`."""

    def __init__(self, workers: Workers, progress: Progress, wait_s: float | None = None) -> None:
        self.workers, self.progress, self.limit = workers, progress, math.inf if wait_s is None else wait_s
        self.since: float | None = None
        self.next_word = 0.0

    def first_done(self, running: Collection[Future[Any]]) -> set[Future[Any]]:
        """Futures that are done, one at least.

        Raises:
            WorkError: nothing can go on for `wait_s` seconds.
        """
        while not (done := wait(running, LOOK_S, FIRST_COMPLETED).done):
            self._look(len(running))
        self.since = None
        return done

    def _look(self, jobs: int) -> None:
        missing, now = self.workers.missing(), time.monotonic()
        if not missing:
            self.since = None
            return
        if self.since is None:
            self.since, self.next_word = now, now + FIRST_S
        waited = now - self.since
        if waited >= self.limit:
            raise WorkError(
                f"gave up after {duration(waited)} (--wait {self.limit:g}): {missing}. What is finished is kept; "
                "run the same command again with "
                "--resume."
            )
        if now >= self.next_word:
            self.progress.warn(f"{missing}. Waiting for {duration(waited)} with {jobs} jobs to do.")
            self.next_word = now + AGAIN_S
