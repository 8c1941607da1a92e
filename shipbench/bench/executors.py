"""Executors of a study's jobs: in this process, in processes of this machine, or on a Dask cluster; all behind
`concurrent.futures`."""

from __future__ import annotations

import asyncio
import logging
import math
import pickle
import platform
import threading
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import CancelledError, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from ..errors import InputError, WorkError
from ..extras import needed_by
from ..predictors.device import check_device
from ..registry import package_digest
from .isolate import Limits, stop_all, thread_settings, work_isolated
from .memory import give_back_memory
from .provenance import machine
from .work import Answer, FoldData, Job, one_line, work

NAMES = ("local", "processes", "dask")
CONNECT_S = 5.0
"""Longest time [s] to wait for a scheduler's answer."""

_MOST_WORKERS = 4096
_GO_ON = "What is finished is kept; run the same command again with --resume."


@dataclass(frozen=True)
class Execution:
    """Place where the jobs run, and limits of each.

    Args:
        executor: "local" (one after another in this process; in a child process if there are limits, or if the code of
            the model is not shipbench's), "processes" (`workers` child processes at a time) or "dask" (the workers of
            the Dask cluster at `scheduler`).
        workers: number of processes; None: one for each CPU.
        scheduler: address, such as "tcp://host:8786".
        limits: of each cell.
        device: where networks train and predict ("cpu", "cuda", "cuda:1"); None: where their specs say, else on the
            CPU.
        wait_s: give up when the Dask cluster has had no workers for so long [s]; None: wait for them.

    Raises:
        InputError: an unknown executor, an option that it lacks or does not take, or a device that is not here (with
            Dask, each worker checks it).
    """

    executor: str = "local"
    workers: int | None = None
    scheduler: str | None = None
    limits: Limits = field(default_factory=Limits)
    device: str | None = None
    wait_s: float | None = None

    def __post_init__(self) -> None:
        if self.executor not in NAMES:
            raise InputError(f"--executor {self.executor}: unknown. Accepted: {', '.join(NAMES)}.")
        if self.workers is not None and self.executor != "processes":
            hint = "its workers are those of the cluster" if self.executor == "dask" else "give --executor processes"
            raise InputError(f"--workers {self.workers} does not belong to --executor {self.executor}: {hint}.")
        if self.workers is not None and not 1 <= self.workers <= _MOST_WORKERS:
            raise InputError(f"--workers {self.workers}; accepted: 1 or more, at most {_MOST_WORKERS}.")
        if self.executor == "dask" and not self.scheduler:
            raise InputError(
                "--executor dask needs --scheduler, the address of a running Dask scheduler, such as --scheduler "
                "tcp://host:8786."
            )
        if self.executor != "dask" and self.scheduler:
            raise InputError(
                f"--scheduler {self.scheduler} belongs to --executor dask, not to --executor {self.executor}."
            )
        if self.device is not None:
            check_device(self.device, here=self.executor != "dask")
        if self.wait_s is not None and self.executor != "dask":
            raise InputError(f"--wait {self.wait_s:g} belongs to --executor dask, not to --executor {self.executor}.")
        options = (
            ("--time-limit", self.limits.seconds),
            ("--memory-limit", self.limits.memory_gb),
            ("--wait", self.wait_s),
        )
        for option, value in options:
            if value is not None and not 0 < value < math.inf:
                raise InputError(f"{option} {value:g}; accepted: more than 0, and finite.")


class Workers(ABC):
    """Workers that accept jobs. `room`: most jobs at once (None: no limit, the cluster queues them); `about`:
    description for the progress.

    `sends_files`: the workers may not see this machine's files, so that a job must carry those of the model.
    """

    def __init__(self, executor: Executor, room: int | None, about: str = "") -> None:
        self.executor, self.room, self.about, self.sends_files = executor, room, about, False

    def missing(self) -> str:
        """Condition that must be met before a job can continue, "" where none is missing."""
        return ""

    @abstractmethod
    def submit(self, job: Job, folds: Sequence[FoldData]) -> Future[list[Answer]]:
        """Start the job (or put it in the queue)."""

    def stop(self) -> None:
        """End the running jobs; none begins any more."""
        self.executor.shutdown(wait=False)
        stop_all()


class _Here(Executor):
    """Executor that runs a job at once, in this thread, so that Ctrl-C reaches it."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        try:
            future.set_result(fn(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


class _Local(Workers):
    def __init__(self) -> None:
        super().__init__(_Here(), room=1)

    def submit(self, job: Job, folds: Sequence[FoldData]) -> Future[list[Answer]]:
        if (
            job.foreign
        ):  # a stranger's code never runs beside the truth, nor in this process's folder, threads and streams
            return self.executor.submit(work_isolated, job, folds, Limits(), thread_settings())
        # Copies, as a child process gets them, each fold's apart: what a model writes into them stays its own.
        answer = self.executor.submit(work, job, [pickle.loads(pickle.dumps(fold)) for fold in folds])
        give_back_memory()
        return answer


class _Processes(Workers):
    """Workers with one child process for each job; the threads only wait for them."""

    def __init__(self, workers: int, limits: Limits) -> None:
        super().__init__(ThreadPoolExecutor(workers), room=workers)
        self.limits, self.stopped = limits, threading.Event()

    def submit(self, job: Job, folds: Sequence[FoldData]) -> Future[list[Answer]]:
        return self.executor.submit(work_isolated, job, folds, self.limits, thread_settings(), self.stopped)

    def stop(self) -> None:
        self.stopped.set()
        self.executor.shutdown(wait=False, cancel_futures=True)
        super().stop()


class _Dask(Workers):
    """Workers of a Dask cluster. Jobs go to it by value: neither files nor caches are shared. A fold's data go once to
    each worker that needs them."""

    def __init__(self, client: Any, limits: Limits) -> None:
        about = f"{client.scheduler.address}, {len(client.scheduler_info(n_workers=-1)['workers'])} workers now"
        super().__init__(client.get_executor(pure=False), room=None, about=about)
        self.client, self.limits, self.sends_files = client, limits, True
        self.shared: dict[int, tuple[FoldData, Any]] = {}

    def submit(self, job: Job, folds: Sequence[FoldData]) -> Future[list[Answer]]:
        data = [self._shared(fold) for fold in folds]
        return self.executor.submit(_on_dask, job, self.limits, thread_settings(), *data)

    def missing(self) -> str:
        """Text "workers", where the cluster has none."""
        if self.client.scheduler_info(n_workers=-1)["workers"]:
            return ""
        address = self.client.scheduler.address
        return f"no workers at {address}; start one with `dask worker {address}`"

    def _shared(self, fold: FoldData) -> Any:
        """Data of a fold as a task of the cluster, not as scattered data: where a worker is lost, the scheduler gives
        it to another one."""
        if id(fold) not in self.shared:
            self.shared[id(fold)] = fold, self.client.submit(_itself, fold, pure=False)
        return self.shared[id(fold)][1]


def _itself(fold: FoldData) -> FoldData:
    return fold


_digest_here = cache(package_digest)
"""Digest of a package, cached for a worker that serves many jobs; one with new code is started anew."""


def _on_dask(job: Job, limits: Limits, threads: Mapping[str, str], *folds: FoldData) -> list[Answer]:
    """Run a job in a child process of the worker: it can be killed, and it is alone (a worker may have many
    threads)."""
    for package, digest in job.code.items():
        if (here := _digest_here(package)) != digest:
            found = f"other code of {package} (source {here}; of the study: {digest})" if here else f"no {package}"
            raise InputError(
                f"the Dask worker on {platform.node()} has {found}; install the same version on all workers."
            )
    return work_isolated(job, folds, limits, threads)


@contextmanager
def open_workers(how: Execution) -> Iterator[Workers]:
    """Open the workers of `how`; where the study ends early, running jobs are stopped.

    Raises:
        InputError: Dask is not installed, or no scheduler answers.
    """
    with _connected(how) as workers:
        try:
            yield workers
        except BaseException:
            workers.stop()
            raise
        workers.executor.shutdown()


@contextmanager
def _connected(how: Execution) -> Iterator[Workers]:
    if how.executor == "dask":
        client = _client(str(how.scheduler))
        try:
            yield _Dask(client, how.limits)
        finally:
            client.close(timeout=CONNECT_S)
    elif how.executor == "processes" or how.limits:
        yield _Processes(1 if how.executor == "local" else how.workers or int(machine()["cpus"]), how.limits)
    else:
        yield _Local()


def _client(scheduler: str) -> Any:
    with needed_by("--executor dask"):
        from distributed import Client, Security
        from distributed.comm import connect
    for name in ("distributed", "distributed.client"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what goes wrong is said once, by us

    async def reach() -> None:
        comm = await connect(scheduler, timeout=CONNECT_S, **Security().get_connection_args("client"))
        await comm.close()

    try:
        asyncio.run(reach())
    except (
        Exception
    ) as error:  # an address that cannot be read, nobody there, or somebody who is no scheduler and answers anything
        raise InputError(
            f"no Dask scheduler answers at {scheduler} ({one_line(error)}); start one (`dask scheduler`) or correct "
            "the address, such as "
            "tcp://host:8786."
        ) from None
    return Client(scheduler, timeout=CONNECT_S, set_as_default=False)


def answers_of(future: Future[list[Answer]], cells: int) -> list[Answer]:
    """Answers of the workers; a job that was lost with every worker that took it counts as the model's failure.

    Raises:
        InputError: the workers' code is another.
        WorkError: the workers are lost.
    """
    try:
        return future.result()
    except InputError:
        raise
    except CancelledError:
        raise WorkError(f"the connection to the Dask scheduler is lost. {_GO_ON}") from None
    except Exception as error:
        if type(error).__name__ == "KilledWorker":  # known without importing distributed
            return [
                Answer("failed", "fit or prediction: all Dask workers that took it died, one after another")
                for _ in range(cells)
            ]
        raise WorkError(f"the workers cannot do their work: {one_line(error)}. {_GO_ON}") from error
