"""The whole study of the paper: `shipbench run --config configs/paper.toml`, where its time goes, and whether its
scores are the published ones.

    python benchmarks/paper_study.py [--quick] [--json FILE]

Target: under 6 minutes on two cores. `--quick` runs configs/smoke.toml and compares nothing. The largest change of a
run's ED is printed for each model; that of models which draw nothing must stay below 1e-6 m, networks round differently
from machine to machine.
"""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections import defaultdict
from pathlib import Path

import measure
import pandas as pd

ROOT = Path(__file__).resolve().parent.parent
TARGET_S = 360.0
UNSEEDED = ("hold", "physics", "oracle")


def main() -> None:
    """Run it once."""
    given = measure.options(__doc__, runs=1)
    measure.header(given, "lightning")
    config = "configs/smoke.toml" if given.quick else "configs/paper.toml"
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "shipbench", "run", "--config", config, "--out", folder, "--quiet"]
        wall = measure.seconds(lambda: subprocess.run(command, cwd=ROOT, check=True))
        cells = json.loads((Path(folder) / "summary.json").read_text())
        rows = pd.read_parquet(Path(folder) / "rows.parquet")
    spent: dict[str, float] = defaultdict(float)
    for cell in cells:
        spent[cell["model"]] += cell["fit_s"] + cell["predict_s"]
    aim = "" if given.quick else f"; target {TARGET_S:g} s: {'reached' if wall < TARGET_S else 'NOT reached'}"
    print(f"shipbench run --config {config}  {wall:.1f} s{aim}")
    for model, seconds in sorted(spent.items(), key=lambda item: -item[1]):
        print(f"  {model:24s} {seconds:8.2f} s fit and prediction")
    print(
        f"  {'everything else':24s} {wall - sum(spent.values()):8.2f} s (start, data, scoring, tables, plots; less "
        "where cells run side by side)"
    )
    measure.record(given, {"title": config, "ours_s": wall, "target_s": TARGET_S, "models": dict(spent)})
    if given.quick:
        return
    published = pd.read_parquet(ROOT / "leaderboards" / "results" / "paper" / "rows.parquet")
    both = published.merge(rows, on=["dataset", "model", "fold", "seed", "run"], suffixes=("", "_now"))
    change = (both["ed"] - both["ed_now"]).abs().groupby(both["model"]).max()
    print(
        f"largest change of a run's ED against leaderboards/results/paper [m], {len(both)} of {len(published)} "
        f"rows:\n{change.to_string()}"
    )
    measure.agree("ED of the models that draw nothing", float(change[list(UNSEEDED)].max()), 1e-6, "m")


if __name__ == "__main__":
    main()
