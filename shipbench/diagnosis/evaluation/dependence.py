"""Dependence of a missing force: the share of its variance that a smooth curve of one variable explains.

The null distribution assigns the runs each other's force.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..result import Trace
from ..thresholds import THRESHOLDS

AXES = ("surge", "sway", "yaw")
UNITS = {
    "heading": "deg", "speed": "m/s", "drift angle": "deg", "rudder": "deg", "yaw rate": "deg/s", "revolutions": "rpm",
    "bow thruster": "kN",
    "stern thruster": "kN", "time": "s", "run": "",
}  # fmt: skip
_SURROGATES, _GRID = 199, 181
"""Number of random forces of the test; points of a curve."""


class Follows(NamedTuple):
    """Dependence of the force of one axis on one variable. share: of the variance, less its expectation under the null;
    p: of the best of all variables under the null."""

    variable: str
    share: float
    p: float


class Curve(NamedTuple):
    """The fitted curve: x in the variable's unit, y and its band (two standard errors, clustered by run) in the force's
    unit; NaN at headings that nobody sailed."""

    x: np.ndarray
    y: np.ndarray
    low: np.ndarray
    high: np.ndarray


def variables(trace: Trace) -> dict[str, np.ndarray]:
    """Variables on which errors and forces may depend, (B, K + 1), in `UNITS`; thrusters only where they are used."""
    psi, u, v, r = np.moveaxis(trace.measured[..., 2:], -1, 0)
    n, delta, F_b, F_s = np.moveaxis(trace.inputs, -1, 0)
    here = np.where(np.isfinite(u), 1.0, np.nan)
    found = {
        "heading": np.rad2deg(psi) % 360.0, "speed": np.hypot(u, v),
        "drift angle": np.rad2deg(np.arctan2(-v, np.maximum(np.abs(u), 0.05))),
        "rudder": np.rad2deg(delta), "yaw rate": np.rad2deg(r), "revolutions": n, "bow thruster": 1e-3 * F_b,
        "stern thruster": 1e-3 * F_s,
        "time": here * (trace.start[:, None] + trace.t[None, :]), "run": here * trace.run[:, None],
    }  # fmt: skip
    return {k: x for k, x in found.items() if "thruster" not in k or np.any(np.nan_to_num(x))}


def at_knots(trace: Trace) -> dict[str, np.ndarray]:
    """Variables at the knots of the force, (B, J)."""
    at = samples_of(trace)
    return {k: x[:, at] for k, x in variables(trace).items()}


def samples_of(trace: Trace) -> np.ndarray:
    """Sample indices (J,) of the knots of the force."""
    return np.clip(np.searchsorted(trace.t, trace.knots - 1e-6), 0, len(trace.t) - 1)


def basis(name: str, x: np.ndarray, reference: np.ndarray | None = None) -> np.ndarray:
    """Smooth functions (..., F) of a variable: two harmonics of the heading, else piecewise linear between quartiles
    (of `reference`)."""
    if name == "heading":
        psi = np.deg2rad(x)
        return np.stack([f(k * psi) for k in (1, 2) for f in (np.cos, np.sin)], axis=-1)
    known = x if reference is None else reference
    edges = np.unique(np.quantile(known[np.isfinite(known)], np.linspace(0.0, 1.0, 5)))
    if len(edges) < 2:
        return np.zeros((*x.shape, 0))
    return np.stack([np.interp(x, edges, np.eye(len(edges))[i]) for i in range(1, len(edges))], axis=-1)


def follows(trace: Trace, seed: int = 0) -> dict[str, list[Follows]]:
    """Dependences of every axis on every variable, greatest share first.

    Under the null the runs have each other's force, shifted circularly in time at random: that keeps the spectrum of
    the force and its variance between runs. p counts the best of all variables.
    """
    values = at_knots(trace)
    y = _centred(trace.force)
    surrogates = _surrogates(trace, y, np.random.default_rng(seed))
    power = np.maximum(np.sum(surrogates**2, axis=(1, 2)), 1e-300)  # (S, 3)
    own_power = np.maximum(np.sum(y**2, axis=(0, 1)), 1e-300)
    names, own, null = [], [], []
    for name, x in values.items():
        Q = _orthonormal(name, x)
        if Q.shape[-1] == 0 or (name == "run" and len(np.unique(trace.run)) < 5):
            continue
        names.append(name)
        own.append(np.sum(np.einsum("bjf,bjc->fc", Q, y) ** 2, axis=0) / own_power)
        null.append(np.sum(np.einsum("bjf,sbjc->sfc", Q, surrogates, optimize=True) ** 2, axis=1) / power)
    if not names:
        return {axis: [] for axis in AXES}
    R2, chance = np.stack(own), np.stack(null)  # (V, 3), (V, S, 3)
    mean = chance.mean(axis=1)
    share = np.clip((R2 - mean) / np.maximum(1.0 - mean, 1e-9), 0.0, 1.0)
    z, z_chance = _standardised(R2, chance)
    p = (1 + np.sum(z_chance.max(axis=0)[None] >= z[:, None] - 1e-9, axis=1)) / (1 + chance.shape[1])
    rows = {
        axis: [Follows(n, float(share[i, j]), float(p[i, j])) for i, n in enumerate(names)]
        for j, axis in enumerate(AXES)
    }
    return {axis: sorted(found, key=lambda f: -f.share) for axis, found in rows.items()}


def _standardised(R2: np.ndarray, chance: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Log odds of the shares (V, 3) and of those under the null (V, S, 3), standardised by the null: comparable over
    all variables, so that one greatest value can be taken."""

    def odds(x: np.ndarray) -> np.ndarray:
        x = np.clip(x, 1e-6, 1.0 - 1e-6)
        return np.log(x / (1.0 - x))

    centre, spread = odds(chance).mean(axis=1), np.maximum(odds(chance).std(axis=1), 1e-3)
    return (odds(R2) - centre) / spread, (odds(chance) - centre[:, None]) / spread[:, None]


def _centred(force: np.ndarray) -> np.ndarray:
    """Values about the mean of all runs; zero where there is none."""
    known = np.isfinite(force)
    filled = np.where(known, force, 0.0)
    return np.where(known, filled - filled.sum(axis=(0, 1)) / np.maximum(known.sum(axis=(0, 1)), 1), 0.0)


def _orthonormal(name: str, x: np.ndarray) -> np.ndarray:
    """Orthonormal columns (B, J, F) that span the curves of a variable without the constant; zero where it is
    missing."""
    known = np.isfinite(x)
    if known.sum() < 20:
        return np.zeros((*x.shape, 0))
    A = basis(name, x[known])
    if A.shape[-1] == 0:
        return np.zeros((*x.shape, 0))
    U, s, _ = np.linalg.svd(A - A.mean(axis=0), full_matrices=False)
    Q = np.zeros((*x.shape, len(s)))
    Q[known] = U * (s > 1e-8 * max(float(s[0]), 1e-300))
    return Q


def _surrogates(trace: Trace, y: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Forces (S, B, J, 3) of other runs, shifted circularly in time."""
    known = np.isfinite(trace.force).all(axis=-1)
    where = [(trace.run == run)[:, None] & known for run in np.unique(trace.run)]
    where = [w for w in where if w.any()]
    parts = [y[w] for w in where]
    out = np.zeros((_SURROGATES, *y.shape))
    for s in range(_SURROGATES):
        for w, source in zip(where, rng.permutation(len(parts)), strict=True):
            turned = np.roll(parts[source], rng.integers(len(parts[source])), axis=0)
            out[s][w] = np.resize(turned, (int(w.sum()), y.shape[-1]))
    return out


def curve(trace: Trace, axis: int, name: str) -> Curve | None:
    """Least-squares curve of the force (mean included) over the middle 96 % of the variable; None where there are too
    few values."""
    x, y = at_knots(trace)[name], trace.force[..., axis]
    known = np.isfinite(x) & np.isfinite(y)
    if known.sum() < 20:
        return None
    A = np.column_stack([np.ones(known.sum()), basis(name, x[known])])
    bread = np.linalg.pinv(A.T @ A, rcond=1e-4)  # two courses do not determine two harmonics
    q = bread @ (A.T @ y[known])
    run = np.broadcast_to(trace.run[:, None], x.shape)[known]
    scores = np.stack([A[run == k].T @ (y[known] - A @ q)[run == k] for k in np.unique(run)])
    cov = bread @ (scores.T @ scores) @ bread
    low, high = (0.0, 360.0) if name == "heading" else np.quantile(x[known], (0.02, 0.98))
    grid = np.linspace(low, high, _GRID)
    G = np.column_stack([np.ones(_GRID), basis(name, grid, x)])
    fitted, half = G @ q, 2.0 * np.sqrt(np.maximum(np.einsum("gi,ij,gj->g", G, cov, G), 0.0))
    if name == "heading":
        apart = (grid[:, None] - np.unique(np.round(x[known])) + 180.0) % 360.0 - 180.0
        fitted[np.min(np.abs(apart), axis=1) > THRESHOLDS.value("heading_sailed")] = np.nan
    return Curve(grid, fitted, fitted - half, fitted + half)


def with_speed(trace: Trace, axis: int, name: str, seed: int = 0) -> float:
    """Ratio of the force's dependence on `name` in the faster half of the samples to that in the slower one.

    The ratio is 1 where it does not differ significantly from 1 (bootstrap over runs, 95 %), where it changes by less
    than half, or with fewer than 8 runs.
    """
    values, known_curve = at_knots(trace), curve(trace, axis, name)
    runs = np.unique(trace.run)
    if known_curve is None or len(runs) < 8 or name in ("speed", "revolutions", "run", "time"):
        return 1.0
    shape = np.interp(values[name], known_curve.x, known_curve.y - np.nanmean(known_curve.y))
    y, speed = trace.force[..., axis], values["speed"]
    known = np.isfinite(shape) & np.isfinite(y) & np.isfinite(speed)
    fast = speed > np.median(speed[known])
    sums = np.zeros((len(runs), 2, 2))  # run; slow, fast; product, square
    for i, run in enumerate(runs):
        for j, half in enumerate((~fast, fast)):
            inside = known & half & (trace.run == run)[:, None]
            sums[i, j] = np.sum(shape[inside] * (y[inside] - y[known].mean())), np.sum(shape[inside] ** 2)

    def ratio(total: np.ndarray) -> np.ndarray:
        slope = total[..., 0] / np.maximum(total[..., 1], 1e-300)
        return slope[..., 1] / np.where(np.abs(slope[..., 0]) > 1e-12, slope[..., 0], np.nan)

    found = float(ratio(sums.sum(axis=0)))
    draws = ratio(sums[np.random.default_rng(seed).integers(len(runs), size=(400, len(runs)))].sum(axis=1))
    low, high = np.nanquantile(draws, (0.025, 0.975))
    least = THRESHOLDS.value("reported_ratio")
    sure = (low > 1.0 and found > least) or (0.0 < found < 1.0 / least and high < 1.0)
    return found if sure and np.isfinite(found) else 1.0
