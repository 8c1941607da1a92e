"""`shipbench run -m hold` on a data set of many short runs, beside a plain reading of its table by pandas: seconds,
processor seconds, most memory.

    python benchmarks/many_runs.py [--only csv|parquet]

The data set: 10,000 runs of 61 to 121 samples, 2 s apart, so that the horizon of 120 s fits once or twice. Each side
runs in a process of its own; both must find all runs. Target: 30 s and 1 GB, on one idle core.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median

import measure
import numpy as np
import pandas as pd

SHIP = 'name = "bench"\nL = 130.0\nB = 20.0\nT = 7.0\nmass = 1.2e7\n'
DT = 2.0
PLAIN = "import sys, pandas; print(pandas.{}(sys.argv[1])['trajectory'].nunique())"
READERS = {"csv": "read_csv", "parquet": "read_parquet"}


def write_set(folder: Path, runs: int, suffix: str) -> Path:
    """A data set of ships that weave, and the path of its table."""
    rng = np.random.default_rng(0)
    length = rng.integers(61, 122, runs)
    run, k = np.repeat(np.arange(runs), length), np.concatenate([np.arange(n) for n in length])
    t, rate, u = DT * k, rng.uniform(0.02, 0.08, runs)[run], rng.uniform(3.0, 8.0, runs)[run]
    psi, delta = 0.4 * np.sin(rate * t), 0.2 * np.sign(np.cos(rate * t))
    motion = {
        "x": u * t,
        "y": 20.0 * psi,
        "psi": psi,
        "u": u,
        "v": -5.0 * psi * rate,
        "r": 0.4 * rate * np.cos(rate * t),
    }
    noisy = {name: value + 0.001 * rng.standard_normal(len(t)) for name, value in motion.items()}
    table = pd.DataFrame(
        {
            "trajectory": [f"run{i:05d}" for i in run],
            "t": t,
            **noisy,
            "n": 1.5,
            "delta": delta,
            "n_c": 1.5,
            "delta_c": delta,
        }
    )
    path = folder / f"trajectories.{suffix}"
    table.to_parquet(path, index=False) if suffix == "parquet" else table.to_csv(path, index=False)
    (folder / "dataset.toml").write_text(f'name = "many_runs"\ndt = {DT}\nactuators = "measured"\n')
    (folder / "ship.toml").write_text(SHIP)
    return path


def child(*arguments: str) -> tuple[str, dict[str, float]]:
    """What a child process of Python prints, and what it takes.

    Raises:
        SystemExit: it fails.
    """
    began = time.perf_counter()
    process = subprocess.Popen([sys.executable, *arguments], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    said = process.stdout.read()
    _, status, used = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise SystemExit(f"{' '.join(arguments)}: exit code {process.returncode}")
    memory = used.ru_maxrss * (1 if sys.platform == "darwin" else 1024) / 1e9
    return said, {
        "seconds": time.perf_counter() - began,
        "processor_s": used.ru_utime + used.ru_stime,
        "memory_GB": memory,
    }


def beside_pandas(folder: Path, suffix: str, given: measure.Options) -> None:
    """Run both sides in turn and print their medians."""
    runs = 60 if given.quick else 10_000
    path, out = write_set(folder, runs, suffix), folder / "results"
    sides: dict[str, list[dict[str, float]]] = {"shipbench run -m hold": [], f"pandas.{READERS[suffix]}": []}
    for _ in range(given.runs):
        said, ours = child("-m", "shipbench", "run", "-m", "hold", "-d", str(folder), "--out", str(out), "--json", "-q")
        counted, plain = child("-c", PLAIN.format(READERS[suffix]), str(path))
        for taken, figures in zip(sides.values(), (ours, plain), strict=True):
            taken.append(figures)
    scored = pd.read_parquet(out / "rows.parquet")["parent"].nunique()
    measure.agree("the number of runs", max(abs(scored - runs), abs(int(counted) - runs)), 0)
    assert json.loads(said)["failed"] == []
    print(
        f"{runs} runs of 61 to 121 samples, {path.stat().st_size / 1e6:.0f} MB of {suffix}  (median of {given.runs} "
        "interleaved runs)"
    )
    found = {what: {key: median(t[key] for t in taken) for key in taken[0]} for what, taken in sides.items()}
    for what, figures in found.items():
        print(
            f"  {figures['seconds']:8.2f} s, of the processor {figures['processor_s']:8.2f} s, "
            f"{figures['memory_GB']:6.3f} GB  {what}"
        )
    ours, plain = found.values()
    print(
        f"  ratio of processor seconds {ours['processor_s'] / plain['processor_s']:.1f}; of memory "
        f"{ours['memory_GB'] / plain['memory_GB']:.1f}"
    )
    measure.record(given, {"runs": runs, "table": suffix, "sides": found})


def main() -> None:
    """Every kind of table that was asked for."""
    given = measure.options(__doc__, runs=1, cases=tuple(READERS))
    measure.header(given, "pandas", "pyarrow")
    for suffix in given.only or READERS:
        with tempfile.TemporaryDirectory() as folder:
            beside_pandas(Path(folder), suffix, given)


if __name__ == "__main__":
    main()
