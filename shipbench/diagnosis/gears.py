"""Causes between command and actuator, looked for where both are recorded: every actuator alone, without the ship's motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ..physics.actuators import Gear, gear_path
from .plant import Plant, ordinary_gears

_ACTUATORS = {"n": (0,), "delta": (1,), "F": (2, 3)}
_RATE_POWER = {"n": 2, "delta": 1, "F": 0}
_EVALUATIONS, _SCAN = 200, 30


@dataclass(frozen=True)
class Ordinary:
    """What an ordinary gear may be, at 130 m: greatest time constant [s] and smallest rate [actuator's unit per s]."""

    T: float
    rate: float


ORDINARY = {"n": Ordinary(12.0, 2.0), "delta": Ordinary(2.0, np.deg2rad(1.9)), "F": Ordinary(4.5, 0.0)}
"""Shaft as for slow Diesels; rudder as SOLAS II-1 reg. 29 asks (65 deg in 28 s, 2.3 deg/s) less a margin; thrusters as for electric tunnels."""


@dataclass(frozen=True)
class GearFinding:
    """An effect of a gear. score: 2 log likelihood ratio against the best ordinary gear, samples discounted for their correlation, less log(10 N) for
    the added value; value: of the effect's parameter, ci95; per_run (N,)."""

    effect: str
    score: float
    value: float
    ci95: tuple[float, float]
    per_run: np.ndarray
    actuator: str
    gear: Gear


@dataclass(frozen=True)
class _Kind:
    """An effect of one actuator: bounds of its value in the gear, and how a gear takes it; `beyond` is subtracted when it is reported."""

    effect: str
    field: str
    low: float
    high: float
    beyond: float = 0.0

    @property
    def at(self) -> int:
        """Where its value stands beside time constant and rate, or in place of one of them."""
        return {"T": 0, "rate": 1}.get(self.field, 2)


def _least_rate(actuator: str, scale: float) -> float:
    """Least rate of an ordinary gear, by Froude's law; a full-scale rudder under 130 m need be no faster (SOLAS)."""
    if actuator == "delta" and scale > 0.4:
        scale = max(scale, 1.0)
    return ORDINARY[actuator].rate / scale ** _RATE_POWER[actuator]


def _kinds(actuator: str, scale: float, span: float, ordinary: Gear) -> list[_Kind]:
    """What may be wrong with an actuator; `span` is the range of its commands. Nothing smaller than a fiftieth of it is looked for."""
    T, rate = ORDINARY[actuator].T * scale, _least_rate(actuator, scale)
    lag = _Kind({"n": "shaft_lag", "delta": "rudder_lag", "F": "thruster_lag"}[actuator], "T", T, 60.0 * scale, ordinary.T)
    if actuator == "n":
        return [lag, _Kind("shaft_rate_limit", "rate", 0.02 * rate, rate)]
    if actuator == "F":
        return [lag]
    return [
        lag,
        _Kind("rudder_rate_limit", "rate", 0.02 * rate, rate),
        _Kind("rudder_delay", "delay", 0.15 * scale, 10.0 * scale),
        _Kind("rudder_deadband", "deadband", 0.02 * span, 0.3 * span),
        _Kind("rudder_backlash", "backlash", 0.02 * span, 0.3 * span),
    ]


def find_in_gears(plant: Plant) -> tuple[list[GearFinding], dict[str, Gear]]:
    """Findings of every actuator that moves, best first, and the best ordinary gears; nothing where only commands are recorded."""
    gears = ordinary_gears(plant.c.L)
    if plant.seg.commanded:
        return [], gears
    found: list[GearFinding] = []
    for name, channels in _ACTUATORS.items():
        rows = range(len(plant.seg.run))
        picked = [(b, c) for c in channels for b in rows if np.ptp(plant.seg.commands[b, plant.seg.mask[b], c]) > 0]
        if len({plant.seg.run[b] for b, _ in picked}) > 1:
            some, gears[name] = _of_actuator(plant, name, np.array(picked))
            found += some
    return sorted(found, key=lambda f: -f.score), gears


def _of_actuator(plant: Plant, name: str, picked: np.ndarray) -> tuple[list[GearFinding], Gear]:
    seg, scale, (b, c) = plant.seg, (plant.c.L / 130.0) ** 0.5, picked.T
    command, measured, mask, run = seg.commands[b, :-1, c], seg.states[b, :, 6 + c], seg.mask[b, 1:], seg.run[b]
    span = float(np.percentile(np.abs(command), 98))
    rate = max(_least_rate(name, scale), 0.01 * span / seg.dt)
    low, high = np.log([0.02 * scale, rate]), np.log([ORDINARY[name].T * scale, max(10.0 * span / seg.dt, 2.0 * rate)])

    def gear_of(z: np.ndarray, kind: _Kind | None) -> Gear:
        gear = Gear(float(np.exp(z[0])), float(np.exp(z[1])))
        return gear if kind is None else replace(gear, **{kind.field: float(np.exp(z[kind.at]))})

    def residual(z: np.ndarray, kind: _Kind | None = None) -> np.ndarray:
        path = gear_path(measured[:, 0], command, seg.dt, gear_of(z, kind))
        return np.where(mask, (measured - path)[:, 1:], 0.0)

    def cost(z: np.ndarray, kind: _Kind | None = None) -> float:
        return float(np.sum(residual(z, kind) ** 2))

    ordinary = _least(cost, low, high)
    plain = residual(ordinary)
    found = []
    for kind in _kinds(name, scale, span, ordinary_gears(plant.c.L)[name]):
        lows, highs = np.resize(low, max(2, kind.at + 1)), np.resize(high, max(2, kind.at + 1))
        lows[kind.at], highs[kind.at] = np.log(kind.low), np.log(kind.high)
        z = _least(partial(cost, kind=kind), lows, highs, ordinary if kind.at == 2 else None)
        rest = residual(z, kind)
        variance, samples = max(float(np.sum(rest**2)) / mask.sum(), 1e-300), float(mask.sum())
        rho = min(max(float(np.sum(rest[:, 1:] * rest[:, :-1]) / np.sum(rest**2)), 0.0), 0.98) if np.any(rest) else 0.0
        discount = (1.0 - rho) / (1.0 + rho)
        per_run = np.zeros(seg.runs)
        np.add.at(per_run, run, discount * np.sum(plain**2 - rest**2, axis=1) / (2.0 * variance))
        score = samples * discount * np.log(max(float(np.sum(plain**2)), 1e-300) / (variance * samples)) - np.log(10.0 * len(np.unique(run)))
        step = np.where(np.arange(len(z)) == kind.at, 0.02, 0.0)
        slope = (residual(z + step, kind) - residual(z - step, kind)) / 0.04
        spread = 1.96 * np.exp(z[kind.at]) * (variance / max(discount * float(np.sum(slope**2)), 1e-300)) ** 0.5
        value = float(np.exp(z[kind.at])) - kind.beyond
        found.append(GearFinding(kind.effect, float(score), value, (value - spread, value + spread), per_run, name, gear_of(z, kind)))
    return found, gear_of(ordinary, None)


def _least(cost: Callable[[np.ndarray], float], low: np.ndarray, high: np.ndarray, plain: np.ndarray | None = None) -> np.ndarray:
    """Minimum inside a box of logarithms of (time constant, rate[, value]).

    The valley is narrow in the rate: it is scanned closely first. With `plain`, the best gear without the value, only the value is scanned.
    """
    from scipy.optimize import minimize

    if plain is None:
        grid = [np.array([a, b]) for a in np.linspace(low[0], high[0], 5)[1:4] for b in np.linspace(low[1], high[1], _SCAN)]
    else:
        grid = [np.append(np.clip(plain, low[:2], high[:2]), c) for c in np.linspace(low[2], high[2], _SCAN)]
    start = min(grid, key=cost)
    simplex = np.clip(
        start + np.vstack([np.zeros(len(low)), np.diag(np.where(start < 0.5 * (low + high), 0.1, -0.1) * np.ones(len(low)))]), low, high
    )
    options = {"maxfev": _EVALUATIONS, "xatol": 1e-3, "fatol": 1e-9, "initial_simplex": simplex}
    return minimize(cost, start, method="Nelder-Mead", bounds=list(zip(low, high, strict=True)), options=options).x
