"""Stand-in for a simulation of which only predicted trajectories are known: physics fitted to these.

A diagnosis needs accelerations at measured states, and trajectories do not have them. The stand-in has: it is the model
`calibrated`, fitted to the predicted states as to those of another ship.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..errors import InputError
from ..metrics.ed import ed
from ..predictors.calibrated import Calibrated
from ..predictors.predictions import Trajectory
from ..records import Dataset, Run
from ..signals import ACTUATORS, COMMANDS, X, Y
from ..specs import Spec, spec_of
from .bind import bound
from .frame import frame_notes

_VALIDATION = 9
"""One of so many trajectories decides whether rollouts refine the fit, as in `shipbench run`."""
_LEAST = 3
"""Samples of the shortest trajectory that is fitted."""


class StandIn(NamedTuple):
    """Spec of a simulation that a diagnosis can judge, and what a reader must know of it."""

    spec: Spec
    note: str = ""


def stand_in(spec: Spec, data: Dataset) -> StandIn:
    """Stand-in for predicted trajectories; any other simulation as it is.

    Raises:
        InputError: no trajectory can be read, matched to a run of `data`, or fitted, or their unit or frame is another.
    """
    if spec.reader != "predictions":
        return StandIn(spec)
    matched = bound(spec, data).matched
    tracks = {} if matched is None else matched.runs
    if notes := frame_notes(_moved(data, tracks), data.ship, data.dt):
        raise InputError(f"{spec.text}: {notes[0]}")
    predicted = _as_runs(data, tracks)
    valid = range(0, len(predicted), _VALIDATION)
    train = [i for i in range(len(predicted)) if i not in valid]
    model = Calibrated()
    model.fit(predicted.subset(train), predicted.subset(valid)) if train else model.fit(predicted)
    apart = [
        float(ed(true=run.states[None, 1:], pred=model.predict(run.states[:1], run.inputs[None, :-1])).mean())
        for run in predicted.runs
    ]

    def simulate(s0: np.ndarray, U: np.ndarray, dt: float) -> np.ndarray:
        """Physics fitted to the predicted trajectories."""
        return model.predict(s0, U)

    note = (
        f"Only predicted trajectories are known of your simulation. Physics fitted to {len(predicted)} of them stands "
        f"in for it, and is on average {np.mean(apart):.2g} m off them. What it lacks of your simulation looks like an "
        "error of your simulation. With the simulator itself (--model sim.py:simulate) nothing stands in. "
        f"Matching: {'; '.join(matched.notes if matched else ())}."
    )
    return StandIn(spec_of(simulate, spec.text), note)


def _moved(data: Dataset, tracks: dict[str, tuple[Trajectory, ...]]) -> list[tuple[Trajectory, Run]]:
    """Trajectories with their runs, each moved to the measured start: their origin does not matter here."""
    pairs = []
    for run in data.runs:
        for track in tracks.get(run.id, ()):
            first = min(max(round((track.start - float(run.t[0])) / data.dt), 0), len(run) - 1)
            states = track.states.copy()
            states[:, [X, Y]] += run.states[first, [X, Y]] - states[0, [X, Y]]
            pairs.append((Trajectory(track.start, states), run))
    return pairs


def _as_runs(data: Dataset, tracks: dict[str, tuple[Trajectory, ...]]) -> Dataset:
    """Predicted trajectories as runs under the recorded inputs; actuators that a file lacks are the commands."""
    runs, read = [], False
    for run in data.runs:
        for number, track in enumerate(tracks.get(run.id, ())):
            first = round((track.start - float(run.t[0])) / data.dt)
            skip = max(-first, 0)
            steps = min(len(track.states) - skip, len(run) - first - skip)
            if steps < _LEAST:
                continue
            at = slice(first + skip, first + skip + steps)
            states = track.states[skip : skip + steps].copy()
            gaps = np.isnan(states[:, ACTUATORS])
            read = read or not gaps.all()
            states[:, ACTUATORS] = np.where(gaps, run.inputs[at, : len(COMMANDS)], states[:, ACTUATORS])
            name = run.id if number == 0 else f"{run.id}-{number + 1}"
            runs.append(Run(name, run.t[at], states, run.inputs[at], run.inputs_names))
    if not runs:
        raise InputError(
            f"no predicted trajectory is long enough to be fitted; accepted: some of {_LEAST} samples or more."
        )
    return Dataset(data.name, data.ship, data.dt, tuple(runs), "measured" if read else "commanded")
