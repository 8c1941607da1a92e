"""Motion of the true ship in each scored window: speed, drift, rudder, astern, thrusters, and the indices of standard
manoeuvres.

These are properties of the data, the same for every model. A study keeps them in `windows.parquet`, so that slices can
be rendered from rows alone. Whole windows are sorted, not time steps: in a rollout the error at a time step is the sum
of all earlier ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..metrics.trial_indices import NAMES, trial_indices
from ..records import Batch
from ..render.table import display_unit, significant
from ..signals import DELTA, U, V

Frame = Any
RPM_C, THRUSTERS_C = 0, slice(2, 4)
"""Columns of the commands in U."""


def window_features(batch: Batch, L: float) -> dict[str, np.ndarray]:
    """Features by name, one value per window (batch,).

    speed: mean resultant speed [m/s]. drift: mean drift angle atan2(|v|, |u|) [rad], weighted with the speed, since it
    is undefined at rest. rudder: mean |delta| [rad]. astern, thrusters: share of the samples with astern shaft speed
    commands, or with thruster commands. Then the true ship's `trial_indices`, in ship lengths and rad, NaN where the
    window is no such manoeuvre.
    """
    u, v = batch.truth[..., U], batch.truth[..., V]
    speed = np.hypot(u, v)
    way = speed.sum(axis=1)
    drift = np.sum(speed * np.arctan2(np.abs(v), np.abs(u)), axis=1) / np.where(way > 0, way, 1.0)
    indices = trial_indices(s0=batch.s0, states=batch.truth, true=batch.truth, U=batch.U, L=L)
    return {
        "speed": speed.mean(axis=1), "drift": drift, "rudder": np.abs(batch.truth[..., DELTA]).mean(axis=1),
        "astern": (batch.U[..., RPM_C] < 0).mean(axis=1),
        "thrusters": (batch.U[..., THRUSTERS_C] != 0).any(axis=2).mean(axis=1),
        **dict(zip(NAMES, indices.T, strict=True)),
    }  # fmt: skip


COLUMNS = ("speed", "drift", "rudder", "astern", "thrusters", *NAMES)
_UNITS = {"speed": "m/s", "drift": "rad", "rudder": "rad"}


@dataclass(frozen=True, eq=False)
class Slice:
    """Windows of one regime: its feature ("speed"), its label with bounds and units, and its mask of windows
    (windows,)."""

    regime: str
    label: str
    members: np.ndarray


def slices(windows: Frame) -> Iterator[Slice]:
    """Thirds of the windows by speed, drift and rudder; with and without astern and thruster commands. Regimes without
    a difference are left out."""
    for regime, unit in _UNITS.items():
        name, factor = display_unit(unit)
        values = windows[regime].to_numpy(float) * factor
        low, high = np.quantile(values, [1 / 3, 2 / 3])
        if not low < high:
            continue
        a, b, text = significant(3)(float(low)), significant(3)(float(high)), f"{regime} "
        yield Slice(regime, f"{text}below {a} {name}", values < low)
        yield Slice(regime, f"{text}{a} to {b} {name}", (values >= low) & (values < high))
        yield Slice(regime, f"{text}above {b} {name}", values >= high)
    for regime, words in (("astern", ("never astern", "astern")), ("thrusters", ("no thruster", "thrusters in use"))):
        used = windows[regime].to_numpy(float) > 0
        if used.any() and not used.all():
            yield Slice(regime, words[0], ~used)
            yield Slice(regime, words[1], used)
