"""Predicted trajectories of another program, made of the measured ones: with an error that grows, as files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd

from shipbench.records import Dataset, Run
from shipbench.signals import STATES

MOTION = ("x", "y", "psi", "u", "v", "r")


def apart(data: Dataset) -> Dataset:
    """Data set whose runs start 300 m from one another."""
    runs = []
    for i, run in enumerate(data.runs):
        states = run.states.copy()
        states[:, 0] += 300.0 * i
        states[:, 1] -= 150.0 * i
        runs.append(Run(run.id, run.t, states, run.inputs, run.inputs_names, run.meta))
    return data.with_runs(runs)


def predicted(data: Dataset, columns: tuple[str, ...] = STATES, growth: float = 0.02) -> pd.DataFrame:
    """Long table of every run as another program predicts it: the track is off by `growth` [m/s]."""
    frames = []
    for run in data.runs:
        states = run.states.copy()
        states[:, 0] += growth * (run.t - run.t[0])
        frame = pd.DataFrame(states, columns=list(STATES))[list(columns)]
        frame.insert(0, "t", run.t)
        frame.insert(0, "trajectory", run.id)
        frames.append(frame)
    return pd.concat(frames, ignore_index=True)


def written(table: pd.DataFrame, folder: Path, name: str = "theirs.csv") -> Path:
    """Folder that holds the table."""
    folder.mkdir(exist_ok=True)
    if name.endswith(".parquet"):
        table.to_parquet(folder / name, index=False)
    else:
        table.to_csv(folder / name, index=False)
    return folder


def rows_of(table: pd.DataFrame, run: str) -> pd.DataFrame:
    """Rows of one trajectory."""
    return table[table["trajectory"] == run].reset_index(drop=True)


def same_motion(a: np.ndarray, b: np.ndarray, tolerance: float = 1e-9) -> bool:
    """Whether two arrays of states agree in position, heading and speeds."""
    return bool(np.allclose(a[..., :6], b[..., :6], atol=tolerance))
