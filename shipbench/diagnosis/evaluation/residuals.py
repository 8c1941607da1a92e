"""Errors of the baseline model, before any cause is identified: their place, whiteness of the residuals, missing
forces."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...estimation.noise import CHANNEL_UNITS, RESIDUALS
from ..result import Trace, Wrong
from ..thresholds import THRESHOLDS
from .dependence import AXES, UNITS, Follows, curve, follows, variables, with_speed

CHANNELS = ("position", "heading", "surge", "sway", "yaw rate")
INPUTS = ("revolutions", "rudder", "bow thruster", "stern thruster")
FORCE_UNITS = (("mm/s^2", 1e3), ("mm/s^2", 1e3), ("mdeg/s^2", 57.29578e3))
LAGS = THRESHOLDS.count("correlation_lags")
_AXES_OF = {"position": (0, 1, 2), "heading": (2,), "surge": (0,), "sway": (1,), "yaw rate": (2,)}


class Slice(NamedTuple):
    """Error inside one range of a variable: root mean square, and number of samples."""

    low: float
    high: float
    rms: float
    samples: int


@dataclass(frozen=True)
class ErrorTables:
    """Figures behind the lines of a report.

    share: of the normalised squared error, per channel. size: root mean square error per channel, in `CHANNEL_UNITS`;
    scale: its divisor. by: variable -> slices of the normalised error of all channels together; by_channel: the same of
    one channel, in its unit. worst_runs: (name, root mean square of the normalised error), greatest first. follows: see
    `follows.follows`. white: residual channel -> Ljung-Box statistic over its 95 % limit. inputs: (residual, input) ->
    greatest correlation over its 95 % bound.
    """

    share: dict[str, float]
    size: dict[str, float]
    scale: dict[str, float]
    by: dict[str, list[Slice]]
    by_channel: dict[tuple[str, str], list[Slice]]
    worst_runs: list[tuple[str, float]]
    follows: dict[str, list[Follows]]
    white: dict[str, float]
    inputs: dict[tuple[str, str], float]


def squared_error(trace: Trace, predicted: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Squared open-loop error (B, K + 1, 5) of `predicted` (B, K + 1, 6) and the scale (5,) that makes channels
    comparable.

    The scale is the variation of the channel inside a run: its root mean square about each segment's own mean, and no
    less than 1 deg of heading (1 deg in a tenth of the horizon for the yaw rate), 2 % of the speed. So one metre is
    never added to one degree.
    """
    with np.errstate(all="ignore"):
        error = (predicted - trace.measured) ** 2
    error = np.where(np.isfinite(error), error, np.nan)
    error[:, 0] = np.nan  # the first sample was given
    squares = np.concatenate([error[..., :2].sum(axis=-1, keepdims=True), error[..., 2:]], axis=-1)
    known = np.isfinite(trace.measured)
    filled = np.where(known, trace.measured, 0.0)
    about = np.where(
        known, filled - filled.sum(axis=1, keepdims=True) / np.maximum(known.sum(axis=1, keepdims=True), 1), 0.0
    )
    spread = np.sum(about**2, axis=(0, 1)) / np.maximum(known.sum(axis=(0, 1)), 1)
    spread = np.append(spread[0] + spread[1], spread[2:])
    speed2 = float(np.sum(filled[..., 3:5] ** 2) / max(known[..., 3].sum(), 1))
    least = np.array([1e-12, 1.0, 4e-4 * speed2, 4e-4 * speed2, (10.0 / max(float(trace.t[-1]), 1e-9)) ** 2])
    least[[1, 4]] *= np.deg2rad(1.0) ** 2
    return squares, np.sqrt(np.maximum(spread, np.maximum(least, 1e-12)))


def error_tables(trace: Trace, seed: int = 0) -> ErrorTables:
    """Tables of errors. Padding with NaN, single runs and few samples are accepted; tables that cannot be computed are
    left out."""
    squares, scale = squared_error(trace, trace.before)
    with np.errstate(over="ignore"):
        normal = squares / scale**2
        total = np.nansum(normal, axis=(0, 1))
    whole = np.sum(normal, axis=-1)
    count = np.maximum(np.isfinite(squares).sum(axis=(0, 1)), 1)
    units = [CHANNEL_UNITS[c][1] for c in CHANNELS]
    size = np.sqrt(np.nansum(squares, axis=(0, 1)) / count)
    by_channel: dict[tuple[str, str], list[Slice]] = {}
    for name, x, edges in _cuts(trace):
        for i, channel in enumerate(CHANNELS):
            by_channel[(channel, name)] = _slices(x, squares[..., i] * units[i] ** 2, edges)
    runs = []
    for k in np.unique(trace.run):
        inside = whole[trace.run == k]
        if np.isfinite(inside).any():
            runs.append((trace.names[int(k)], float(np.sqrt(np.nanmean(inside)))))
    return ErrorTables(
        share=dict(zip(CHANNELS, (total / max(float(total.sum()), 1e-300)).tolist(), strict=True)),
        size={c: float(s * u) for c, s, u in zip(CHANNELS, size, units, strict=True)},
        scale={c: float(s * u) for c, s, u in zip(CHANNELS, scale, units, strict=True)},
        by=slices(trace, trace.before), by_channel=by_channel, worst_runs=sorted(runs, key=lambda r: -r[1]),
        follows=follows(trace, seed),
        white=_whiteness(trace), inputs=_against_inputs(trace),
    )  # fmt: skip


def slices(trace: Trace, predicted: np.ndarray) -> dict[str, list[Slice]]:
    """Normalised error of all channels together, per variable."""
    squares, scale = squared_error(trace, predicted)
    with np.errstate(over="ignore"):
        whole = np.sum(squares / scale**2, axis=-1)
    return {name: _slices(x, whole, edges) for name, x, edges in _cuts(trace)}


def _cuts(trace: Trace) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Variables (B, K + 1) and the edges of their slices."""
    horizon = np.broadcast_to(trace.t[None, :], trace.measured.shape[:2])
    end = float(trace.t[-1])
    found = [("horizon", horizon, np.array([0.0, *(h for h in (10.0, 30.0, 60.0, 120.0, 300.0) if h < end), end]))]
    for name, x in variables(trace).items():
        values = x[np.isfinite(x)]
        if name == "heading":
            edges = np.arange(0.0, 361.0, 45.0)
        elif name == "run":
            edges = np.unique(np.linspace(0, len(trace.names), 7).round()) - 0.5
        else:
            edges = np.unique(np.quantile(values, np.linspace(0.0, 1.0, 6))) if len(values) else np.zeros(1)
        found.append((name, x, edges))
    return found


def _slices(x: np.ndarray, squares: np.ndarray, edges: np.ndarray) -> list[Slice]:
    rows = []
    for i, (a, b) in enumerate(pairwise(edges)):
        inside = (x >= a) & ((x < b) | ((i == len(edges) - 2) & (x <= b))) & np.isfinite(squares)
        if inside.any():
            rows.append(Slice(float(a), float(b), float(np.sqrt(np.mean(squares[inside]))), int(inside.sum())))
    return rows


def what_is_wrong(trace: Trace) -> tuple[Wrong, ...]:
    """Lines on every channel with more than 5 % of the normalised error, greatest first."""
    tables = error_tables(trace)
    by_chance, least = THRESHOLDS.value("error_probability"), THRESHOLDS.value("reported_share")
    lines = []
    for channel, share in sorted(tables.share.items(), key=lambda item: -item[1]):
        if share < least:
            continue
        found = ((f, axis) for axis in _AXES_OF[channel] for f in tables.follows[AXES[axis]])
        known = [(f, axis) for f, axis in found if f.p <= by_chance and f.share >= least]
        best, axis = max(known, key=lambda item: item[0].share) if known else (None, 0)
        text = _error_words(tables, channel, best.variable if best else "")
        if best is not None:
            text.append(force_words(trace, axis, best))
        lines.append(Wrong(channel, float(share), best.variable if best else "", "; ".join(text)))
    return tuple(lines)


def _error_words(tables: ErrorTables, channel: str, variable: str) -> list[str]:
    """Text on the size of a channel's error, its growth, and where it is greatest."""
    text = [f"root mean square {tables.size[channel]:.3g} {CHANNEL_UNITS[channel][0]}"]
    larger = THRESHOLDS.value("reported_ratio")
    growth = tables.by_channel[(channel, "horizon")]
    if len(growth) > 1 and growth[-1].rms > larger * growth[0].rms > 0.0:
        text.append(
            f"the {channel} error is {growth[-1].rms / growth[0].rms:.2g} times larger after {growth[-1].low:.0f} "
            f"to {growth[-1].high:.0f} s "
            f"than in the first {growth[0].high:.0f} s"
        )
    rows = tables.by_channel.get((channel, variable), [])
    if len(rows) > 1 and variable != "run":
        worst, least = max(rows, key=lambda r: r.rms), min(rows, key=lambda r: r.rms)
        if worst.rms > larger * least.rms:
            text.append(f"error worst at {variable} {worst.low:.3g} to {worst.high:.3g} {UNITS[variable]} "
                        f"({worst.rms / max(least.rms, 1e-12):.1f} "
                        "times the least)")  # fmt: skip
    return text


def force_words(trace: Trace, axis: int, found: Follows) -> str:
    """Sentence on where the missing force of one axis is greatest and smallest along the variable on which it
    depends."""
    name, share, _ = found
    fitted = curve(trace, axis, name)
    what = f"missing {AXES[axis]} force follows {name} ({100 * share:.0f} % of its variance)"
    if fitted is None:
        return what
    unit, factor = FORCE_UNITS[axis]
    ends = sorted((int(np.nanargmax(fitted.y)), int(np.nanargmin(fitted.y))), key=lambda i: fitted.x[i])
    if name == "run":
        places = [
            f"{factor * fitted.y[i]:+.2g} {unit} about run {trace.names[round(float(fitted.x[i]))]}" for i in ends
        ]
    else:
        places = [f"{factor * fitted.y[i]:+.2g} {unit} at {fitted.x[i]:.3g} {UNITS[name]}" for i in ends]
    text = f"{what}: {' and '.join(places)}"
    times = with_speed(trace, axis, name)
    if times != 1.0:
        text += (
            f", {times:.1f} times stronger in the faster half"
            if times > 1.0
            else f", {1 / times:.1f} times stronger in the slower half"
        )
    return text


def correlation(a: np.ndarray, b: np.ndarray, lag: int) -> tuple[float, int]:
    """Correlation of a(t + lag) with b(t) inside runs, and the number of pairs; zero of zero pairs where there are
    fewer than ten."""
    if lag >= a.shape[1]:
        return 0.0, 0
    x, y = a[:, lag:], b[:, : a.shape[1] - lag]
    ok = np.isfinite(x) & np.isfinite(y)
    if ok.sum() < 10:
        return 0.0, 0
    x, y = x[ok] - x[ok].mean(), y[ok] - y[ok].mean()
    return float(np.sum(x * y) / max(float(np.sqrt(np.sum(x**2) * np.sum(y**2))), 1e-300)), int(ok.sum())


_BAND = 2.576
"""Standard deviations of a 99 % band, as MATLAB's `resid` draws it."""


def correlogram(a: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Correlations of a(t + lag) with b(t) at lags 0 to `LAGS`, and their 99 % bounds if a is white."""
    found = [correlation(a, b, lag) for lag in range(LAGS + 1)]
    return np.array([rho for rho, _ in found]), np.array([_BAND / np.sqrt(max(num, 1)) for _, num in found])


def _whiteness(trace: Trace) -> dict[str, float]:
    """Statistic of Ljung & Box (1978), over its 95 % limit: below one, whiteness is not rejected."""
    from scipy.stats import chi2

    found = {}
    for i, name in enumerate(RESIDUALS):
        whole = int(np.isfinite(trace.white[..., i]).sum())
        if not whole:  # not measured
            continue
        terms = [correlation(trace.white[..., i], trace.white[..., i], lag) for lag in range(1, LAGS + 1)]
        statistic = sum(rho**2 * num * (whole + 2) / max(whole, 1) for rho, num in terms)
        found[name] = float(statistic / chi2.ppf(0.95, LAGS))
    return found


def _against_inputs(trace: Trace) -> dict[tuple[str, str], float]:
    """Greatest correlation of residuals with inputs 0 to `LAGS` samples before, over the 95 % bound of the greatest of
    so many (Bonferroni)."""
    from scipy.stats import norm

    bound = float(norm.ppf(1.0 - 0.025 / (LAGS + 1)))
    found = {}
    for i, name in enumerate(RESIDUALS):
        for j, label in enumerate(INPUTS):
            if not (np.any(np.nan_to_num(trace.inputs[..., j])) and np.any(np.isfinite(trace.white[..., i]))):
                continue
            pairs = [correlation(trace.white[..., i], trace.inputs[..., j], lag) for lag in range(LAGS + 1)]
            found[(name, label)] = max(abs(rho) * num**0.5 / bound for rho, num in pairs)
    return found
