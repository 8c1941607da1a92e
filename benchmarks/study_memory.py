"""Peak memory of a whole study of 1,000 runs of 1,000 s, with 1, 3 and 6 models: it must stay below 4 GB and must not
grow with the models.

    python benchmarks/study_memory.py [--dt 1.0] [--models 1 3 6] [--quick] [--json FILE]

Makes the data set (the simulator's harbour runs, 1 s apart; a smaller --dt interpolates them), writes it as Parquet,
and runs `shipbench run` on it in a process of its own for each number of models: five folds, windows of 120 s, every
network for one epoch, since epochs take time and no memory. The figure is the greatest sum of the resident memory of
that process and all that it started, looked at every 50 ms, or the most that the system saw one of them hold, if that
is more: the fit of the physics needs its memory for a moment only.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import measure
import numpy as np
import psutil

from shipbench.data.files import write_dataset
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.simulate.harbour import draw_plan, fly

MODELS = (
    "neural_ode[epochs=1]", "mlp[epochs=1]", "physics", "lstm[epochs=1]", "hold", "mlp[epochs=1,target=increment]",
)  # fmt: skip
"""The one that needs most comes first: what more models add is then what is left behind by those before."""
LIMIT_GB = 4.0
_KILO = 1 if sys.platform == "darwin" else 1024
"""Bytes of a unit in which the system counts."""
GROWTH = 1.1
"""Accepted ratio of the peak with most models to that with one: flat, but for what the allocator leaves."""


def make(runs: int, seconds: int, dt: float) -> Dataset:
    """`runs` harbour runs of `seconds` s, sampled every `dt` s."""
    ship, warm_up = load_mmg_ship("container130"), 60
    rng = np.random.default_rng(0)
    S, C = fly(ship, draw_plan(rng, runs, ship.L, seconds, warm_up), rng, seconds, warm_up)
    knots, t = np.arange(seconds + 1.0), dt * np.arange(round(seconds / dt) + 1)
    held = np.minimum(t.astype(int), seconds)

    def run(i: int) -> Run:
        states = np.stack([np.interp(t, knots, S[i, :, j]) for j in range(S.shape[2])], axis=1)
        return Run(f"run{i:04d}", t, states, C[i, held])

    return Dataset(
        name="memory",
        ship=ship.particulars,
        dt=dt,
        runs=tuple(run(i) for i in range(runs)),
        source="shipbench simulator",
        licence="MIT",
    )


def peak_of(command: list[str]) -> tuple[float, float, int]:
    """(GB, seconds, exit code) of a process and all that it starts."""
    began, peak, ended, status = time.perf_counter(), 0, 0, 0
    process = psutil.Popen(command)
    while not ended:
        total = 0
        for one in [process, *_children(process)]:
            try:
                total += one.memory_info().rss
            except psutil.NoSuchProcess:  # it has just ended
                continue
        peak = max(peak, total)
        time.sleep(0.05)
        ended, status, usage = os.wait4(process.pid, os.WNOHANG)
    process.returncode = os.waitstatus_to_exitcode(status)
    return max(peak, _KILO * usage.ru_maxrss) / 1e9, time.perf_counter() - began, process.returncode


def _children(process: psutil.Popen) -> list[psutil.Process]:
    try:
        return process.children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--dt", type=float, default=1.0, help="sample time [s]")
    parser.add_argument(
        "--models", type=int, nargs="+", default=[1, 3, 6], help=f"numbers of models, each at most {len(MODELS)}"
    )
    parser.add_argument("--quick", action="store_true", help="20 runs, to see that the script works")
    parser.add_argument("--json", type=Path, help="append machine and figures to FILE")
    return parser.parse_args()


def main() -> int:
    """Make, run, print. Exit code 1: a target is not reached."""
    given = _options()
    options = measure.Options(1, given.quick, given.json)
    measure.header(options, "lightning", "pandas", "pyarrow")
    runs, seconds = (20, 1000) if given.quick else (1000, 1000)
    with tempfile.TemporaryDirectory() as folder:
        data = Path(folder, "data")
        write_in_own_process(data, runs, seconds, given.dt)
        samples = runs * (round(seconds / given.dt) + 1)
        size = samples * 15 * 8 / 1e9
        print(
            f"data: {runs} runs x {seconds} s, dt {given.dt:g} s: {samples} samples, {size:.2f} GB as 15 columns of "
            "float64"
        )
        found = {}
        for number in [1, 2] if given.quick else given.models:
            models = [word for spec in MODELS[:number] for word in ("--model", spec)]
            command = [
                sys.executable,
                "-m",
                "shipbench",
                "run",
                "-q",
                "--dataset",
                str(data),
                *models,
                "--out",
                str(Path(folder, f"out{number}")),
            ]
            peak, took, code = peak_of(command)
            if code:
                raise SystemExit(
                    f"`shipbench run` with {number} models ended with exit code {code}; the figure would mean nothing."
                )
            found[number] = peak
            print(
                f"{number} models: peak {peak:.2f} GB, {took:.0f} s   shipbench run -q --dataset DATA "
                f"{' '.join(models)}",
                flush=True,
            )
            measure.record(
                options,
                {
                    "title": "memory of a study",
                    "models": number,
                    "peak_GB": peak,
                    "seconds": took,
                    "runs": runs,
                    "dt": given.dt,
                },
            )
    growth = found[max(found)] / found[min(found)]
    reached = max(found.values()) < LIMIT_GB and growth < GROWTH
    print(
        f"peak with {max(found)} models over {min(found)}: {growth:.2f} (flat: below {GROWTH}); limit {LIMIT_GB:g} GB"
    )
    print("quick: says nothing of the target" if given.quick else f"target {'reached' if reached else 'NOT reached'}")
    return 0 if reached or given.quick else 1


def write_in_own_process(folder: Path, runs: int, seconds: int, dt: float) -> None:
    """So that nothing of the making is left in the memory that is measured next to it."""
    code = "import sys; sys.path.insert(0, sys.argv[1]); import study_memory as s; s.write(*sys.argv[2:])"
    here = str(Path(__file__).parent)
    subprocess.run([sys.executable, "-c", code, here, str(folder), str(runs), str(seconds), str(dt)], check=True)


def write(folder: str, runs: str, seconds: str, dt: str) -> None:
    """Make the data set and write it to `folder`."""
    write_dataset(make(int(runs), int(seconds), float(dt)), folder, format="parquet")


if __name__ == "__main__":
    sys.exit(main())
