"""Rows of results, made without running anything."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from shipbench.bench.regimes import COLUMNS as REGIME_COLUMNS
from shipbench.bench.results import PROTOCOL
from shipbench.bench.submissions import Results
from shipbench.metrics.trial_indices import NAMES as TRIAL_NAMES

COLUMNS = [
    {"name": "ed", "label": "ED", "unit": "m"},
    {"name": "edh", "label": "EDH", "unit": "m"},
    {"name": "cvdm", "label": "cVDM", "unit": "%"},
    {"name": "heading_error", "label": "heading error", "unit": "rad"},
    {"name": "rmse_F_b", "label": "RMSE F_b", "unit": "N"},
    {"name": "ed_at_10s", "label": "ED at 10 s", "unit": "m"},
]


def results(models, dataset="toy", *, fingerprint="f1", protocol=PROTOCOL, task="t1", kinds=("",)):
    """Rows from `models`: name -> list over folds of the runs' ED; None is a diverged run. The other columns are
    multiples of ED."""
    rows, summaries = [], []
    for model, folds in models.items():
        for fold, errors in enumerate(folds):
            for i, error in enumerate(errors):
                value = np.nan if error is None else float(error)
                rows.append(
                    {
                        "protocol": protocol, "dataset": dataset, "fingerprint": fingerprint, "task": task,
                        "model": model, "fold": fold,
                        "seed": 0, "run": f"r{fold}{i}", "parent": f"r{fold}{i}", "kind": kinds[i % len(kinds)],
                        "status": "diverged" if error is None else "ok",
                        "reason": "u is nan at t = 3 s" if error is None else "",
                        "ed": value, "edh": 2 * value, "cvdm": 3 * value, "heading_error": value / 100,
                        "rmse_F_b": 1000 * value,
                        "ed_at_10s": value / 2, "fit_s": 1.5, "fit_shared_by": 1, "predict_s": 0.002,
                    }
                )  # fmt: skip
            summaries.append(
                {
                    "dataset": dataset, "fingerprint": fingerprint, "protocol": protocol, "task_key": task,
                    "model": model, "fold": fold,
                    "seed": 0, "columns": COLUMNS, "task": {"split": "folds", "horizon_s": 20, "history_s": 0},
                    "ship": "toy", "ship_L": 50.0,
                    "dt": 1.0, "source": "", "licence": "", "notes": ["depth unknown"], "command": "shipbench run -m x",
                    "finished": "2026-01-02T03:04:05", "code": {"shipbench": "0", "source": "abc", "git": ""},
                    "machine": {"cpus": 2, "python": "3", "torch": "2"},
                }
            )  # fmt: skip
    return Results(pd.DataFrame(rows), summaries, [Path()] * len(summaries))


def many(seed, runs=30, offset=0.0):
    """ED of two folds of runs."""
    rng = np.random.default_rng(seed)
    return [(rng.lognormal(size=runs // 2) + offset).tolist() for _ in range(2)]


def first_table(board):
    """Rows of the first table by model."""
    return {row["model"]: row for row in board.tables[0].rows}


def by_title(board, words):
    """The first table with these words in its title."""
    return next(t for t in board.tables if words in t.title)


def windows_of(found, **values):
    """Motion of the true ship by window: 0 and no manoeuvre, but for `values`."""
    frame = found.rows.drop_duplicates(["fold", "run"])[["dataset", "fingerprint", "task", "fold", "run"]].reset_index(
        drop=True
    )
    blank = dict.fromkeys(REGIME_COLUMNS[:5], 0.0) | dict.fromkeys(TRIAL_NAMES, np.nan)
    return frame.assign(**(blank | values))


def with_columns(found, columns):
    """Results with further columns of the rows."""
    made = Results(found.rows.assign(**columns), found.summaries, found.sources)
    made.__dict__["windows"] = found.windows  # a cached property
    return made
