"""Speed and turning of a calibrated ship against those of her file: coefficients together, as runs identify them.

Single coefficients compensate each other, and a fitted formula that is not the ship's makes them other values. Speed
and turning are what the runs show (docs/calibration.md#sizes-of-calibration).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..signals import DELTA, N, R, U
from .calibration import Calibration
from .coefficients import NUM_BASE, parameters
from .forward import Plant
from .linearisation import Scales
from .rollout import Course, Vessel
from .thresholds import THRESHOLDS

_SETTLED = 300.0
"""Time [s] in which speed and turn become steady, for a ship of 130 m (Froude-scaled)."""
_STEP = 0.05
"""Step of the derivatives by coefficients, in prior standard deviations."""


@dataclass(frozen=True)
class Operation:
    """Shaft speed [rpm], a speed near that of the ship at it [m/s], and rudder angles [rad] of steady turns."""

    rpm: float
    speed: float
    angles: tuple[float, ...]

    @classmethod
    def of(cls, plant: Plant, angles: tuple[float, ...]) -> Operation | None:
        """Median of the runs ahead, and those of the angles that the runs reach; None where no run goes ahead."""
        states = plant.seg.states[plant.seg.mask]
        ahead = states[(states[:, N] > 0.0) & (states[:, U] > 0.0)]
        if not len(ahead):
            return None
        reached = float(np.max(np.abs(states[:, DELTA])))
        rpm, speed = (float(v) for v in np.median(ahead[:, [N, U]], axis=0))
        return cls(rpm, speed, tuple(a for a in angles if a <= reached))


@dataclass(frozen=True)
class Change:
    """Ratio of a quantity of the calibrated ship to that by her file, less 1.

    Attributes:
        relative: the ratio less 1.
        ci95: its 95 % interval.
        spreads: logarithm of the ratio in prior standard deviations.
    """

    relative: float
    ci95: tuple[float, float]
    spreads: float


def changes(plant: Plant, model: Calibration, at: Operation, quantile: float) -> list[Change | None]:
    """Changes of the speed at the shaft speed, and of the steady yaw rate at each rudder angle.

    None stands for a quantity that is not positive with all coefficients near the calibrated ones or those of the file:
    the ship does not turn, or the rollout diverges.

    Args:
        plant: forward model of the runs.
        model: the calibrated ship.
        at: shaft speed and rudder angles.
        quantile: of the normalised error, for the intervals.
    """
    near, form = _STEP * np.eye(NUM_BASE), THRESHOLDS.value("form_of_behaviour")
    sets = np.concatenate([model.base[None], model.base + near, np.zeros((1, NUM_BASE)), near])
    cov, found = model.cov[:NUM_BASE, :NUM_BASE], list[Change | None]()
    for values in _logarithms(plant, sets, at):
        if not np.isfinite(values).all():
            found.append(None)
            continue
        own, file = values[: NUM_BASE + 1], values[NUM_BASE + 1 :]
        slope, prior = (own[1:] - own[0]) / _STEP, (file[1:] - file[0]) / _STEP
        sd, spread = float(np.sqrt(slope @ cov @ slope + form**2)), float(np.linalg.norm(prior * model.widths))
        moved = float(own[0] - file[0])
        low, high = (float(np.expm1(moved + side * quantile * sd)) for side in (-1.0, 1.0))
        found.append(Change(float(np.expm1(moved)), (low, high), abs(moved) / spread))
    return found


def _logarithms(plant: Plant, base: np.ndarray, at: Operation) -> np.ndarray:
    """Logarithms (1 + angles, D) of speed and yaw rates, NaN where they are not positive, for coefficients `base` (D,
    NUM_BASE)."""
    D, sides = len(base), np.array([0.0, *(s * a for a in at.angles for s in (1.0, -1.0))])
    h = 0.15 * plant.c.L**0.5
    K, B = int(np.ceil(_SETTLED * plant.froude / h)), D * len(sides)
    act = np.zeros((2 * K, B, 1, 3, 4))
    act[..., 0], act[K:, ..., 1] = at.rpm, np.tile(sides, D)[None, :, None, None]
    stages = (np.arange(2 * K)[:, None, None, None] + 0.5 * np.arange(3)) * h
    t = np.ascontiguousarray(np.broadcast_to(stages, (2 * K, B, 1, 3)))
    calm = None if plant.seg.wind is None else np.zeros((2 * K, B, 2))
    start = np.zeros((B, 6))
    start[:, U] = at.speed
    p, ship = parameters(Scales(plant), np.repeat(base, len(sides), axis=0))
    motion = Course(Vessel(plant.ship, plant.c), h, t, calm).rolled(start, p, ship, act, np.zeros((2 * K, B, 1, 3, 3)))
    end = motion[:, -1].reshape(D, len(sides), 6)
    starboard, port = (end[:, side::2, R] for side in (1, 2))
    rows = np.column_stack([end[:, 0, U], 0.5 * (starboard - port)]).T
    return np.log(np.where(rows > 0.0, rows, np.nan))
