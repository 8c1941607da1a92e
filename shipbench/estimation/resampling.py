"""Averaging of fast records to the time resolution that a ship's motion needs.

A record at 10 Hz has the same information in a tenth of the arithmetic. Sensor errors that last for seconds become
errors of neighbouring samples.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..records import Dataset, Run
from ..ship import complete
from .thresholds import THRESHOLDS


def averaged(dataset: Dataset) -> Dataset:
    """Data set with the mean of every 3, 5, 7, ... samples, at the time of the middle one. Held channels (commands,
    wind, depth) keep the value that holds until the next such time.

    The number of samples is the largest that fits into a second at 130 m (Froude-scaled) and leaves the shortest run
    with two samples. The data set itself is returned where that is one.
    """
    every = THRESHOLDS.value("sample_interval")
    most = min(every * (complete(dataset.ship).L / 130.0) ** 0.5 / dataset.dt + 1e-6, min(map(len, dataset.runs)) / 2)
    num = int(most) - (int(most) + 1) % 2
    if num < 3:
        return dataset
    return replace(dataset, runs=tuple(_averaged(run, num) for run in dataset.runs), dt=num * dataset.dt)


def _averaged(run: Run, num: int) -> Run:
    at = np.arange(num // 2, len(run) - num // 2, num)
    states = run.states[: num * len(at)].reshape(len(at), num, -1).mean(axis=1)
    inputs, names = run.inputs, run.inputs_names
    windy = {"wind_speed", "wind_from"} <= set(names)
    if windy:
        speed, toward = names.index("wind_speed"), names.index("wind_from")
        wind = inputs[:, speed] * np.exp(1j * inputs[:, toward])
        inputs = inputs.copy()
        inputs[:, speed], inputs[:, toward] = wind.real, wind.imag
    held = np.add.reduceat(inputs[: at[-1] + num], at) / np.diff(at, append=min(at[-1] + num, len(run)))[:, None]
    if windy:
        wind = held[:, speed] + 1j * held[:, toward]
        held[:, speed], held[:, toward] = np.abs(wind), np.angle(wind)
    return replace(run, t=run.t[at], states=states, inputs=held)
