"""Standard manoeuvres on the simulator and their indices (IMO MSC.137(76), ITTC)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import WorkError
from ..metrics.trial_indices import turning_indices
from ..signals import PSI, N, R, U, V
from .simulator import Simulator


@dataclass(frozen=True)
class Turning:
    """Indices of a turning circle in ship lengths, steady values at its end, time of 90 degrees of heading change
    [s]."""

    advance: float
    transfer: float
    tactical_diameter: float
    steady_speed_ratio: float
    steady_r_dash: float
    steady_drift_deg: float
    time_90: float


def straight_state(speed: float, rpm: float, batch: int = 1) -> np.ndarray:
    """States (batch, 10) going north at `speed` [m/s] with the shaft at `rpm`."""
    s = np.zeros((batch, 10))
    s[:, U], s[:, N] = speed, rpm
    return s


def turning_circle(sim: Simulator, speed: float, rpm: float, delta_deg: float, dt: float, duration: float) -> Turning:
    """Turn with the rudder at `delta_deg` (positive starboard) from a straight course.

    Raises:
        WorkError: 180 degrees of heading change are not reached within `duration` [s].
    """
    steps = round(duration / dt)
    command = np.zeros((1, steps, 4))
    command[..., 0], command[..., 1] = rpm, np.deg2rad(delta_deg)
    s0 = straight_state(speed, rpm)
    S = np.concatenate([s0[:, None], sim.rollout(s0, command, dt)], axis=1)[0]
    turned = np.abs(S[:, PSI])
    if not turned[-1] > np.pi:
        raise WorkError(
            f"turning circle: {np.rad2deg(turned[-1]):.0f} deg of heading change after {duration:g} s; 180 are "
            "needed: sail longer."
        )
    L, t, end = sim.ship.L, np.arange(steps + 1) * dt, S[-1]
    advance, transfer, tactical_diameter = turning_indices(S, L)
    speed_end = float(np.hypot(end[U], end[V]))
    return Turning(
        advance=advance,
        transfer=transfer,
        tactical_diameter=tactical_diameter,
        steady_speed_ratio=speed_end / speed,
        steady_r_dash=abs(float(end[R])) * L / speed_end,
        steady_drift_deg=abs(float(np.rad2deg(np.arctan2(-end[V], end[U])))),
        time_90=float(np.interp(np.pi / 2, np.maximum.accumulate(turned), t)),
    )


def zigzag_overshoots(
    sim: Simulator, speed: float, rpm: float, amplitudes_deg: Sequence[float], dt: float, duration: float
) -> np.ndarray:
    """First and second overshoot angles [deg], (Z, 2), of zig-zags that start with the rudder at each of
    `amplitudes_deg` (negative: to port first).

    Raises:
        WorkError: one of them has not reversed its rudder three times within `duration` [s].
    """
    sign, amplitude = np.sign(amplitudes_deg), np.abs(amplitudes_deg)
    num, at = len(sign), np.deg2rad(amplitude)
    state, command = straight_state(speed, rpm, num), np.zeros((num, 4))
    command[:, 0] = rpm
    switches: list[list[int]] = [[] for _ in range(num)]
    headings = [state[:, PSI]]
    for k in range(round(duration / dt)):
        reversals = np.array([len(s) for s in switches])
        if np.all(reversals == 3):
            break
        side = sign * (-1.0) ** reversals  # heading side on which the rudder is reversed next
        turns = (side * state[:, PSI] >= at) & (reversals < 3)
        for i in np.flatnonzero(turns):
            switches[i].append(k)
        command[:, 1] = np.where(turns, -side, side) * at
        state = sim.step(state, command, dt)
        headings.append(state[:, PSI])
    psi, least = np.rad2deg(headings), min(len(s) for s in switches)
    if least < 3:
        raise WorkError(f"zig-zag: only {least} rudder reversals within {duration:g} s; 3 are needed: sail longer.")
    over = [
        [
            np.max(side * psi[first : last + 1, i])
            for side, first, last in zip((sign[i], -sign[i]), s, s[1:], strict=False)
        ]
        for i, s in enumerate(switches)
    ]
    return np.asarray(over) - amplitude[:, None]


def self_propulsion_rpm(sim: Simulator, speed: float) -> float:
    """Shaft speed [rpm] at which the ship holds `speed` [m/s] straight ahead (bisection on the surge acceleration)."""
    from ..physics.mmg import accelerations

    low, high = 0.0, 60_000.0 / sim.ship.propeller.D**0.5
    for _ in range(100):
        middle = 0.5 * (low + high)
        du = accelerations(sim.ship, 0.0, speed, 0.0, 0.0, middle, 0.0, 0.0, 0.0)[0]
        low, high = (middle, high) if du < 0 else (low, middle)
    return 0.5 * (low + high)
