"""Sea trials to diagnose: runs of mixed manoeuvres (steps, zig-zags, turns, engine commands, thruster pushes), on any
MMG ship."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..physics.mmg import MMGShip
from ..records import Dataset, Run
from ..signals import COMMANDS
from .hidden import Hidden, Vessel, record, sail
from .manoeuvres import self_propulsion_rpm
from .simulator import Simulator

NOISE = np.array([0.5, 0.5, np.deg2rad(0.3), 0.05, 0.05, np.deg2rad(0.05), 0.5, np.deg2rad(0.2), 0.01, 0.01])
"""Standard deviations on a 130 m ship: 0.5 m, 0.3 deg, 0.05 m/s, 0.05 deg/s, 0.5 rpm, 0.2 deg, 1 % of the thruster
force."""

WAVES, WAVE_PERIOD = (0.15, 0.2, np.deg2rad(0.35)), 8.0
"""Motion in waves of a 130 m ship: standard deviations in surge and sway [m] and yaw [rad], peak period [s]."""

_FROUDE = np.array([1.0, 1.0, 0.0, 0.5, 0.5, -0.5, -0.5, 0.0, 0.0, 0.0])
_WARM_UP = 60
CRUISE = 4.5
"""Speed [m/s] of the trials on a 130 m ship, where one is needed for orientation; runs begin at 0.45 to 1.25 of it."""


STANDARD = (
    ("turn", 35.0), ("turn", -35.0), ("zig-zag", 10.0), ("zig-zag", -10.0), ("zig-zag", 20.0), ("zig-zag", -20.0),
    ("stop", 0.0), ("pull-out", 25.0),
    ("turn", 15.0), ("turn", -15.0),
)  # fmt: skip
"""Manoeuvres of a yard's trials (IMO MSC.137(76)), with the rudder in degrees."""
_QUICK_LEG, _SLOW_LEG = 45.0, 65.0


@dataclass(frozen=True)
class Trials:
    """Plan of trials: number of runs, samples after the first, gusts (standard deviation per axis [m/s] on a 130 m
    ship; 0: calm), noise factor, whether runs go astern and use thrusters, motion in waves, as a factor of `WAVES`, the
    mean wind under the gusts (from north and from east [m/s] on a 130 m ship), and whether the runs are `STANDARD`
    manoeuvres from cruising speed on opposite courses."""

    runs: int = 24
    samples: int = 120
    gusts: float = 1.5
    noise: float = 1.0
    astern: bool = True
    thrusters: bool = True
    waves: float = 0.0
    wind: tuple[float, float] = (0.0, 0.0)
    standard: bool = False


def standard_commands(rpm: np.ndarray, steps: int, dt: float, scale: float) -> np.ndarray:
    """Commands (runs, steps, 4) of `STANDARD` in turn, from 20 s on: a turn lasts, a zig-zag reverses six times by the
    clock, a pull-out ends after 200 s, a stop is commanded with 0.6 of the shaft speed astern. Times at 130 m."""
    U, t = np.zeros((len(rpm), steps, 4)), np.arange(steps) * dt / scale - 20.0
    for i, (kind, degrees) in enumerate(STANDARD[k % len(STANDARD)] for k in range(len(rpm))):
        leg = np.floor(t / (_SLOW_LEG if abs(degrees) > 15.0 else _QUICK_LEG) + 0.5)  # the first one half as long
        side = {"zig-zag": np.where(leg < 7, (-1.0) ** leg, 0.0), "pull-out": np.where(t < 200.0, 1.0, 0.0)}.get(
            kind, 1.0
        )
        U[i, :, 0] = np.where((t >= 0.0) & (kind == "stop"), -0.6, 1.0) * rpm[i]
        U[i, :, 1] = np.where(t >= 0.0, np.deg2rad(degrees) * side, 0.0)
    return U


def draw_commands(
    rng: np.random.Generator, ship: Vessel, speed: np.ndarray, rpm: np.ndarray, steps: int, dt: float, plan: Trials
) -> np.ndarray:
    """Commands (runs, steps, 4): a third of the runs zig-zags by the clock, a third turns, a third random steps; engine
    commands in half of them."""
    num, scale = len(speed), (ship.L / 130.0) ** 0.5
    U, t = np.zeros((num, steps, 4)), np.arange(steps) * dt / scale
    force = ship.particulars.thrusters.max_force if ship.particulars.thrusters else 0.0
    for i in range(num):
        amplitude = np.deg2rad(rng.choice([5.0, 10.0, 15.0, 20.0, 30.0, 35.0]))
        side = rng.choice([-1.0, 1.0])
        start = rng.uniform(0.0, 25.0)
        if i % 3 == 0:
            wave = np.floor((t - start) / rng.uniform(18.0, 40.0))
            U[i, :, 1] = np.where(t < start, 0.0, side * amplitude * np.where(wave % 2 == 0, 1.0, -1.0))
        elif i % 3 == 1:
            stop = rng.uniform(60.0, 200.0)
            U[i, :, 1] = np.where((t > start) & (t < stop), side * amplitude, 0.0)
        else:
            edges = np.cumsum(rng.uniform(6.0, 30.0, 60))
            U[i, :, 1] = np.deg2rad(rng.uniform(-25.0, 25.0, 61))[np.searchsorted(edges, t)] * (t > start)
        orders = rng.choice([0.5, 0.8, 1.0, 1.25, 1.5], 61) if rng.random() < 0.5 else np.ones(61)
        U[i, :, 0] = rpm[i] * orders[np.searchsorted(np.cumsum(rng.uniform(25.0, 60.0, 60)), t)]
        if plan.astern and i % 8 == 5:
            U[i, t > rng.uniform(20.0, 60.0), 0] = -0.8 * rpm[i]
        if plan.thrusters and force and i % 4 == 2:
            pulse = rng.uniform(10.0, 60.0)
            U[i, (t > pulse) & (t < pulse + 45.0), 2] = side * rng.uniform(0.4, 1.0) * force
            if i % 8 == 2:
                U[i, (t > pulse + 20.0) & (t < pulse + 60.0), 3] = -side * rng.uniform(0.4, 1.0) * force
    return U


def gusts(
    rng: np.random.Generator,
    num: int,
    steps: int,
    dt: float,
    sigma: float,
    tau: float,
    mean: tuple[float, float] = (0.0, 0.0),
) -> np.ndarray:
    """Ornstein-Uhlenbeck wind vectors about a mean (from north, from east) as (speed, from), (num, steps, 2)."""
    keep = np.exp(-dt / tau)
    wind = np.empty((num, steps, 2))
    wind[:, 0] = sigma * rng.standard_normal((num, 2))
    for k in range(1, steps):
        wind[:, k] = keep * wind[:, k - 1] + sigma * np.sqrt(1.0 - keep * keep) * rng.standard_normal((num, 2))
    wind += mean
    return np.stack([np.hypot(wind[..., 0], wind[..., 1]), np.arctan2(wind[..., 1], wind[..., 0])], axis=-1)


def in_waves(rng: np.random.Generator, states: np.ndarray, dt: float, scale: float, size: float) -> np.ndarray:
    """States (runs, samples, 10) with first-order motion in waves on top: surge, sway and yaw by themselves, each a sum
    of 25 sines with random phases and the spectrum of Pierson & Moskowitz (J. Geophys. Res. 69 (1964) 5181); velocities
    are their rates."""
    ratio = np.linspace(0.75, 1.5, 25)
    omega, share = 2.0 * np.pi / (WAVE_PERIOD * scale) * ratio, ratio**-5 * np.exp(-1.25 * ratio**-4)
    phase = dt * np.arange(states.shape[1])[:, None] * omega + rng.uniform(
        0.0, 2.0 * np.pi, (3, len(states), 1, len(omega))
    )
    amplitude = size * np.array(WAVES) * [scale**2, scale**2, 1.0]
    waves = np.sqrt(2.0 * share / share.sum())
    (surge, sway, yaw), rates = (
        amplitude[:, None, None] * v for v in (np.sin(phase) @ waves, np.cos(phase) @ (omega * waves))
    )
    c, s = np.cos(states[..., 2]), np.sin(states[..., 2])
    moved = states.copy()
    moved[..., :6] += np.stack([c * surge - s * sway, s * surge + c * sway, yaw, *rates], axis=-1)
    return moved


@dataclass(frozen=True)
class Sailing:
    """Commands of one set of trials, warm-up included: scale is sqrt(L/130), s0 (runs, 10), U (runs, steps, 4),
    max_step [s]."""

    scale: float
    dt: float
    s0: np.ndarray
    U: np.ndarray

    @property
    def max_step(self) -> float:
        return 0.5 * min(1.0, self.scale)


def draw_sailing(
    rng: np.random.Generator,
    ship: Vessel,
    plan: Trials,
    rpm: float,
    cruise: float | None = None,
    ratios: tuple[float, float] = (0.45, 1.25),
) -> Sailing:
    """Places, speeds and commands of `plan`; `rpm` holds the cruising speed (default 4.5 m/s at 130 m), runs begin at
    `ratios` of it.

    One sample per second at 130 m, less for much smaller ships.
    """
    scale = (ship.L / 130.0) ** 0.5
    dt = float(f"{scale:.2g}") if scale < 0.5 else 1.0
    cruise = CRUISE * scale if cruise is None else cruise
    ratio = rng.uniform(*((0.98, 1.02) if plan.standard else ratios), plan.runs)
    s0 = np.zeros((plan.runs, 10))
    s0[:, :2] = rng.uniform(-600.0, 600.0, (plan.runs, 2)) * ship.L / 130.0
    s0[:, 2], s0[:, 3], s0[:, 6] = rng.uniform(-np.pi, np.pi, plan.runs), cruise * ratio, rpm * ratio
    U = np.zeros((plan.runs, plan.samples + _WARM_UP, 4))
    U[..., 0] = (rpm * ratio)[:, None]
    if plan.standard:
        s0[:, 2] = rng.uniform(-np.pi, np.pi) + np.pi * (
            np.arange(plan.runs) // 2 % 2
        )  # to port and to starboard on the same course
        U[:, _WARM_UP:] = standard_commands(rpm * ratio, plan.samples, dt, scale)
    else:
        U[:, _WARM_UP:] = draw_commands(rng, ship, s0[:, 3], rpm * ratio, plan.samples, dt, plan)
    # in the warm-up a pilot keeps the heading roughly: small random helm
    U[:, :_WARM_UP, 1] = np.repeat(np.deg2rad(rng.uniform(-4.0, 4.0, (plan.runs, _WARM_UP // 15))), 15, axis=1)
    return Sailing(scale, dt, s0, U)


def write_down(
    ship: Vessel,
    sailing: Sailing,
    S: np.ndarray,
    hidden: Sequence[Hidden],
    plan: Trials,
    rng: np.random.Generator,
    name: str,
    source: str,
) -> Dataset:
    """Data set of the true states S (runs, steps + 1, 10): the warm-up cut off, motion in waves, the sensors' errors
    and noise added."""
    noise = plan.noise * NOISE * (ship.L / 130.0) ** _FROUDE
    S = S[:, _WARM_UP:]
    if plan.waves:
        S = in_waves(rng, S, sailing.dt, sailing.scale, plan.waves)
    S = record(S, sailing.dt, hidden, noise, rng)
    U, t = sailing.U[:, _WARM_UP:], np.arange(plan.samples + 1) * sailing.dt
    U = np.concatenate([U, U[:, -1:]], axis=1)
    runs = tuple(Run(f"run{i:02d}", t, S[i], U[i], COMMANDS) for i in range(plan.runs))
    return Dataset(name=name, ship=ship.particulars, dt=sailing.dt, runs=runs, actuators="measured", source=source)


def sea_trials(
    ship: MMGShip,
    seed: int,
    hidden: Sequence[Hidden] = (),
    plan: Trials | None = None,
    name: str = "trials",
    wind_recorded: bool = False,
) -> Dataset:
    """Sail and record a set of runs with `hidden` causes; one sample per second at 130 m, scaled with sqrt(L) for much
    smaller ships.

    The runs begin after a warm-up under the same causes, until currents and winds have taken effect. wind_recorded: the
    gusts become the input channels wind_speed and wind_from.
    """
    plan = plan or Trials()
    rng = np.random.default_rng(seed)
    sailing = draw_sailing(rng, ship, plan, self_propulsion_rpm(Simulator(ship), CRUISE * (ship.L / 130.0) ** 0.5))
    scale, dt = sailing.scale, sailing.dt
    mean = (plan.wind[0] * scale, plan.wind[1] * scale)
    wind = (
        gusts(rng, plan.runs, sailing.U.shape[1], dt, plan.gusts * scale, 20.0 * scale, mean)
        if plan.gusts or any(mean)
        else None
    )
    S = sail(ship, sailing.s0, sailing.U, dt, hidden, wind, max_step=sailing.max_step)
    data = write_down(ship, sailing, S, hidden, plan, rng, name, f"shipbench sea trials of {ship.name}, seed {seed}")
    if not wind_recorded or wind is None:
        return data
    felt = np.concatenate([wind[:, _WARM_UP:], wind[:, -1:]], axis=1)
    names = (*COMMANDS, "wind_speed", "wind_from")
    return data.with_runs(
        replace(run, inputs=np.column_stack([run.inputs, w]), inputs_names=names)
        for run, w in zip(data.runs, felt, strict=True)
    )
