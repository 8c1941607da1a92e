"""Speeds of the track in place of those of a speed log with dropouts, which would be confounded with a force or another
sensor error."""

from __future__ import annotations

from dataclasses import replace

from ...checking.speed_log import dropout, in_words
from ...importing.position import to_body
from ...importing.speeds import derivative
from ...records import Run
from ...signals import PSI, U, V, X, Y
from .base import Prepared
from .derived_speeds import has_speeds


def speeds_of_the_track(prepared: Prepared) -> Prepared:
    """Take u and v from the positions where the log reads zero while the ship makes way."""
    dataset = prepared.dataset
    found = dropout(dataset) if has_speeds(dataset) else None
    if found is None:
        return prepared
    runs = [_by_track(run, dataset.dt, (dataset.ship.L / 9.81) ** 0.5) for run in dataset.runs]
    line = f"{in_words(found)} u and v are taken from the positions in all runs instead."
    return prepared.corrected(
        replace(dataset.with_runs(runs), derived=tuple(dict.fromkeys((*dataset.derived, "u", "v")))), line
    )


def _by_track(run: Run, dt: float, scale: float) -> Run:
    states = run.states.copy()
    rate = derivative(run.t, states[:, [X, Y]], run.t, dt, scale).rate
    states[:, U], states[:, V] = to_body(rate[:, 0], rate[:, 1], states[:, PSI])
    return replace(run, states=states)
