"""Statistics of a data set, laid out as the source paper's Table II, and compared with it."""

from __future__ import annotations

import numpy as np
import pandas as pd

from ..records import Dataset
from ..signals import COMMANDS, STATES, UNITS

_SHOWN_IN_DEGREES = ("psi", "delta", "delta_c")
STATISTICS = ("min", "max", "mean", "std", "P10", "P50", "P90")

# The source paper's Table II (delta and delta_c in degrees, the rest in our units).
_TABLE_II = {
    "u": (-0.47, 6.17, 3.82, 0.74, 3.11, 3.53, 4.97),
    "v": (-1.04, 1.03, 0.05, 0.3, -0.3, 0.02, 0.46),
    "r": (-0.02, 0.02, 0.0, 0.01, -0.01, 0.0, 0.01),
    "n": (-158.8, 169.7, 92.8, 47.9, 32.1, 95.7, 154.5),
    "delta": (-40.0, 40.0, -1.0, 11.3, -13.9, -0.7, 11.6),
    "F_b": (-51228.0, 63000.0, 725.0, 8384.0, 0.0, 0.0, 0.0),
    "F_s": (-63000.0, 62996.0, 203.0, 5711.0, 0.0, 0.0, 0.0),
    "n_c": (-180.0, 180.0, 94.8, 50.8, 36.5, 98.4, 166.7),
    "delta_c": (-40.0, 40.0, -1.4, 12.1, -15.5, -0.7, 12.0),
}
COMPARED = ("u", "v", "r", "n", "delta")


def statistics(dataset: Dataset) -> pd.DataFrame:
    """Minimum, maximum, mean, standard deviation and deciles over all samples of all runs; index: signal, with a column
    `unit`."""
    S = np.concatenate([r.states for r in dataset.runs])
    inputs = np.concatenate([r.inputs for r in dataset.runs])
    rows = {}
    for name, values in [*zip(STATES, S.T, strict=True), *zip(dataset.inputs, inputs.T, strict=True)]:
        degrees = name in _SHOWN_IN_DEGREES
        x = np.rad2deg(values) if degrees else values
        rows[name] = [
            x.min(),
            x.max(),
            x.mean(),
            x.std(),
            *np.percentile(x, [10, 50, 90]),
            "deg" if degrees else UNITS[name],
        ]
    return pd.DataFrame.from_dict(rows, orient="index", columns=[*STATISTICS, "unit"])


def table_ii() -> pd.DataFrame:
    """Table II of the source paper, in the layout of `statistics`."""
    rows = {k: [*v, "deg" if k in _SHOWN_IN_DEGREES else UNITS[k]] for k, v in _TABLE_II.items()}
    return pd.DataFrame.from_dict(rows, orient="index", columns=[*STATISTICS, "unit"])


def compare_with_paper(dataset: Dataset) -> pd.DataFrame:
    """Mean, std, P10 and P90 of u, v, r, n, delta: of the data, of the paper, and the difference as a share of the
    paper's std.

    The paper prints r with two decimals: its 0.01 stands for anything from 0.005 to 0.015 rad/s. For r `difference /
    paper std` is taken to the nearest figure that rounds to the printed one, so that 0 means no difference within the
    paper's digits, and the std is taken as 0.01. `plain difference / paper std` makes no such allowance.
    """
    ours, paper, rows = statistics(dataset), table_ii(), []
    for signal in COMPARED:
        std = float(_TABLE_II[signal][STATISTICS.index("std")])
        rounding = 0.005 if signal == "r" else 0.0
        for statistic in ("mean", "std", "P10", "P90"):
            a, b = float(ours.at[signal, statistic]), float(paper.at[signal, statistic])
            gap = np.sign(a - b) * max(abs(a - b) - rounding, 0.0)
            rows.append((signal, statistic, a, b, ours.at[signal, "unit"], gap / std, (a - b) / std))
    names = ["signal", "statistic", "ours", "paper", "unit", "difference / paper std", "plain difference / paper std"]
    return pd.DataFrame(rows, columns=names)


def actuator_use(dataset: Dataset) -> dict[str, float]:
    """Share of the samples in which each command is not zero."""
    inputs = np.concatenate([r.inputs for r in dataset.runs])
    return {name: float(np.mean(inputs[:, i] != 0.0)) for i, name in enumerate(COMMANDS)}
