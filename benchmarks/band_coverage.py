"""Share of held-out measurements inside the 90 % bands of a model, by horizon, with width and interval score.

    python benchmarks/band_coverage.py harbour90_noisy 120
    python benchmarks/band_coverage.py 'esso_osaka[path=FOLDER]' 100 physics

The study that `shipbench run --bands` makes, with five folds by run: every run is held out once. Position counts north
and east apart.
"""

from __future__ import annotations

import sys
import tempfile

from shipbench.bench.runner import run_tasks
from shipbench.bench.scoring import BAND
from shipbench.bench.task import Task


def main(spec: str, seconds: float, model: str = "calibrated") -> None:
    task = Task(dataset=spec, models=(model,), horizon_s=seconds, bands=True)
    with tempfile.TemporaryDirectory() as folder:
        outcome = run_tasks([task], folder)
    rows, summaries = outcome.rows, outcome.summaries
    print(f"{summaries[0]['dataset']}, {model}: {len(rows)} windows, {(rows['status'] == 'ok').sum()} scored")
    for note in {s["no_band"]: None for s in summaries if "no_band" in s}:
        print(f"no band: {note}")
    for column in summaries[0]["columns"]:
        if column["name"].startswith(BAND):
            print(f"{column['label']:28s} {rows[column['name']].mean():.3g} {column['unit']}")


if __name__ == "__main__":
    main(sys.argv[1], float(sys.argv[2]), *sys.argv[3:])
