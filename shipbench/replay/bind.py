"""Predicted trajectories of a spec for one data set: read, matched to its runs, and put on its time grid."""

from __future__ import annotations

from dataclasses import replace

from ..predictors.predictions import Matched, Trajectory
from ..records import Dataset, Run
from ..specs import Spec
from .frame import frame_notes
from .matching import match_tracks, on_grid
from .reading import read_tracks


def bound(spec: Spec, data: Dataset) -> Spec:
    """Spec with the trajectories that it names, matched to the runs of `data`; any other spec as it is.

    The result holds predicted states and no measured ones.

    Raises:
        InputError: the files cannot be read, match no run, or have fewer samples than the data set.
    """
    if spec.reader != "predictions" or spec.path is None:
        return spec
    where = str(spec.path)
    found = read_tracks(spec.path, str(spec.params.get("mapping", "")), data)
    matches, told = match_tracks(found, data, where)
    runs: dict[str, list[Trajectory]] = {}
    pairs: list[tuple[Trajectory, Run]] = []
    interpolated = 0
    for match in matches:
        trajectory, between = on_grid(match, data, where)
        interpolated += between
        if len(trajectory.states):
            runs.setdefault(match.run.id, []).append(trajectory)
            pairs.append((trajectory, match.run))
    if interpolated:
        told.append(f"{interpolated} trajectories interpolated to the sample time of {data.dt:g} s")
    notes = (*found.notes, *told, *frame_notes(pairs, data.ship, data.dt))
    return replace(spec, matched=Matched({run: tuple(parts) for run, parts in runs.items()}, notes))
