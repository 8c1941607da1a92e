"""Evidence of a diagnosis as drawings of a page: SVG in the colours of its style sheet, so that they are readable in
light and dark.

Elements of the baseline or the extended model carry `data-m`, by which the page shows and hides them. No name from the
data enters a drawing.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...diagnosis.evaluation.dependence import AXES, UNITS, at_knots, curve, samples_of
from ...diagnosis.evaluation.residuals import (
    FORCE_UNITS,
    INPUTS,
    LAGS,
    RESIDUALS,
    ErrorTables,
    Slice,
    correlogram,
    slices,
    squared_error,
)
from ...diagnosis.result import Trace
from ...leaderboard.pictures import growth
from ...leaderboard.series import Series
from ...render.linked import stroke
from ...render.svg import Axes
from .linked import rollouts

WIDTH, HEIGHT = 400.0, 300.0
_DOTS = 900
_LEAST = 0.01
"""Least end of an axis of position errors [m]: the record is no finer."""
_TICKS = {"heading": (0.0, 90.0, 180.0, 270.0, 360.0)}
_SHOWN = 6
_LEVELS = 4
STYLE = """
svg .dots { stroke-width: 4; stroke-linecap: round; stroke-opacity: .4; }
.zero { stroke: var(--dim); stroke-width: 1; fill: none; }
.ring { fill: var(--paper); stroke-width: 2; } .join { stroke: var(--line); stroke-width: 1.5; }
.stem { stroke-width: 5; }
.bound { fill: var(--ink); fill-opacity: .12; stroke: none; } .place { stroke-width: 5; stroke-linecap: round; }
.l0 { stroke-opacity: .2; } .l1 { stroke-opacity: .45; } .l2 { stroke-opacity: .7; } .l3 { stroke-opacity: 1; }
"""
"""Rules of the classes that the drawings use beside those of the common style sheet."""


class Drawing(NamedTuple):
    """Title in plain text, content of an SVG element (WIDTH x HEIGHT), and caption."""

    title: str
    svg: str
    caption: str = ""


def error_growth(trace: Trace, extended: bool) -> list[Drawing]:
    """Drawings of position and heading error against the time of prediction: the median of all segments and their
    middle half."""
    models = [str(i) for i in range(len(rollouts(trace, extended)))]
    with np.errstate(all="ignore"):
        squares = [squared_error(trace, p)[0] for p in rollouts(trace, extended)]
    known = np.all([np.isfinite(e[..., :2]).any(axis=0).all(axis=-1) for e in squares], axis=0)
    if not known.any():
        return []
    errors = {
        m: (np.sqrt(e[:, known, 0]), np.rad2deg(np.sqrt(e[:, known, 1]))) for m, e in zip(models, squares, strict=True)
    }
    series = Series(trace.t[known], [], errors, [])
    kinds = (("Position error", "ED [m]"), ("Heading error", "|heading error| [deg]"))
    return [Drawing(title, growth(series, models, i, label)) for i, (title, label) in enumerate(kinds)]


def error_slices(trace: Trace, extended: bool) -> list[Drawing]:
    """Drawings of the root mean square position error against each variable; those with the greatest contrast first."""
    scale = float(squared_error(trace, trace.before)[1][0])
    found = [
        slices(trace, np.concatenate([p[..., :2], trace.measured[..., 2:]], axis=-1)) for p in rollouts(trace, extended)
    ]
    elsewhere = {"horizon", "run"} | (
        {"time"} if not np.any(trace.start) else set()
    )  # the growth of the error, the errors of every run
    by_contrast = sorted(
        (v for v, rows in found[0].items() if len(rows) > 1 and v not in elsewhere),
        key=lambda v: -_contrast(found[0][v]),
    )
    drawn = []
    for name in by_contrast[:_SHOWN]:
        rows = [by[name] for by in found if by.get(name)]
        top = scale * max(r.rms for part in rows for r in part)
        axes = Axes((rows[0][0].low, rows[0][-1].high), (0.0, 1.08 * max(top, _LEAST)), WIDTH, HEIGHT)
        lines = "".join(
            f'<path data-m="{i}" {stroke(i)} d="{_steps(axes, part, scale)}"/>' for i, part in enumerate(rows)
        )
        drawn.append(
            Drawing(
                f"Position error against {name}",
                axes.grid(_axis(name), "RMS position error [m]", xticks=_TICKS.get(name, ())) + lines,
            )
        )
    return drawn


def _contrast(rows: Sequence[Slice]) -> float:
    values = [r.rms for r in rows]
    return max(values) / max(min(values), 1e-12)


def _steps(axes: Axes, rows: Sequence[Slice], scale: float) -> str:
    """Path of level lines over the range of each slice, joined where one ends at the beginning of the next."""
    x: list[float] = []
    y: list[float] = []
    for row in rows:
        if x and row.low > x[-1]:
            x, y = [*x, np.nan], [*y, np.nan]
        x, y = [*x, row.low, row.high], [*y, scale * row.rms, scale * row.rms]
    return axes.line(np.array(x), np.array(y))


def _axis(name: str) -> str:
    return f"{name} [{UNITS[name]}]" if UNITS[name] else f"number of the {name}"


def gain_per_run(rows: Sequence[tuple[str, float, float]]) -> Drawing:
    """Drawing of the held-out position error of every run before (ring) and after (dot), from the greatest of the
    baseline model to the least."""
    order = sorted(((b, a) for _, b, a in rows), key=lambda row: -row[0])
    top = max((max(row) for row in order), default=1.0)
    axes = Axes((0.0, len(order) + 1.0), (0.0, 1.08 * max(top, _LEAST)), WIDTH, HEIGHT)
    parts = [axes.grid("runs in order of the error before", "held-out position error ED [m]")]
    for i, (before, after) in enumerate(order):
        x, low, high = (f"{float(v):.1f}" for v in (axes.px(i + 1.0), axes.py(after), axes.py(before)))
        parts.append(f'<path class="join" d="M{x} {high}V{low}"/>')
        parts.append(
            f'<circle data-m="0" class="ring c0" cx="{x}" cy="{high}" r="4"/><circle data-m="1" class="dot c1" '
            f'cx="{x}" cy="{low}" r="4"/>'
        )
    return Drawing(
        "Position error of every run",
        "".join(parts),
        "Ring: before. Dot: after. No run was used to fit its own models.",
    )


def missing_forces(trace: Trace, tables: ErrorTables, extended: bool, level: float) -> list[Drawing]:
    """Drawings of the missing force, per unit of mass, against the variable that explains most of it; axes without a
    significant dependence (p > `level`) are left out."""
    values = at_knots(trace)
    found = []
    for j, axis in enumerate(AXES):
        best = next((f for f in tables.follows[axis] if f.p <= level), None)
        if best is None:
            continue
        unit, factor = _force_unit(j)
        x, y = values[best.variable].ravel(), factor * trace.force[..., j].ravel()
        known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
        kept = known[:: max(1, len(known) // _DOTS)]
        reach = max(1.1 * float(np.quantile(np.abs(y[known]), 0.99)), 1e-9)
        low, high = (0.0, 360.0) if best.variable == "heading" else (float(x[known].min()), float(x[known].max()))
        axes = Axes((low, max(high, low + 1e-9)), (-reach, reach), WIDTH, HEIGHT)
        inside = kept[np.abs(y[kept]) <= reach]
        dots = "".join(f"M{a:.1f} {b:.1f}h0" for a, b in zip(axes.px(x[inside]), axes.py(y[inside]), strict=True))
        parts = [
            axes.grid(_axis(best.variable), f"{axis} [{unit}]", xticks=_TICKS.get(best.variable, ())),
            f'<path data-m="0" class="dots c0" d="{dots}"/>',
            _zero(axes),
        ]
        for i, force in enumerate([trace.force, trace.force_after][: 2 if extended else 1]):
            fitted = curve(replace(trace, force=force), j, best.variable)
            if fitted is not None:
                ends = np.clip([factor * fitted.low, factor * fitted.y, factor * fitted.high], -reach, reach)
                ends = np.where(np.isfinite(fitted.y), ends, np.nan)
                parts.append(f'<path data-m="{i}" class="band c{i}" d="{_band(axes, fitted.x, ends[0], ends[2])}"/>')
                parts.append(f'<path data-m="{i}" {stroke(i)} d="{axes.line(fitted.x, ends[1])}"/>')
        caption = "Dots: force at each time step. Line and band: fitted mean and its 95 % interval."
        found.append(Drawing(f"Missing {axis} force against {best.variable}", "".join(parts), caption))
    return found


def _band(axes: Axes, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> str:
    """Area between two lines, in pieces where they have gaps."""
    known = np.isfinite(low) & np.isfinite(high)
    cuts = np.flatnonzero(np.diff(known.astype(int))) + 1
    pieces = [p for p in np.split(np.arange(len(x)), cuts) if known[p].all()]
    return "".join(axes.band(x[p], low[p], high[p]) for p in pieces)


def _zero(axes: Axes) -> str:
    left, right = (float(axes.px(v)) for v in axes.x)
    return f'<path class="zero" d="M{left:.1f} {float(axes.py(0.0)):.1f}H{right:.1f}"/>'


def _force_unit(j: int) -> tuple[str, float]:
    unit, factor = FORCE_UNITS[j]
    return unit.replace("^2", "²"), factor


def over_places(trace: Trace, axes: Sequence[str]) -> list[Drawing]:
    """Drawings of the missing force over the positions of the ship, one per axis; darker where it is greater."""
    places = trace.measured[:, samples_of(trace)]
    found = []
    for j in map(AXES.index, axes):
        unit, factor = _force_unit(j)
        force = factor * trace.force[..., j]
        known = np.isfinite(force) & np.isfinite(places[..., :2]).all(axis=-1)
        if not known.any():
            continue
        north, east, value = places[known][:, 0], places[known][:, 1], force[known]
        reach = max(float(np.quantile(np.abs(value), 0.98)), 1e-9)
        half = 0.53 * max(float(np.ptp(east)), float(np.ptp(north)), 1.0)
        middle = [(float(v.min()) + float(v.max())) / 2.0 for v in (east, north)]
        plot = Axes((middle[0] - half, middle[0] + half), (middle[1] - half, middle[1] + half), WIDTH, WIDTH - 20.0)
        level = np.clip((_LEVELS * np.abs(value) / reach).astype(int), 0, _LEVELS - 1)
        parts = [plot.grid("east [m]", "north [m]")]
        for k in range(_LEVELS):
            for colour, side in ((0, value < 0), (1, value >= 0)):
                at = "".join(
                    f"M{a:.1f} {b:.1f}h0"
                    for a, b in zip(
                        *(f((east, north)[i][side & (level == k)]) for i, f in enumerate((plot.px, plot.py))),
                        strict=True,
                    )
                )
                parts += [f'<path class="place c{colour} l{k}" d="{at}"/>'] if at else []
        step = reach / _LEVELS
        caption = (
            f"Blue: negative. Orange: positive. Each of the {_LEVELS} shades stands for {step:.2g} {unit}; "
            f"the darkest begins at {reach - step:.2g}."
        )
        found.append(Drawing(f"Missing {AXES[j]} force over the places [{unit}]", "".join(parts), caption))
    return found


def autocorrelations(trace: Trace) -> list[Drawing]:
    """Drawings of the autocorrelation of the residuals, at lags of one sample and more."""
    found = []
    for i, name in enumerate(RESIDUALS):
        if np.any(np.isfinite(trace.white[..., i])):
            rho, bound = correlogram(trace.white[..., i], trace.white[..., i])
            found.append(Drawing(f"Autocorrelation of {name}", _stems(rho[1:], bound[1:], 1)))
    return found


def cross_correlations(trace: Trace, tables: ErrorTables, most: int = 3) -> list[Drawing]:
    """Drawings of the cross-correlation of residuals with earlier inputs: the pairs closest to their bound, or farthest
    beyond it."""
    found = []
    for (name, label), _ in sorted(tables.inputs.items(), key=lambda item: -item[1])[:most]:
        rho, bound = correlogram(trace.white[..., RESIDUALS.index(name)], trace.inputs[..., INPUTS.index(label)])
        found.append(Drawing(f"Cross-correlation of {name} with {label}", _stems(rho, bound, 0)))
    return found


def _stems(rho: np.ndarray, bound: np.ndarray, first: int) -> str:
    lags = np.arange(first, LAGS + 1, dtype=float)
    reach = min(1.15 * max(float(np.max(np.abs(rho))), float(np.max(bound)), 1e-3), 1.0)
    axes = Axes((first - 0.6, LAGS + 0.6), (-reach, reach), WIDTH, HEIGHT)
    zero, bound = float(axes.py(0.0)), np.minimum(bound, reach)
    stems = "".join(
        f"M{x:.1f} {zero:.1f}V{y:.1f}" for x, y in zip(axes.px(lags), axes.py(np.clip(rho, -reach, reach)), strict=True)
    )
    grid = axes.grid("lag [samples]", "correlation")
    return (
        f'{grid}<path class="bound" d="{axes.band(lags, -bound, bound)}"/><path class="stem c0" '
        f'd="{stems}"/>{_zero(axes)}'
    )
