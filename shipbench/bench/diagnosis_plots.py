"""The pictures of a diagnosis: small panels of inline SVG, which a page sets in one column on a phone and in three on a laptop.

Colours are placeholders that become CSS variables, so that one picture serves light and dark pages. Names from the data never enter a picture: they
stand in the captions, escaped.
"""

from __future__ import annotations

import hashlib
import io
import re
from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..diagnosis.follows import AXES, UNITS, at_knots, curve, samples_of
from ..diagnosis.outcome import Diagnosis, Trace
from ..diagnosis.wrong import FORCE_UNITS, INPUTS, LAGS, RESIDUALS, ErrorTables, Slice, correlogram, slices

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap

_INK, _BEFORE, _AFTER = "#010203", "#d55e01", "#0072b3"
_CSS = {_INK: "currentColor", _BEFORE: "var(--before)", _AFTER: "var(--after)"}
_RC: dict[Any, Any] = {
    "svg.fonttype": "none", "font.size": 8.5, "text.color": _INK, "axes.edgecolor": _INK, "axes.labelcolor": _INK, "xtick.color": _INK,
    "ytick.color": _INK, "axes.linewidth": 0.6, "xtick.major.width": 0.6, "ytick.major.width": 0.6, "axes.spines.top": False,
    "axes.spines.right": False,
}  # fmt: skip
_TRACKS = 6
_MOST_DOTS = 900


class Panel(NamedTuple):
    """One picture (an SVG element), its caption, and where it has none what it shows, for those who do not see it (plain text, to be escaped)."""

    svg: str
    caption: str = ""
    shows: str = ""


def panel(draw: Callable[[Axes], object], caption: str = "", shows: str = "", width: float = 3.4, height: float = 2.5) -> Panel:
    """Draw on fresh axes, which leave the room that labels and numbers take; no global state, no display."""
    from matplotlib import rc_context
    from matplotlib.figure import Figure

    buffer = io.StringIO()
    with rc_context({**_RC, "svg.hashsalt": "shipbench"}):
        figure = Figure(figsize=(width, height), layout="constrained")
        axes = figure.add_subplot()
        axes.patch.set_visible(False)
        draw(axes)
        figure.savefig(buffer, format="svg", transparent=True, metadata=dict.fromkeys(("Date", "Creator", "Format", "Type")))
    text = buffer.getvalue()
    text = re.sub(r'<g id="[^"]*"', "<g", text[text.index("<svg") :])
    text = re.sub(r"<metadata>.*?</metadata>|<defs>\s*<style.*?</style>\s*</defs>", "", text, flags=re.DOTALL)  # the page's style holds that rule
    for placeholder, css in _CSS.items():
        text = text.replace(placeholder, css)
    own = hashlib.sha256(text.encode()).hexdigest()[:8]  # many pictures share a page: their ids must not
    text = re.sub(r'( id="|url\(#|href="#)', rf"\g<1>{own}", text)
    return Panel(re.sub(r' width="[\d.]+pt" height="[\d.]+pt"| height="[\d.]+pt"', "", text, count=1), caption, shows)


def distances(trace: Trace, predicted: np.ndarray) -> np.ndarray:
    """Mean distance per segment (B,) [m]; not-a-number where nothing is known."""
    with np.errstate(all="ignore"):
        error = np.hypot(*np.moveaxis(predicted[..., :2] - trace.measured[..., :2], -1, 0))
    known = np.isfinite(error)
    return np.where(known.any(axis=1), np.where(known, error, 0.0).sum(axis=1) / np.maximum(known.sum(axis=1), 1), np.nan)


def telling(trace: Trace, changed: bool) -> list[int]:
    """Segments to show: where the plain model is worst, one per run; with an extended model also the one that gains least."""
    before, after = distances(trace, trace.before), distances(trace, trace.after)
    order = [int(b) for b in np.argsort(-np.nan_to_num(before, nan=-1.0)) if np.isfinite(before[b])]
    first = {int(trace.run[b]): b for b in reversed(order)}
    chosen = [b for b in order if first[int(trace.run[b])] == b][:_TRACKS]
    if changed and len(chosen) == _TRACKS:
        least = int(np.nanargmin(before - after))
        chosen = chosen if least in chosen else [*chosen[:-1], least]
    return chosen


def tracks(trace: Trace, changed: bool) -> list[Panel]:
    """Measured and predicted tracks of the most telling runs."""
    before, after = distances(trace, trace.before), distances(trace, trace.after)
    found = []
    for b in telling(trace, changed):

        def draw(ax: Axes, b: int = b) -> None:
            ax.plot(trace.measured[b, :, 1], trace.measured[b, :, 0], color=_INK, lw=2.2)
            for values, colour, style in ((trace.before, _BEFORE, (0, (4, 1.5))), (trace.after, _AFTER, "-"))[: 2 if changed else 1]:
                path = _near(values[b, :, :2], trace.measured[b, :, :2])
                ax.plot(path[:, 1], path[:, 0], color=colour, lw=1.3, ls=style)
            ax.plot(trace.measured[b, 0, 1], trace.measured[b, 0, 0], "o", color=_INK, ms=3.5)
            ax.set_aspect("equal", adjustable="datalim")
            ax.locator_params(nbins=5)
            ax.set_xlabel("east [m]")
            ax.set_ylabel("north [m]")

        times = f" from {trace.start[b]:.0f} s" if trace.start[b] > 0 else ""
        change = f" -> {after[b]:.3g} m" if changed else " m"
        found.append(panel(draw, f"{trace.names[int(trace.run[b])]}{times}: mean distance {before[b]:.3g}{change}"))
    return found


def _near(predicted: np.ndarray, measured: np.ndarray) -> np.ndarray:
    """Track (K + 1, 2) without what lies farther off than three times the measured track's extent: a model that diverges must not hide it."""
    known = measured[np.isfinite(measured).all(axis=-1)]
    reach = 3.0 * float(np.max(np.ptp(known, axis=0), initial=1.0)) if len(known) else np.inf
    with np.errstate(all="ignore"):
        far = ~(np.max(np.abs(predicted - measured), axis=-1) <= reach)
    return np.where(far[:, None], np.nan, predicted)


def growth(trace: Trace, changed: bool) -> list[Panel]:
    """Errors against the time of prediction: median of the runs, with the band between the quartiles."""
    found = []
    kinds = (("distance [m]", [0, 1], 1.0), ("heading error [deg]", [2], 57.29578), ("velocity error [m/s]", [3, 4], 1.0),
             ("yaw rate error [deg/s]", [5], 57.29578))  # fmt: skip
    for label, channels, factor in kinds:

        def draw(ax: Axes, label: str = label, channels: list[int] = channels, factor: float = factor) -> None:
            for values, colour, style in ((trace.before, _BEFORE, (0, (4, 1.5))), (trace.after, _AFTER, "-"))[: 2 if changed else 1]:
                with np.errstate(all="ignore"):
                    error = factor * np.sqrt(np.sum((values[..., channels] - trace.measured[..., channels]) ** 2, axis=-1))
                error = np.where(np.isfinite(error), error, np.nan)
                ok = np.isfinite(error).any(axis=0)
                if not ok.any():
                    continue
                low, middle, high = np.nanquantile(error[:, ok], (0.25, 0.5, 0.75), axis=0)
                ax.fill_between(trace.t[ok], low, high, color=colour, alpha=0.18, lw=0)
                ax.plot(trace.t[ok], middle, color=colour, lw=1.5, ls=style)
            ax.set_xlabel("time of prediction [s]")
            ax.set_ylabel(label)
            ax.set_ylim(bottom=0.0)
            ax.margins(x=0.0)

        found.append(panel(draw, shows=f"{label} against the time of prediction"))
    return found


def error_slices(trace: Trace, tables: ErrorTables, changed: bool) -> list[Panel]:
    """Normalised error against each variable, before and after."""
    after = slices(trace, trace.after) if changed else {}
    found = []
    for name, rows in tables.by.items():
        if not rows:
            continue
        second = {(r.low, r.high): r for r in after.get(name, [])}

        def draw(ax: Axes, name: str = name, rows: list[Slice] = rows, second: dict[tuple[float, float], Slice] = second) -> None:
            at = np.arange(len(rows))
            width = 0.4 if second else 0.7
            ax.bar(at - (0.2 if second else 0.0), [r.rms for r in rows], width, color=_BEFORE)
            if second:
                ax.bar(at + 0.2, [second[(r.low, r.high)].rms if (r.low, r.high) in second else 0.0 for r in rows], width, color=_AFTER)
            ax.set_xticks(at, [_range_text(name, r) for r in rows], fontsize=6.5)
            ax.tick_params(axis="x", length=0)
            ax.set_xlabel(_axis_text(name))
            ax.set_ylabel("error")

        found.append(panel(draw, shows=f"error against {_axis_text(name)}", height=2.3))
    return found


def _axis_text(name: str) -> str:
    if name == "horizon":
        return "time of prediction [s]"
    if name == "heading":
        return "heading [deg], 45 from each"
    return f"{name} [{UNITS[name]}]" if UNITS[name] else f"number of the {name}"


def _range_text(name: str, row: Slice) -> str:
    if name == "heading":
        return f"{row.low:.0f}"
    if name == "run":
        low, high = round(row.low + 0.5), round(row.high - 0.5)
        return str(low) if low == high else f"{low}\nto {high}"
    return f"{_short(row.low)}\nto {_short(row.high)}"


def _short(value: float) -> str:
    return f"{0.0 if abs(value) < 5e-4 else value:.0f}" if abs(value) >= 9.95 else f"{0.0 if abs(value) < 5e-4 else value:.2g}"


def autocorrelations(trace: Trace) -> list[Panel]:
    """Of the residuals of what was measured, with 95 % bounds, at lags of one sample and more."""
    found = []
    for i, name in enumerate(RESIDUALS):
        if not np.any(np.isfinite(trace.white[..., i])):
            continue
        rho, bound = correlogram(trace.white[..., i], trace.white[..., i])
        found.append(panel(partial(_stems, rho=rho[1:], bound=bound[1:], first=1), f"{name} with itself", height=1.9))
    return found


def cross_correlations(trace: Trace, tables: ErrorTables, most: int = 3) -> list[Panel]:
    """Residuals with the inputs before them: the pairs that come closest to their bound, or go farthest beyond it."""
    found = []
    for (name, label), _ in sorted(tables.inputs.items(), key=lambda item: -item[1])[:most]:
        rho, bound = correlogram(trace.white[..., RESIDUALS.index(name)], trace.inputs[..., INPUTS.index(label)])
        found.append(panel(partial(_stems, rho=rho, bound=bound, first=0), f"{name} with {label}", height=1.9))
    return found


def _stems(ax: Axes, rho: np.ndarray, bound: np.ndarray, first: int) -> None:
    lags = np.arange(first, LAGS + 1)
    ax.fill_between(lags, -bound, bound, color=_INK, alpha=0.13, lw=0)
    ax.vlines(lags, 0.0, rho, color=_BEFORE, lw=3)
    ax.axhline(0.0, color=_INK, lw=0.6)
    reach = 1.15 * max(float(np.max(np.abs(rho))), float(np.max(bound)), 1e-3)
    ax.set_ylim(-min(reach, 1.0), min(reach, 1.0))
    ax.set_xlabel("lag [samples]")


def forces(trace: Trace, tables: ErrorTables, changed: bool) -> list[Panel]:
    """Three panels per axis: the force that the plain model lacks along all runs; against the variable that it follows best; all variables."""
    values = at_knots(trace)
    found = []
    for j, axis in enumerate(AXES):
        unit, factor = FORCE_UNITS[j]
        unit = unit.replace("^2", "²")
        best = next(iter(sorted(tables.follows[axis], key=lambda f: (f.p > 0.02, -f.share))), None)
        found.append(_force_map(trace, j, f"Missing {axis} force along the runs [{unit}]", factor))
        if best is None:
            continue
        found.append(_force_against(trace, j, best.variable, values[best.variable], changed, f"{axis} [{unit}]", factor))

        def draw(ax: Axes, axis: str = axis) -> None:
            rows = tables.follows[axis][::-1]
            ax.barh([f.variable for f in rows], [100.0 * f.share for f in rows], color=_BEFORE, alpha=0.3)
            sure = [f for f in rows if f.p <= 0.02]
            ax.barh([f.variable for f in sure], [100.0 * f.share for f in sure], color=_BEFORE)
            ax.set_xlim(0.0, max(10.0, 115.0 * max(f.share for f in rows)))
            ax.set_xlabel("share of the variance explained [%]")

        found.append(panel(draw, f"What the missing {axis} force follows (pale: could be chance)"))
    return found


def over_places(trace: Trace, axes: Sequence[str]) -> list[Panel]:
    """One panel for each of some axes: the force that the plain model lacks, where the ship was."""
    places = trace.measured[:, samples_of(trace)]
    found = []
    for j in map(AXES.index, axes):
        unit, factor = FORCE_UNITS[j]

        def draw(ax: Axes, j: int = j, factor: float = factor) -> None:
            force = factor * trace.force[..., j]
            ax.scatter(places[..., 1], places[..., 0], s=6, color=_INK, alpha=0.08, lw=0)
            dots = ax.scatter(places[..., 1], places[..., 0], s=6, c=force, lw=0, **_colours(force))
            _scale(ax, dots)
            ax.set_aspect("equal", adjustable="datalim")
            ax.set_xlabel("east [m]")
            ax.set_ylabel("north [m]")

        found.append(panel(draw, f"Missing {AXES[j]} force over the places [{unit.replace('^2', '²')}]"))
    return found


def _force_map(trace: Trace, j: int, caption: str, factor: float) -> Panel:
    def draw(ax: Axes) -> None:
        force = factor * trace.force[..., j]
        step = trace.knots[1] - trace.knots[0] if len(trace.knots) > 1 else 1.0
        extent = (trace.knots[0] - 0.5 * step, trace.knots[-1] + 0.5 * step, len(force) - 0.5, -0.5)
        _scale(ax, ax.imshow(force, aspect="auto", extent=extent, interpolation="nearest", **_colours(force)))
        ax.set_xlabel("time [s]")
        ax.set_ylabel("run" if len(force) == len(trace.names) else "piece of a run")

    return panel(draw, caption)


def _colours(force: np.ndarray) -> dict[str, Any]:
    """Of a force, the same to either side, for a picture of it."""
    known = np.abs(force[np.isfinite(force)])
    reach = max(float(np.quantile(known, 0.98)), 1e-9) if len(known) else 1.0
    return {"cmap": _two_colours(), "vmin": -reach, "vmax": reach}


def _scale(ax: Axes, image: Any) -> None:
    """The bar beside a picture in colours."""
    bar = ax.figure.colorbar(image, ax=ax, pad=0.04, fraction=0.06)
    bar.outline.set_visible(False)
    bar.solids.set_rasterized(True)  # type: ignore[union-attr]  # its 256 stripes would show their seams
    bar.ax.locator_params(nbins=5)


def _two_colours() -> Colormap:
    """Blue below zero, red above, nothing at zero: the page shows through there, light or dark."""
    from matplotlib.colors import LinearSegmentedColormap

    blue, red = (0.16, 0.47, 0.73), (0.82, 0.20, 0.16)
    return LinearSegmentedColormap.from_list("two", [(0.0, (*blue, 1.0)), (0.5, (*blue, 0.0)), (0.5, (*red, 0.0)), (1.0, (*red, 1.0))])


def _force_against(trace: Trace, j: int, name: str, x: np.ndarray, changed: bool, label: str, factor: float) -> Panel:
    def draw(ax: Axes) -> None:
        y = factor * trace.force[..., j]
        known = np.flatnonzero((np.isfinite(x) & np.isfinite(y)).ravel())
        shown = known[:: max(1, len(known) // _MOST_DOTS)]
        ax.plot(x.ravel()[shown], y.ravel()[shown], ".", color=_BEFORE, ms=2.5, alpha=0.35, mew=0)
        for force, colour in ((trace.force, _BEFORE), (trace.force_after, _AFTER))[: 2 if changed else 1]:
            fitted = curve(_with_force(trace, force), j, name)
            if fitted is not None:
                ax.fill_between(fitted.x, factor * fitted.low, factor * fitted.high, color=colour, alpha=0.3, lw=0)
                ax.plot(fitted.x, factor * fitted.y, color=colour, lw=2.2)
        ax.axhline(0.0, color=_INK, lw=0.6)
        reach = 1.1 * float(np.quantile(np.abs(y.ravel()[known]), 0.99)) if len(known) else 1.0
        ax.set_ylim(-max(reach, 1e-9), max(reach, 1e-9))
        if name == "heading":
            ax.set_xticks([0, 90, 180, 270, 360])
        ax.set_xlabel(f"{name} [{UNITS[name]}]" if UNITS[name] else f"number of the {name}")
        ax.set_ylabel(label)

    return panel(draw, f"Missing {AXES[j]} force against {name}, with fitted curve" + (" (blue: what remains after the causes)" if changed else ""))


def _with_force(trace: Trace, force: np.ndarray) -> Trace:
    from dataclasses import replace

    return replace(trace, force=force)


def gain_per_run(rows: Sequence[tuple[str, float, float]]) -> Panel:
    """Paired distances of every run, before and after, worst first."""
    order = sorted(rows, key=lambda row: -row[1])

    def draw(ax: Axes) -> None:
        at = np.arange(len(order))
        before, after = np.array([r[1] for r in order]), np.array([r[2] for r in order])
        ax.vlines(at, before, after, color=_INK, alpha=0.35, lw=1)
        ax.plot(at, before, "o", color=_BEFORE, ms=4, mfc="none")
        ax.plot(at, after, "o", color=_AFTER, ms=4)
        ax.set_xlabel("runs, from worst to best of the plain model")
        ax.set_ylabel("held-out mean ED [m]")
        ax.set_xticks([])
        ax.set_xlim(-0.7, len(order) - 0.3)
        ax.set_ylim(bottom=0.0)

    return panel(draw, shows="mean distance of every run before and after, from models that have not seen it", width=6.8, height=2.6)


def changed(d: Diagnosis) -> bool:
    """Whether there is an extended model to draw beside the plain one."""
    return d.trace is not None and d.verdict == "found" and not np.array_equal(d.trace.before, d.trace.after, equal_nan=True)
