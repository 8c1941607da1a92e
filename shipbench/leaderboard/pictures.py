"""Static pictures of a page: growth of the error, errors in slices of the truth; each as the content of one SVG
element.

Elements of model number i carry `data-m="i"`, by which the page shows and hides them. No name from the data enters a
picture.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..render.linked import COLOURS, stroke
from ..render.svg import Axes, limits
from .series import Series
from .slicing import Regime

_WIDTH, _HEIGHT = 400.0, 330.0


def growth(series: Series, models: Sequence[str], which: int, ylabel: str) -> str:
    """Picture of the error (0: position, 1: heading) against time: median of the windows and the band between the
    quartiles."""
    found = {
        m: np.nanquantile(series.errors[m][which], [0.25, 0.5, 0.75], axis=0) for m in models if m in series.errors
    }
    if not found:
        return ""
    ends = [float(q[1, -1]) for q in found.values()]
    lows = [float(np.quantile(q[0], 0.1)) for q, end in zip(found.values(), ends, strict=True) if end > 0]
    y, log = limits(lows, [float(q[2].max()) for q in found.values()], ends)
    axes = Axes((0.0, float(series.t[-1])), y, _WIDTH, _HEIGHT, log)
    bands = [(f'<path data-m="{models.index(m)}" class="band c{models.index(m) % COLOURS}" '
              f'd="{axes.band(series.t, q[0], q[2])}"/>')
             for m, q in found.items()]  # fmt: skip
    lines = [
        f'<path data-m="{models.index(m)}" {stroke(models.index(m))} d="{axes.line(series.t, q[1])}"/>'
        for m, q in reversed(found.items())
    ]
    return axes.grid("time after the start [s]", ylabel) + "".join(bands + lines)


def slices(regime: Regime, models: Sequence[str]) -> str:
    """Picture of the mean error of every model in the slices of one feature."""
    values = {
        m: np.array(regime.values[m]) for m in models if m in regime.values and np.isfinite(regime.values[m]).any()
    }
    if not values:
        return ""
    means = [float(np.nanmean(v)) for v in values.values()]
    y, log = limits(
        [float(np.nanmin(v)) for v in values.values() if np.nanmean(v) > 0],
        [float(np.nanmax(v)) for v in values.values()],
        means,
    )
    axes = Axes((-0.4, len(regime.labels) - 0.6), y, 330.0, 240.0, log)
    at, parts = np.arange(len(regime.labels), dtype=float), []
    for m, v in reversed(values.items()):
        i = models.index(m)
        dots = "".join(f'<circle class="dot c{i % COLOURS}" cx="{float(axes.px(x)):.1f}" '
                       f'cy="{float(axes.py(e)):.1f}" r="3"/>'
                       for x, e in zip(at, v, strict=True) if np.isfinite(e))  # fmt: skip
        parts.append(f'<g data-m="{i}"><path {stroke(i)} d="{axes.line(at, v)}"/>{dots}</g>')
    unit = next((u for u in ("m/s", "deg") if all(label.endswith(f" {u}") for label in regime.labels)), "")
    names = [label.removesuffix(f" {unit}") for label in regime.labels]
    return axes.grid(regime.name + (f" [{unit}]" if unit else ""), "mean ED [m]", names) + "".join(parts)
