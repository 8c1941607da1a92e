"""What the extended physics of `leaderboards/esso_osaka.md` could reach at best: fitted to the very windows that it is
scored on.

    python benchmarks/esso_osaka_bound.py  # half a minute; reads the local copy of the data

No score: a model that has seen the truth. Where even that one is not below a target, no choice of its parameters is.
Position RMSE [m], the mean over windows of 100 s, as on the leaderboard (`make_folds` of `configs/esso_osaka.toml`).
"""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np

from shipbench import load_dataset
from shipbench.bench.folds import make_folds, select_runs
from shipbench.bench.task import Task
from shipbench.metrics.position_rmse import position_rmse
from shipbench.predictors.base import make_predictor
from shipbench.records import Dataset
from shipbench.specs import parse_spec

CONFIG = Path(__file__).parents[1] / "configs" / "esso_osaka.toml"
PIECES = (50, 100)
"""Longest rollouts of the fit [s]: those that the training files chose, and those that are scored."""


def errors(model: str, train: Dataset, windows: Dataset) -> dict[str, float]:
    """Mean of the windows' position RMSE, of all and by kind of manoeuvre [m]."""
    batch = windows.batch()
    off = position_rmse(true=batch.truth, pred=make_predictor(parse_spec(model)).fit(train).predict(batch.s0, batch.U))
    kinds = np.array([run.kind for run in windows.runs])
    return {"all": float(off.mean())} | {str(kind): float(off[kinds == kind].mean()) for kind in np.unique(kinds)}


def main() -> None:
    task = Task(**tomllib.loads(CONFIG.read_text()))
    (fold,) = make_folds(select_runs(load_dataset(task.dataset), task)[0], task)
    extended = next(m for m in task.models if m.startswith("physics[piece="))
    for piece in PIECES:
        model = extended.replace("piece=50", f"piece={piece}")
        for name, train in {
            "the training files": fold.train.merged(fold.valid),
            "the scored windows": fold.test,
        }.items():
            found = errors(model, train, fold.test)
            print(
                f"pieces of {piece} s, fitted to {name}: "
                + ", ".join(f"{kind} {value:.2f}" for kind, value in found.items()),
                flush=True,
            )


if __name__ == "__main__":
    main()
