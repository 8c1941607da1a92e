"""Sign of the turn under the recorded rudder: it shows a reversed rudder, and a mirrored heading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..records import Dataset, Run
from ..signals import DELTA, F_B, F_S, N, R, U
from .statistics import stretches
from .thresholds import THRESHOLDS


@dataclass(frozen=True)
class Side:
    """Sign of the turn: +1 where the recorded rudder turns the recorded yaw rate to its own side, -1 to the other, 0
    where it is not clear."""

    sign: float = 0.0
    evidence: str = ""


def rudder_side(dataset: Dataset, runs: Sequence[Run], unit: float) -> Side:
    """Side to which the ship turns under a rudder, ahead and without thrusters.

    It must show in clear turns and just after the rudder: r(t + 8 s) - r(t) against delta(t), given r(t). On a straight
    course the rudder responds to the motion, which alone would mislead. unit: of the recorded yaw rate, over rad/s.
    """
    froude = (dataset.ship.L / 130.0) ** 0.5
    times = THRESHOLDS.value("response_time"), THRESHOLDS.value("window")
    ahead, width = (max(1, round(seconds * froude / dataset.dt)) for seconds in times)
    rows, turns = [], []
    for S in (run.states for run in runs):
        idle = (
            (S[:, F_B] == 0.0) & (S[:, F_S] == 0.0) & (S[:, U] * np.sign(np.median(S[:, U])) > 0.0) & (S[:, N] >= 0.0)
        )
        for a, b in stretches(idle):
            at = np.arange(a, b - ahead, max(1, ahead // 2))
            if len(at):
                block = np.stack([S[at + ahead, R] - S[at, R], S[at, R], S[at, DELTA]], axis=-1)
                rows.append(block - block.mean(axis=0))
            at = np.arange(a + ahead, b - width, max(1, width // 2))
            turned, helm = (np.concatenate([[0.0], np.cumsum(S[:, channel])]) for channel in (R, DELTA))
            turns.append(
                np.stack(
                    [
                        (turned[at + width] - turned[at]) * dataset.dt,
                        (helm[at + width - ahead] - helm[at - ahead]) / width,
                    ],
                    axis=-1,
                )
            )
    turn, helm = np.concatenate(turns).T if turns else np.zeros((2, 0))
    clear = np.abs(turn) > np.deg2rad(THRESHOLDS.value("least_turn")) * unit
    turn, helm = turn[clear], helm[clear]
    if len(turn) < THRESHOLDS.count("occurrences") or not np.any(helm):
        return Side()
    likeness = float(turn @ helm / np.sqrt((turn @ turn) * (helm @ helm)))
    slope, sd = _slopes(np.concatenate(rows))
    sign = float(np.sign(likeness))
    if abs(likeness) < THRESHOLDS.value("most") or slope[0] * sign < THRESHOLDS.value("beyond_noise") * sd:
        return Side()
    against = int(np.sum(turn * helm < 0.0))
    text = (
        f"In {against} of {len(turn)} turns the ship turns against the recorded rudder (correlation "
        f"{likeness:.2f}). The rudder sign looks reversed."
    )
    return Side(sign, text)


def _slopes(block: np.ndarray) -> tuple[np.ndarray, float]:
    """Slopes of column 0 on column 2, on column 1, as (slope, the first one's standard error)."""
    A, y = block[:, [2, 1]], block[:, 0]
    G = A.T @ A + 1e-12 * np.trace(A.T @ A) * np.eye(2)
    slope = np.linalg.solve(G, A.T @ y)
    variance = float(np.mean((y - A @ slope) ** 2))
    return slope, float(np.sqrt(2.0 * variance * np.linalg.inv(G)[0, 0])) + 1e-300
