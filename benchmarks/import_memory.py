"""Peak memory and time of `shipbench data import` on a generated log of a given size.

    python benchmarks/import_memory.py [megabytes=1000] [csv|parquet] [measured|derived]

Writes the log to a temporary folder, imports it in a process of its own, prints the figures and deletes everything.
`derived` leaves the speeds out of the mapping, so that they come from the smoother. The peak must stay below 2 GB and
must not grow with the log.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet

SHIP = 'name = "bench"\nL = 130.0\nB = 20.0\nT = 7.0\nmass = 1.2e7\n'
UNITS = {
    "x": "m",
    "y": "m",
    "psi": "deg",
    "u": "m/s",
    "v": "m/s",
    "r": "deg/s",
    "n": "rpm",
    "delta": "deg",
    "n_c": "rpm",
    "delta_c": "deg",
}
RATE, BLOCK = 10.0, 200_000
IMPORT = (
    "import resource, sys\n"
    "from shipbench.cli.app import app\n"
    "try: app(sys.argv[1:])\n"
    "except SystemExit as end: code = end.code\n"
    "print('peak', resource.getrusage(resource.RUSAGE_SELF).ru_maxrss, file=sys.stderr)\n"
    "sys.exit(code)"
)


def block(first: int, rng: np.random.Generator) -> pd.DataFrame:
    """Rows of a ship that weaves, at 10 Hz, with noise; a pause of a minute every 200,000 rows."""
    t = (first + np.arange(BLOCK)) / RATE + 60.0 * (first // BLOCK)
    psi = 40.0 * np.sin(t / 80.0)
    r, u = 0.5 * np.cos(t / 80.0), np.full(BLOCK, 4.0)
    x, y = 3.5 * t, 200.0 * np.sin(t / 80.0)
    motion = {"x": x, "y": y, "psi": psi, "u": u, "v": -5.0 * np.deg2rad(r), "r": r}
    noisy = {k: v + 0.05 * rng.standard_normal(BLOCK) for k, v in motion.items()}
    command = 20.0 * np.sign(np.sin(t / 40.0))
    return pd.DataFrame({"t": t, **noisy, "n": 100.0, "delta": command, "n_c": 100.0, "delta_c": command}).round(6)


def write_log(path: Path, megabytes: float) -> None:
    """Append blocks until the file has that size."""
    rng, first = np.random.default_rng(0), 0
    if path.suffix == ".csv":
        with path.open("w") as file:
            while file.tell() < megabytes * 1e6:
                block(first, rng).to_csv(file, index=False, header=first == 0)
                first += BLOCK
        return
    schema = pa.Schema.from_pandas(block(0, rng), preserve_index=False)
    with pa.parquet.ParquetWriter(path, schema) as writer:
        while path.stat().st_size < megabytes * 1e6:
            writer.write_table(pa.Table.from_pandas(block(first, rng), schema, preserve_index=False))
            first += BLOCK


def main() -> None:
    """Generate, import, print."""
    size, suffix, speeds = (
        float((sys.argv[1:2] or ["1000"])[0]),
        (sys.argv[2:3] or ["csv"])[0],
        (sys.argv[3:4] or ["measured"])[0],
    )
    units = {k: v for k, v in UNITS.items() if speeds == "measured" or k not in ("u", "v", "r")}
    with tempfile.TemporaryDirectory() as folder:
        log, mapping, ship = (Path(folder, name) for name in (f"log.{suffix}", "mapping.toml", "ship.toml"))
        write_log(log, size)
        channels = "".join(f'{k} = {{ column = "{k}", unit = "{unit}" }}\n' for k, unit in units.items())
        mapping.write_text(f'name = "bench"\ndt = 1.0\n[time]\ncolumn = "t"\n[channels]\n{channels}')
        ship.write_text(SHIP)
        began = time.perf_counter()
        command = [
            "data",
            "import",
            str(log),
            "--map",
            str(mapping),
            "--ship",
            str(ship),
            "--out",
            str(Path(folder, "out")),
        ]
        done = subprocess.run([sys.executable, "-c", IMPORT, *command], capture_output=True, text=True, check=False)
        seconds = time.perf_counter() - began
        peak = int(done.stderr.rsplit("peak ", 1)[1]) * (1 if sys.platform == "darwin" else 1024)
        print(
            f"{suffix}, {log.stat().st_size / 1e6:.0f} MB, {speeds} speeds: exit {done.returncode}, {seconds:.0f} "
            f"s, peak {peak / 1e6:.0f} MB"
        )
        print(done.stdout.splitlines()[0] if done.stdout else done.stderr)


if __name__ == "__main__":
    main()
