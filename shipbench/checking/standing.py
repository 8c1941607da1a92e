"""Check for a rudder or propeller that never moves in the record, though the ship turns or keeps her speed.

A missing column is taken as zero, and a failed sensor gives one value. No model can predict such turns or such headway.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..records import Dataset
from ..signals import DELTA, F_B, F_S, N, R, U
from .finding import Finding
from .recording import Recording
from .statistics import stretches
from .thresholds import THRESHOLDS

_Shown = tuple[str, dict[str, float]]


def standing(dataset: Dataset) -> dict[str, _Shown]:
    """Actuators ("n", "delta") that never move though the ship is driven or turns: name -> words and figures."""
    shown = {"n": _driven(dataset), "delta": _turned(dataset)}
    return {channel: found for channel, found in shown.items() if found is not None}


def _turned(dataset: Dataset) -> _Shown | None:
    delta = np.concatenate([run.states[:, DELTA] for run in dataset.runs])
    if np.ptp(delta) > np.deg2rad(THRESHOLDS.value("least_angle")):
        return None
    turns = np.array([np.sum(part[:-1, R]) * dataset.dt for part in _windows(dataset)])
    least = THRESHOLDS.value("least_turn")
    hard, angle = turns[np.abs(turns) > np.deg2rad(least)], float(np.median(delta))
    held = abs(angle) > np.deg2rad(THRESHOLDS.value("least_turn")) and abs(np.sum(np.sign(hard))) == len(hard)
    if held or len(hard) < _fewest(len(turns)):
        return None
    text = (
        f"The rudder is recorded at {np.rad2deg(angle):.3g} degrees throughout, and the ship turns by more than "
        f"{least:.0f} degrees in {_seconds(dataset):.3g} s, {len(hard)} times in {len(turns)}, ahead and "
        "without thrusters."
    )
    return text, {"turns": len(hard), "windows": len(turns)}


def _driven(dataset: Dataset) -> _Shown | None:
    if any(np.any(run.states[:, N]) for run in dataset.runs):
        return None
    ends = np.array([part[[0, -1], U] for part in _windows(dataset)]).reshape(-1, 2)
    seconds = _seconds(dataset)
    way = ends[:, 0] * seconds
    stopping = THRESHOLDS.value("stopping_length") * dataset.ship.L
    lost, expected = ends[:, 0] - ends[:, 1], ends[:, 0] * way / (way + stopping)
    driven = lost < THRESHOLDS.value("little") * expected
    if np.sum(driven) < _fewest(len(ends)):
        return None
    speed, loss, least = float(np.mean(ends[driven, 0])), float(np.mean(lost[driven])), float(np.mean(expected[driven]))
    text = (
        f"The shaft speed is zero throughout, but the ship keeps her speed, {np.sum(driven)} times in {len(ends)}: "
        f"of {speed:.3g} m/s "
        f"{loss:.2g} m/s are lost in {seconds:.3g} s; without thrust it would be {least:.2g} m/s or more."
    )
    return text, {"lost": loss, "without_thrust": least, "driven": int(np.sum(driven)), "windows": len(ends)}


def _fewest(windows: int) -> float:
    """Least number of windows that show the fault."""
    return max(THRESHOLDS.count("occurrences"), THRESHOLDS.value("large_share") * windows)


def _seconds(dataset: Dataset) -> float:
    return float(THRESHOLDS.value("window") * (dataset.ship.L / 130.0) ** 0.5)


def _windows(dataset: Dataset) -> Iterator[np.ndarray]:
    """States of windows in which the ship has headway and the thrusters are at rest."""
    width = max(2, round(_seconds(dataset) / dataset.dt))
    slowest = THRESHOLDS.value("still_way") * (9.81 * dataset.ship.L) ** 0.5
    for S in (run.states for run in dataset.runs):
        for start, stop in stretches((S[:, U] > slowest) & (S[:, F_B] == 0.0) & (S[:, F_S] == 0.0)):
            for at in range(start, stop - width, width):
                yield S[at : at + width + 1]


def check(recording: Recording) -> list[Finding]:
    """Find actuators that never move; one finding each."""
    todo = {
        "delta": "Give the rudder, or its command as delta_c; without it these turns cannot be predicted.",
        "n": (
            "Give the shaft speed, or its command as n_c; without it speed and the flow at the rudder cannot "
            "be predicted."
        ),
    }
    return [
        Finding("standing", "warning", "actuator never moves", text, "", todo[name], (name,), evidence=figures)
        for name, (text, figures) in standing(recording.dataset).items()
    ]


CHECK = check
