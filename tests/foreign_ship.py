"""Ship simulator of a structure of its own, and trials of a ship that has one cause which the simulator lacks.

Forces are polynomials of drift angle and yaw rate of the whole ship (Abkowitz 1964, Lectures on ship hydrodynamics),
added masses are factors, steps are Euler's of 0.1 s. It shares no formula with shipbench.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from shipbench.records import Dataset, Run
from shipbench.ship import Ship as Particulars

RHO, L, B, T, CB, D = 1025.0, 118.0, 18.4, 6.3, 0.66, 4.1
FRONTAL, LATERAL, BOW, STERN = 260.0, 1250.0, 0.42 * L, -0.41 * L
COEFFICIENTS = {
    "Xuu": -1.25e-3, "Xvv": -2.2e-3, "Xrr": -3e-4, "Xvr": 3.5e-3, "Xdd": -1.6e-3, "Yv": -0.0148, "Yr": 3.4e-3,
    "Yvvv": -0.045, "Yvvr": 0.01, "Yvrr": -0.012, "Yd": -4.2e-3, "Nv": -4.9e-3, "Nr": -2.6e-3, "Nvvv": 4e-3,
    "Nvvr": -0.011, "Nvrr": 2e-3, "Nrrr": -9e-4, "Nd": 2e-3, "mx": 1.05, "my": 1.85, "Iz": 1.75, "k0": 0.42,
    "k1": -0.36, "wake": 0.24, "deduction": 0.17, "race": 0.55,
}  # fmt: skip
SIZES = {
    "current": 0.4, "wind": 9.0, "rudder_offset": math.radians(2.0), "rudder_gain": 0.3, "thrust_gain": 0.2,
    "added_resistance": 5e-4, "propeller_walk": 0.03, "heading_bias": math.radians(2.0),
    "yaw_rate_bias": math.radians(0.05), "speed_scale": 0.05, "thruster_gain": 0.3, "cross_flow_drag": 0.8,
}  # fmt: skip
"""Causes and their typical sizes: m/s, m/s, rad, shares, a resistance coefficient, a share of the thrust, rad, rad/s,
shares, a drag coefficient."""
_NOISE = np.array([0.15, 0.15, 1.5e-3, 0.02, 0.02, 2.5e-4])
_GUSTS = np.array([3e-3, 3e-3, 5e-5])


@dataclass
class Ship:
    """Coefficients of a ship, and the causes that she has: by name a size, with a direction [rad] for current and
    wind."""

    c: dict[str, float] = field(default_factory=lambda: dict(COEFFICIENTS))
    causes: dict[str, Any] = field(default_factory=dict)

    def accelerations(self, s: np.ndarray) -> np.ndarray:
        """Accelerations (batch, 3) in states (batch, 10)."""
        c, has = self.c, self.causes
        psi, u, v, r, n, delta, bow, stern = (
            s[:, 2],
            s[:, 3],
            s[:, 4],
            s[:, 5],
            s[:, 6] / 60.0,
            s[:, 7],
            s[:, 8],
            s[:, 9],
        )
        speed, to = has.get("current", (0.0, 0.0))
        uw, vw = u - speed * np.cos(to - psi), v - speed * np.sin(to - psi)
        delta = delta + has.get("rudder_offset", 0.0)
        U2 = np.maximum(uw**2 + vw**2, 1e-6)
        ref = np.maximum(np.sqrt(U2), 0.6)
        vp, rp, q = vw / ref, r * L / ref, 0.5 * RHO * L**2
        X = q * ref**2 * (c["Xvv"] * vp**2 + c["Xrr"] * rp**2 + c["Xvr"] * vp * rp) + q * c["Xuu"] * np.abs(uw) * uw
        Y = (
            q
            * ref**2
            * (c["Yv"] * vp + c["Yr"] * rp + c["Yvvv"] * vp**3 + c["Yvvr"] * vp**2 * rp + c["Yvrr"] * vp * rp**2)
        )
        N = q * L * ref**2 * (
            c["Nv"] * vp + c["Nr"] * rp + c["Nvvv"] * vp**3 + c["Nvvr"] * vp**2 * rp + c["Nvrr"] * vp * rp**2
            + c["Nrrr"] * rp**3
        )  # fmt: skip
        ua, turning = (1.0 - c["wake"]) * uw, np.abs(n) > 0.05
        J = np.where(turning, ua / np.where(turning, n, 1.0) / D, 0.0)
        ahead, astern = c["k0"] + c["k1"] * np.clip(J, -0.6, 1.4), 0.62 * (c["k0"] - 0.25 * np.clip(J, -1.4, 0.6))
        thrust = RHO * n * np.abs(n) * D**4 * np.where(n >= 0, ahead, astern) * has.get("thrust_gain", 1.0)
        X = X + (1.0 - c["deduction"]) * thrust
        race = np.where(n > 0, (ua + c["race"] * np.maximum(n * D - ua, 0.0)) ** 2, 0.35 * ua * np.abs(ua))
        lift = 0.5 * np.sin(2.0 * np.clip(delta - 0.275 * (vp - 0.4 * rp), -1.2, 1.2))
        steering = q * np.maximum(race, 0.0) * has.get("rudder_gain", 1.0)
        X, Y, N = (
            X + steering * c["Xdd"] * np.sin(delta) ** 2,
            Y + steering * c["Yd"] * lift,
            N + steering * L * c["Nd"] * lift,
        )
        push = has.get("thruster_gain", 1.0) * np.exp(-0.22 * U2)
        Y, N = Y + push * (bow + stern), N + push * (BOW * bow + STERN * stern)
        X, Y, N = self._beside(X, Y, N, psi, (u, v, r), (uw, vw), n)
        m = RHO * CB * L * B * T
        du, dv = (X / m + v * r) / c["mx"], (Y / m - u * r) / c["my"]
        return np.stack([du, dv, N / (m * (0.25 * L) ** 2) / c["Iz"]], axis=-1)

    def _beside(self, X, Y, N, psi, ground, water, n):
        """Forces with those of the causes that are forces of their own."""
        has, (u, v, r), (uw, vw) = self.causes, ground, water
        X = X - has.get("added_resistance", 0.0) * 0.5 * RHO * L**2 * np.abs(uw) * uw
        walk = has.get("propeller_walk", 0.0) * RHO * n * np.abs(n) * D**4
        x = np.linspace(-0.5, 0.5, 15) * L
        local = vw[:, None] + x * r[:, None]
        drag = -0.5 * RHO * T * has.get("cross_flow_drag", 0.0) * local * np.abs(local) * L / 15
        Y, N = Y + walk + drag.sum(axis=1), N - 0.47 * L * walk + (drag * x).sum(axis=1)
        speed, coming = has.get("wind", (0.0, 0.0))
        along, across = speed * np.cos(coming - psi) + u, speed * np.sin(coming - psi) + v
        angle, q = np.arctan2(across, along), 0.5 * 1.225 * (along**2 + across**2) * ("wind" in has)
        X, Y = X - 0.7 * q * FRONTAL * np.cos(angle), Y - 0.85 * q * LATERAL * np.sin(angle)
        return X, Y, N - 0.09 * q * LATERAL * L * np.sin(2.0 * angle)


def sail(ship: Ship, s0: np.ndarray, U: np.ndarray, dt: float, rng: np.random.Generator | None = None) -> np.ndarray:
    """States (batch, K, 10); with gusts where a generator is given."""
    s, out, gust = s0.astype(float).copy(), [], np.zeros((len(s0), 3))
    keep = math.exp(-dt / 20.0)
    for k in range(U.shape[1]):
        if rng is not None:
            gust = keep * gust + math.sqrt(1.0 - keep**2) * _GUSTS * rng.standard_normal(gust.shape)
        for _ in range(max(1, round(dt / 0.1))):
            h = dt / max(1, round(dt / 0.1))
            rates = ship.accelerations(s) + gust
            psi, u, v, r = (s[:, i].copy() for i in (2, 3, 4, 5))
            s[:, 0] += h * (u * np.cos(psi) - v * np.sin(psi))
            s[:, 1] += h * (u * np.sin(psi) + v * np.cos(psi))
            s[:, 2] += h * r
            s[:, 3:6] += h * rates
            s[:, 6] += h * np.clip((U[:, k, 0] - s[:, 6]) / 6.0, -12.0, 12.0)
            s[:, 7] += h * np.clip((U[:, k, 1] - s[:, 7]) / 1.5, -math.radians(3.0), math.radians(3.0))
            s[:, 8:10] += h * (U[:, k, 2:4] - s[:, 8:10]) / 3.0
        out.append(s.copy())
    return np.stack(out, axis=1)


def simulate(s0: np.ndarray, U: np.ndarray, dt: float) -> np.ndarray:
    """Simulation that lacks every cause, with coefficients that are not quite the ship's."""
    return sail(Ship(), s0, U, dt)


def trial(cause: str | None, seed: int, runs: int = 20, K: int = 120) -> tuple[Dataset, Any]:
    """Measured runs of a ship whose coefficients differ by some 8 % from those of `simulate`, and the size of the
    cause."""
    rng = np.random.default_rng(seed)
    real = Ship({k: v * (1.0 + 0.08 * rng.standard_normal()) for k, v in COEFFICIENTS.items()})
    s0, U = _orders(rng, runs, K)
    value = None if cause is None else _size(cause, rng)
    sensor = cause in ("heading_bias", "yaw_rate_bias", "speed_scale")
    if cause is not None and not sensor:
        real.causes[cause] = value
    S = np.concatenate([s0[:, None], sail(real, s0, U, 1.0, rng)], axis=1)
    if cause == "heading_bias":
        S[..., 2] += value
    if cause == "yaw_rate_bias":
        S[..., 5] += value
    if cause == "speed_scale":
        S[..., 3:5] *= value
    S[..., :6] += _NOISE * rng.standard_normal(S[..., :6].shape)
    held = np.concatenate([U, U[:, -1:]], axis=1)
    about = {
        "name": "foreign", "L": L, "B": B, "T": T, "Cb": CB, "displacement": CB * L * B * T,
        "propeller": {"diameter": D}, "thrusters": {"x_bow": BOW, "x_stern": STERN, "max_force": 150e3},
        "wind": {"frontal_area": FRONTAL, "lateral_area": LATERAL},
    }  # fmt: skip
    made = tuple(Run(f"r{i:02d}", np.arange(K + 1.0), S[i], held[i]) for i in range(runs))
    return Dataset("foreign", Particulars.from_dict(about, "foreign"), 1.0, made), value


def _size(cause: str, rng: np.random.Generator) -> Any:
    size, sign = SIZES[cause] * rng.uniform(0.8, 1.25), rng.choice([-1.0, 1.0])
    if cause in ("current", "wind"):
        return float(size), float(rng.uniform(0.0, 2.0 * np.pi))
    if cause in ("rudder_gain", "thrust_gain", "speed_scale", "thruster_gain"):
        return float(1.0 + sign * size)
    return float(size if cause in ("added_resistance", "cross_flow_drag") else sign * size)


def _orders(rng: np.random.Generator, runs: int, K: int) -> tuple[np.ndarray, np.ndarray]:
    """Starts (runs, 10) and orders (runs, K, 4): turns, zig-zags, stopping, thrusters at low speed, mixed."""
    s0, U = np.zeros((runs, 10)), np.zeros((runs, K, 4))
    for i in range(runs):
        u = rng.uniform(1.0, 6.5)
        rpm = u * rng.uniform(17.0, 21.0)
        s0[i, :4], s0[i, 6], U[i, :, 0] = (*rng.uniform(-200, 200, 2), rng.uniform(-np.pi, np.pi), u), rpm, rpm
        side, kind = rng.choice([-1.0, 1.0]), i % 5
        if kind == 0:
            U[i, 10:, 1] = side * math.radians(rng.uniform(10, 35))
        elif kind == 1:
            period = int(rng.integers(25, 50))
            U[i, :, 1] = side * math.radians(rng.uniform(8, 25)) * np.where((np.arange(K) // period) % 2, 1, -1)
        elif kind == 2:
            U[i, 15:, 0], U[i, 40:, 1] = rng.uniform(-70, -30), math.radians(rng.uniform(-20, 20))
        elif kind == 3:
            s0[i, 3], s0[i, 6], U[i, :, 0] = rng.uniform(0.2, 1.5), 20.0, 20.0 + 30.0 * rng.random()
            for j in (2, 3):
                first = int(rng.integers(0, K // 2))
                U[i, first : first + int(rng.integers(30, 60)), j] = rng.uniform(-120e3, 120e3)
        else:
            for first in range(0, K, 25):
                U[i, first : first + 25, 0] = rpm * rng.uniform(0.6, 1.2)
                U[i, first : first + 25, 1] = math.radians(rng.uniform(-20, 20))
    return s0, U
