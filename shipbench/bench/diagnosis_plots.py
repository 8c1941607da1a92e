"""The pictures of a diagnosis, as SVG text to stand inside a page."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING

import numpy as np

from ..diagnosis.outcome import Diagnosis, Trace
from ..diagnosis.wrong import AXES, ErrorTables, variables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MEASURED, BEFORE, AFTER = "#444444", "#d1495b", "#00798c"
_TRACKS = 6


def _figure(width: float, height: float) -> Figure:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def svg(figure: Figure) -> str:
    """The figure as an SVG element."""
    from matplotlib import rc_context

    buffer = io.StringIO()
    with rc_context({"svg.fonttype": "path", "svg.hashsalt": "shipbench"}):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    text = buffer.getvalue()
    return text[text.index("<svg") :]


def _runs(trace: Trace) -> np.ndarray:
    """Final distance of the plain model per segment [m], not-a-number where it has no end."""
    error = np.hypot(*np.moveaxis(trace.before[..., :2] - trace.measured[..., :2], -1, 0))
    return np.nanmean(error, axis=1)


def tracks(trace: Trace, changed: bool) -> str:
    """Measured and predicted tracks of the runs where the plain model is worst."""
    worst = np.argsort(-np.nan_to_num(_runs(trace), nan=-1.0))[:_TRACKS]
    rows = int(np.ceil(len(worst) / 3))
    figure = _figure(9.0, 2.9 * rows)
    for k, b in enumerate(worst):
        ax = figure.add_subplot(rows, 3, k + 1)
        for values, colour, label in ((trace.measured, MEASURED, "measured"), (trace.before, BEFORE, "physics"), (trace.after, AFTER, "extended")):
            if label == "extended" and not changed:
                continue
            ax.plot(values[b, :, 1], values[b, :, 0], color=colour, lw=1.4, label=label)
        ax.plot(trace.measured[b, 0, 1], trace.measured[b, 0, 0], "o", color=MEASURED, ms=3)
        ax.set_title(f"{trace.names[int(trace.run[b])]}, from {trace.start[b]:.0f} s".replace("$", r"\$"), fontsize=8)
        ax.set_aspect("equal", adjustable="datalim")
        ax.tick_params(labelsize=7)
        if k == 0:
            ax.legend(fontsize=7)
            ax.set_xlabel("east [m]", fontsize=7)
            ax.set_ylabel("north [m]", fontsize=7)
    return svg(figure)


def growth(trace: Trace, changed: bool) -> str:
    """Mean distance and heading error against the time of prediction."""
    figure = _figure(9.0, 2.6)
    for k, (label, channels, factor) in enumerate((("distance [m]", (0, 1), 1.0), ("heading error [deg]", (2,), 57.2958))):
        ax = figure.add_subplot(1, 2, k + 1)
        for values, colour, name in ((trace.before, BEFORE, "physics"), (trace.after, AFTER, "extended")):
            if name == "extended" and not changed:
                continue
            error = factor * np.sqrt(np.sum((values[..., channels] - trace.measured[..., channels]) ** 2, axis=-1))
            ok = np.isfinite(error).sum(axis=0) > 0
            ax.plot(trace.t[ok], np.nanmean(error[:, ok], axis=0), color=colour, label=name)
        ax.set_xlabel("time of prediction [s]", fontsize=8)
        ax.set_ylabel(label, fontsize=8)
        ax.tick_params(labelsize=7)
        ax.legend(fontsize=7)
    return svg(figure)


def slices(tables: ErrorTables) -> str:
    """Normalised error of the plain model against each variable."""
    names = [n for n in tables.by if tables.by[n]]
    figure = _figure(9.0, 2.0 * np.ceil(len(names) / 3))
    for k, name in enumerate(names):
        ax = figure.add_subplot(int(np.ceil(len(names) / 3)), 3, k + 1)
        rows = tables.by[name]
        ax.bar(range(len(rows)), [r[2] for r in rows], color=BEFORE, alpha=0.8)
        ax.set_xticks(range(len(rows)), [f"{r[0]:.3g}\n{r[1]:.3g}" for r in rows], fontsize=6)
        ax.set_title(name, fontsize=8)
        ax.tick_params(axis="y", labelsize=6)
    return svg(figure)


def forces(trace: Trace, tables: ErrorTables) -> str:
    """The force that the plain model lacks: along the runs, and against the variable that it follows best."""
    figure = _figure(9.0, 6.0)
    every = max(1, round(float(trace.knots[1] - trace.knots[0]) / float(trace.t[1] - trace.t[0]))) if len(trace.knots) > 1 else 1
    values = variables(trace)
    for j, axis in enumerate(AXES):
        unit = "mm/s$^2$" if j < 2 else "0.001 deg/s$^2$"
        factor = 1e3 if j < 2 else 57.2958e3
        ax = figure.add_subplot(3, 2, 2 * j + 1)
        for b in range(min(len(trace.run), 12)):
            ax.plot(trace.knots + trace.start[b], factor * trace.force[b, :, j], color=BEFORE, lw=0.7, alpha=0.6)
        ax.axhline(0.0, color=MEASURED, lw=0.5)
        ax.set_ylabel(f"{axis} [{unit}]", fontsize=8)
        ax.set_xlabel("time in run [s]", fontsize=7)
        ax.tick_params(labelsize=6)
        name, share, p = tables.follows[axis][0]
        ax = figure.add_subplot(3, 2, 2 * j + 2)
        x = values[name][:, ::every][:, : trace.force.shape[1]]
        ax.plot(x.ravel(), factor * trace.force[..., j].ravel(), ".", color=BEFORE, ms=2, alpha=0.5)
        ax.axhline(0.0, color=MEASURED, lw=0.5)
        ax.set_xlabel(f"{name} (explains {100 * share:.0f} %, p = {p:.2f})", fontsize=7)
        ax.tick_params(labelsize=6)
    return svg(figure)


def gain_per_run(d: Diagnosis) -> str:
    """Paired distances of every run, before and after."""
    figure = _figure(9.0, 2.6)
    ax = figure.add_subplot(1, 1, 1)
    order = sorted(d.gain_per_run, key=lambda row: -row[1])
    for i, (_, before, after) in enumerate(order):
        ax.plot([i, i], [before, after], color="#bbbbbb", lw=1)
    ax.plot([r[1] for r in order], "o", color=BEFORE, ms=4, label="physics")
    ax.plot([r[2] for r in order], "o", color=AFTER, ms=4, label="extended")
    few = len(order) <= 40
    ax.set_xticks(range(len(order)) if few else [], [r[0].replace("$", r"\$") for r in order] if few else [], rotation=90, fontsize=6)
    ax.set_ylabel("held-out mean ED [m]", fontsize=8)
    ax.set_ylim(bottom=0.0)
    ax.tick_params(axis="y", labelsize=7)
    ax.legend(fontsize=7)
    return svg(figure)
