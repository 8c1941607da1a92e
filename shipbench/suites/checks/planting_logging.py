"""Planting of the faults of loggers and exports: held fixes, placeholders, interpolation across north, clocks that are
set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .planting import Planting, wrapped


def held_fixes(p: Planting) -> None:
    """Record positions of a receiver that gives one every five samples."""
    for run in p.ids:
        at = p.rows(run)
        p.table.loc[at, ["x", "y"]] = p.table.loc[at[np.arange(len(at)) // 5 * 5], ["x", "y"]].to_numpy()


def placeholder(channel: str, value: float, seconds: float = 8.0) -> Callable[[Planting], None]:
    """Record a value that stands for "not available", for some seconds of three runs."""

    def plant(p: Planting) -> None:
        samples = max(2, round(seconds * p.time / p.dt))
        for run in p.pick(3):
            k = p.moment(run, samples)
            p.table.loc[p.rows(run)[k : k + samples], channel] = value

    return plant


def interpolated_north(p: Planting) -> None:
    """Record a heading of 0 to 360 at every third sample, interpolated without unwrapping; in the set that `wrapped`
    makes."""
    wrapped(p)
    for run in p.ids:
        at = p.rows(run)
        psi, log = np.remainder(p.table.loc[at, "psi"].to_numpy() + np.pi, 2.0 * np.pi), np.arange(0, len(at), 3)
        p.table.loc[at, "psi"] = np.interp(np.arange(len(at)), log, psi[log])
    p.table[["x", "y"]] *= -1.0


def clock_set(seconds: float) -> Callable[[Planting], None]:
    """Record stamps that continue where the clock was set back by `seconds` (at 130 m) in the hardest turn of a run:
    rows with repeated times are left out."""

    def plant(p: Planting) -> None:
        gone = max(2, round(seconds * p.time / p.dt))
        turning = p.table.groupby("trajectory")["psi"].agg(np.ptp).sort_values(ascending=False)
        for run in [str(r) for r in turning.index[:3]]:
            at = p.rows(run)
            k = p.busy(run, "psi", gone)
            p.table = p.table.drop(index=at[k : k + gone])
            rest = at[k + gone :]
            p.table.loc[rest, "t"] -= gone * p.dt

    return plant


def clock_ahead(seconds: float) -> Callable[[Planting], None]:
    """Add a gap of 10 s (at 130 m) to two runs, `seconds` of which are due to the clock, which was set ahead: only the
    rest of the rows is missing."""

    def plant(p: Planting) -> None:
        ahead, gone = (max(1, round(s * p.time / p.dt)) for s in (seconds, 10.0 - seconds))
        for run in p.pick(2):
            at, k = p.rows(run), p.moment(run, gone)
            p.table = p.table.drop(index=at[k : k + gone])
            p.table.loc[at[k + gone :], "t"] += ahead * p.dt

    return plant
