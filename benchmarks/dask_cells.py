"""Many cells on a Dask cluster without loss: the table must be that of the local executor, bit for bit.

    python benchmarks/dask_cells.py [CELLS=1000] [WORKERS=2]

Starts a scheduler and workers of one thread on this machine (needs `shipbench[dask]`), runs CELLS cells (5 folds, CELLS
/ 5 seeds) of a cheap seeded model on them, kills one worker (`kill -9`) when a third is done and starts another in its
place, then runs the same cells locally. Prints the number of cells, how many were lost or differ, the seconds of both
and the machine. Exit code 1: a cell was lost or differs.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

from shipbench.bench.executors import Execution
from shipbench.bench.progress import Silent
from shipbench.bench.provenance import machine
from shipbench.bench.runner import run_tasks
from shipbench.bench.task import make_task

PORT = 8797
SCHEDULER = f"tcp://127.0.0.1:{PORT}"
MODEL = """
import numpy as np

class Drawn:
    def fit(self, train, valid=None, *, seed=0):
        self.bias = np.random.default_rng(seed).normal(size=10)
        return self

    def predict(self, s0, U, history=None):
        return s0[:, None] + self.bias * np.arange(1, U.shape[1] + 1)[:, None]
"""


def start(*arguments: str) -> subprocess.Popen[bytes]:
    """`python -m distributed.cli.<arguments>` without its chatter."""
    command = [sys.executable, "-m", f"distributed.cli.{arguments[0]}", *arguments[1:], "--no-dashboard"]
    return subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def start_worker() -> subprocess.Popen[bytes]:
    """One worker, one thread, without a nanny that would start it again."""
    return start("dask_worker", SCHEDULER, "--nthreads", "1", "--no-nanny")


class KillOne(Silent):
    """Counts cells; kills a worker and starts another when a third of them is done."""

    def __init__(self, processes: list[subprocess.Popen[bytes]]) -> None:
        self.processes, self.total, self.count, self.began = processes, 0, 0, 0.0

    def start(self, total: int) -> None:
        self.total, self.began = total, time.monotonic()

    def done(self, label: str, outcome: str, kind: str = "", cost: float = 1.0) -> None:
        self.count += 1
        if self.count % 100 == 0:
            print(f"{self.count} of {self.total} cells after {time.monotonic() - self.began:.0f} s", flush=True)
        if self.count == self.total // 3:
            self.processes[-1].kill()
            threading.Thread(target=lambda: self.processes.append(start_worker())).start()


def main() -> int:
    """Run the cells on both executors and compare."""
    cells, workers = (int(a) for a in [*sys.argv[1:], *["1000", "2"][len(sys.argv) - 1 :]])
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder, "drawn.py")
        file.write_text(MODEL)
        seeds = range(cells // 5)
        task = make_task(
            {"dataset": "harbour90", "models": [f"{file}:Drawn"], "max_runs": 10, "horizon_s": 30, "seeds": seeds}
        )
        processes = [start("dask_scheduler", "--host", "127.0.0.1", "--port", str(PORT))]
        try:
            time.sleep(5)
            processes += [start_worker() for _ in range(workers)]
            began = time.monotonic()
            there = run_tasks(
                [task],
                Path(folder, "dask"),
                execution=Execution("dask", scheduler=SCHEDULER),
                progress=KillOne(processes),
            )
            seconds = time.monotonic() - began
        finally:
            for process in processes:
                process.kill()
        began = time.monotonic()
        here = run_tasks([task], Path(folder, "local"))
        local = time.monotonic() - began
    times = ["fit_s", "predict_s"]
    by_cell = [
        dict(list(o.rows.drop(columns=times).reset_index(drop=True).groupby(["fold", "seed"]))) for o in (there, here)
    ]
    lost = [cell for cell in by_cell[1] if cell not in by_cell[0]]
    different = [
        c
        for c in by_cell[1]
        if c not in lost and not by_cell[0][c].reset_index(drop=True).equals(by_cell[1][c].reset_index(drop=True))
    ]
    print(
        f"cells: {len(by_cell[1])}; lost: {len(lost)}; different from local: {len(different)}; failed: "
        f"{len(there.failed)}; one worker killed"
    )
    print(f"Dask: {seconds:.0f} s with {workers} workers; local: {local:.0f} s; {machine()}")
    return 1 if lost or different or there.failed else 0


if __name__ == "__main__":
    sys.exit(main())
