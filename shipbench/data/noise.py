"""Noise of each channel of a data set, estimated from the samples alone."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb

import numpy as np

from ..records import Dataset
from ..signals import ACTUATORS, ENVIRONMENT, STATES

_ORDERS = range(2, 7)
_MAD = 1.4826
"""Standard deviation over median absolute deviation of a normal distribution."""


@dataclass(frozen=True)
class ChannelNoise:
    """Noise of one channel: noise is the standard deviation of its white part, in standard units (median and greatest
    over the runs, the run of the greatest); step is the resolution of the record, or NaN where the values lie on no
    grid; repeated is the share of samples that repeat the one before."""

    channel: str
    noise: float
    greatest: float
    run: str
    step: float
    repeated: float


def white_noise(x: np.ndarray) -> float:
    """Standard deviation of the white noise on a smooth signal `x` (samples,).

    Differences of order m let a smooth signal vanish and leave the variance of white noise times binomial(2m, m)
    (Gasser, Sroka and Jennen-Steinmetz 1986; Hall, Kay and Titterington 1990). The least of the orders 2 to 6 is taken,
    each by its median absolute deviation, so that neither bends nor single jumps count as noise. Slow changes (drift,
    bias, filtered noise) are not detected; of a coarsely sampled motion some is taken for noise.
    """
    found = [_MAD * np.median(np.abs(np.diff(x, m))) / np.sqrt(comb(2 * m, m)) for m in _ORDERS if len(x) > 2 * m]
    return float(min(found, default=np.nan))


def resolution(runs: list[np.ndarray]) -> float:
    """Step of the grid that the values of all runs lie on, or NaN: every value of a grid occurs again and again, five
    times on average."""
    values = np.concatenate(runs)
    spread = float(np.ptp(values))
    changes = sum(int(np.count_nonzero(np.diff(x))) for x in runs)
    distinct = np.unique(np.round(values / spread, 9)) * spread if spread > 0.0 else values[:1]
    return float(np.median(np.diff(distinct))) if 1 < len(distinct) <= changes / 5 else float("nan")


def channel_noise(dataset: Dataset) -> list[ChannelNoise]:
    """Noise of every measured channel: the states, without actuators that only repeat their commands, then the
    environment."""
    measured = STATES if dataset.actuators == "measured" else STATES[: ACTUATORS.start]
    columns = [(name, [r.states[:, i] for r in dataset.runs]) for i, name in enumerate(measured)]
    columns += [
        (name, [r.inputs[:, i] for r in dataset.runs]) for i, name in enumerate(dataset.inputs) if name in ENVIRONMENT
    ]
    found = []
    for name, runs in columns:
        noise = np.array([white_noise(x) for x in runs])
        known = np.isfinite(noise)
        worst = int(np.nanargmax(noise)) if known.any() else 0
        repeated = float(np.mean(np.concatenate([np.diff(x) == 0.0 for x in runs])))
        found.append(ChannelNoise(
            name, float(np.median(noise[known])) if known.any() else float("nan"), float(noise[worst]),
            dataset.runs[worst].id,
            resolution(runs), repeated,
        ))  # fmt: skip
    return found
