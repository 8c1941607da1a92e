"""What is wrong, before any name: where the plain model's error is, whether its residuals are white, and what the missing force follows."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from .outcome import Trace, Wrong

CHANNELS = ("position", "heading", "surge", "sway", "yaw rate")
AXES = ("surge", "sway", "yaw")
_AXES_OF = {"position": (0, 1), "heading": (2,), "surge": (0,), "sway": (1,), "yaw rate": (2,)}
_UNITS = {"heading": "deg", "speed": "m/s", "drift angle": "deg", "rudder": "deg", "yaw rate": "deg/s", "revolutions": "rpm", "time": "s", "run": ""}
_PERMUTATIONS = 99
_LEVEL = 0.02
_LAGS = 10
_SMALLEST_SHARE = 0.05


@dataclass(frozen=True)
class ErrorTables:
    """The figures behind the lines.

    share: of the normalised squared error per channel. by: variable -> list of (from, to, root mean square of the normalised error, samples).
    follows: per axis of the force, (variable, R^2, p) best first. white: channel -> (Ljung-Box statistic over its 95 % limit). inputs: (channel,
    input) ->
    greatest cross-correlation over its 95 % bound.
    """

    share: dict[str, float]
    by: dict[str, list[tuple[float, float, float, int]]]
    follows: dict[str, list[tuple[str, float, float]]]
    white: dict[str, float]
    inputs: dict[tuple[str, str], float]


def variables(trace: Trace) -> dict[str, np.ndarray]:
    """What errors and forces are held against, (B, K + 1): units m/s, deg, deg/s, rpm, s, number of the run."""
    psi, u, v, r = np.moveaxis(trace.measured[..., 2:], -1, 0)
    n, delta = trace.inputs[..., 0], trace.inputs[..., 1]
    t = np.broadcast_to(trace.start[:, None] + trace.t[None, :], psi.shape)
    return {
        "heading": np.rad2deg(psi) % 360.0, "speed": np.hypot(u, v), "drift angle": np.rad2deg(np.arctan2(-v, np.maximum(np.abs(u), 0.05))),
        "rudder": np.rad2deg(delta), "yaw rate": np.rad2deg(r), "revolutions": n, "time": t,
        "run": np.broadcast_to(trace.run[:, None].astype(float), psi.shape),
    }  # fmt: skip


def normalised_error(trace: Trace) -> np.ndarray:
    """Squared error per channel (B, K + 1, 5) over the variance of the channel in the measurement (position: about each run's mean)."""
    error = trace.before - trace.measured
    error[:, 0] = np.nan  # the first sample was given
    spread = np.nanvar(trace.measured, axis=(0, 1))
    about = trace.measured[..., :2] - np.nanmean(trace.measured[..., :2], axis=1, keepdims=True)
    place = max(float(np.nanmean(np.sum(about**2, axis=-1))), 1e-12)
    squares = [np.sum(error[..., :2] ** 2, axis=-1) / place]
    squares += [error[..., i] ** 2 / max(float(spread[i]), 1e-12) for i in range(2, 6)]
    return np.stack(squares, axis=-1)


def error_tables(trace: Trace, seed: int = 0) -> ErrorTables:
    """All tables; a variable's R^2 is tested by giving the runs each other's force."""
    squares = normalised_error(trace)
    total = np.nansum(squares, axis=(0, 1))
    share = dict(zip(CHANNELS, (total / max(float(total.sum()), 1e-300)).tolist(), strict=True))
    whole = np.sum(squares, axis=-1)
    by = {"horizon": _slices(np.broadcast_to(trace.t[None, :], whole.shape), whole, _horizons(trace.t))}
    for name, x in variables(trace).items():
        edges = np.arange(0.0, 361.0, 45.0) if name == "heading" else _quantiles(x)
        by[name] = _slices(x, whole, edges)
    every = max(1, round(float(trace.knots[1] - trace.knots[0]) / float(trace.t[1] - trace.t[0]))) if len(trace.knots) > 1 else 1
    follows = _follows(trace, every, np.random.default_rng(seed))
    return ErrorTables(share, by, follows, _whiteness(trace), _against_inputs(trace))


def what_is_wrong(trace: Trace) -> tuple[Wrong, ...]:
    """One line for every channel with more than 5 % of the normalised error, greatest first."""
    tables = error_tables(trace)
    lines = []
    for channel, share in sorted(tables.share.items(), key=lambda item: -item[1]):
        if share < _SMALLEST_SHARE:
            continue
        known = [f for axis in _AXES_OF[channel] for f in tables.follows[AXES[axis]] if f[2] <= _LEVEL]
        depends = max(known, key=lambda f: f[1])[0] if known else ""
        lines.append(Wrong(channel, float(share), depends, _when(tables, depends)))
    return tuple(lines)


def _when(tables: ErrorTables, variable: str) -> str:
    """Where the error is greatest, in words."""
    growth = tables.by["horizon"]
    text = []
    if len(growth) > 1 and growth[0][2] > 0:
        text.append(f"grows {growth[-1][2] / growth[0][2]:.1f} times from {growth[0][1]:.0f} to {growth[-1][1]:.0f} s of prediction")
    rows = tables.by.get(variable, [])
    if len(rows) > 1:
        worst, least = max(rows, key=lambda r: r[2]), min(rows, key=lambda r: r[2])
        ratio = worst[2] / max(least[2], 1e-12)
        where = f"{worst[0]:.3g} to {worst[1]:.3g} {_UNITS[variable]}".strip()
        text.append(f"worst at {variable} {where} ({ratio:.1f} times the least)")
    return "; ".join(text)


def _horizons(t: np.ndarray) -> np.ndarray:
    known = [h for h in (10.0, 30.0, 60.0, 120.0) if h < t[-1]]
    return np.array([0.0, *known, float(t[-1]) + 1e-9])


def _quantiles(x: np.ndarray) -> np.ndarray:
    values = x[np.isfinite(x)]
    return np.unique(np.quantile(values, np.linspace(0.0, 1.0, 6))) if len(values) else np.array([0.0, 1.0])


def _slices(x: np.ndarray, squares: np.ndarray, edges: np.ndarray) -> list[tuple[float, float, float, int]]:
    rows = []
    for i, (a, b) in enumerate(pairwise(edges)):
        inside = (x >= a) & ((x < b) | (i == len(edges) - 2)) & np.isfinite(squares)
        if inside.any():
            rows.append((float(a), float(b), float(np.sqrt(np.mean(squares[inside]))), int(inside.sum())))
    return rows


def _basis(name: str, x: np.ndarray) -> np.ndarray:
    if name == "heading":
        psi = np.deg2rad(x)
        return np.stack([f(k * psi) for k in (1, 2) for f in (np.cos, np.sin)], axis=-1)
    spread = max(float(np.nanstd(x)), 1e-12)
    z = (x - np.nanmean(x)) / spread
    return np.stack([z, z * z, z * np.abs(z)], axis=-1)


def _follows(trace: Trace, every: int, rng: np.random.Generator) -> dict[str, list[tuple[str, float, float]]]:
    """R^2 of the force on each variable, and the share of permutations of the runs that reach it."""
    found: dict[str, list[tuple[str, float, float]]] = {}
    B = len(trace.run)
    orders = [rng.permutation(B) for _ in range(_PERMUTATIONS)]
    values = {k: v[:, ::every][:, : trace.force.shape[1]] for k, v in variables(trace).items()}
    for j, axis in enumerate(AXES):
        force = trace.force[..., j]
        rows = []
        for name, x in values.items():
            if B < 3 and name == "run":
                continue
            basis = _basis(name, x)
            own = _r2(basis, force)
            shuffled = sum(_r2(basis, force[order]) >= own for order in orders) if B > 2 else _PERMUTATIONS
            rows.append((name, own, (1 + shuffled) / (1 + _PERMUTATIONS)))
        found[axis] = sorted(rows, key=lambda r: -r[1])
    return found


def _r2(basis: np.ndarray, y: np.ndarray) -> float:
    ok = np.isfinite(basis).all(axis=-1) & np.isfinite(y)
    if ok.sum() < 3 * basis.shape[-1]:
        return 0.0
    A, b = basis[ok] - basis[ok].mean(axis=0), y[ok] - y[ok].mean()
    left = b - A @ np.linalg.lstsq(A, b, rcond=None)[0]
    return float(1.0 - np.sum(left**2) / max(float(np.sum(b**2)), 1e-300))


def _correlation(a: np.ndarray, b: np.ndarray, lag: int) -> tuple[float, int]:
    """Correlation of a(t + lag) with b(t) inside runs, and the number of pairs."""
    x, y = a[:, lag:], b[:, : a.shape[1] - lag]
    ok = np.isfinite(x) & np.isfinite(y)
    if ok.sum() < 10:
        return 0.0, 0
    x, y = x[ok] - x[ok].mean(), y[ok] - y[ok].mean()
    return float(np.sum(x * y) / max(float(np.sqrt(np.sum(x**2) * np.sum(y**2))), 1e-300)), int(ok.sum())


def _whiteness(trace: Trace) -> dict[str, float]:
    """Ljung & Box (1978), over its 95 % limit: below one the residual is white as far as can be told."""
    from scipy.stats import chi2

    found = {}
    for i, name in enumerate(("x", "y", "heading", "surge", "sway", "yaw rate")):
        statistic = 0.0
        for lag in range(1, _LAGS + 1):
            rho, num = _correlation(trace.white[..., i], trace.white[..., i], lag)
            statistic += rho**2 * num
        found[name] = float(statistic / chi2.ppf(0.95, _LAGS))
    return found


def _against_inputs(trace: Trace) -> dict[tuple[str, str], float]:
    """Greatest cross-correlation of residuals with past inputs over its 95 % bound (for white residuals)."""
    found = {}
    for i, name in enumerate(("x", "y", "heading", "surge", "sway", "yaw rate")):
        for j, label in enumerate(("revolutions", "rudder", "bow thruster", "stern thruster")):
            if not np.any(np.nan_to_num(trace.inputs[..., j])):
                continue
            pairs = [_correlation(trace.white[..., i], trace.inputs[..., j], lag) for lag in range(_LAGS)]
            found[(name, label)] = max(abs(rho) * np.sqrt(max(num, 1)) / 1.96 for rho, num in pairs)
    return found
