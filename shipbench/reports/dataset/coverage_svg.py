"""Coverage of a data set as drawings of a page: SVG in the colours of its style sheet, so that they are readable in
light and dark."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ...render.svg import Axes
from .coverage import Coverage

WIDTH, HEIGHT = 430.0, 330.0
_LEVELS = 5
STYLE = """
.covered { display: grid; gap: 0 1.2rem; grid-template-columns: repeat(auto-fill, minmax(min(100%, 22rem), 1fr)); }
.covered h3 { margin-top: 1.2rem; } .levels { display: block; }
.levels span { white-space: nowrap; margin-right: .5rem; }
.level { fill: var(--c0); stroke: none; } .l0 { fill-opacity: .25; } .l1 { fill-opacity: .42; }
.l2 { fill-opacity: .6; }
.l3 { fill-opacity: .8; } .l4 { fill-opacity: 1; } .zero { stroke: var(--dim); stroke-width: 1; }
.ring { fill: none; stroke: var(--line); }
.halo { paint-order: stroke; stroke: var(--paper); stroke-width: 3; }
"""
"""Rules of the classes that the drawings use beside those of the common style sheet."""


def svg(covered: Coverage, dt: float) -> tuple[str, list[str]]:
    """Content of an SVG element (WIDTH x HEIGHT), and the times of its colour levels (none for headings).

    `dt` [s] is the least time of the scale.
    """
    return (_rose(covered), []) if covered.seconds.ndim == 1 else _cells(covered, dt)


def _cells(covered: Coverage, dt: float) -> tuple[str, list[str]]:
    """Drawing of the time in every cell, in levels that grow by the same factor."""
    x, y, seconds = covered.x, covered.y, covered.seconds
    axes = Axes((float(x[0]), float(x[-1])), (float(y[0]), float(y[-1])), WIDTH, HEIGHT)
    edges = np.geomspace(dt, max(float(seconds.max()), 10.0 * dt), _LEVELS + 1)
    level = np.clip(np.searchsorted(edges, seconds * (1.0 + 1e-9), side="right") - 1, 0, _LEVELS - 1)
    px, py = axes.px(x), axes.py(y)
    parts = [axes.grid(covered.xlabel, covered.ylabel)]
    for k in range(_LEVELS):
        cells = "".join(
            f"M{px[i]:.1f} {py[j]:.1f}H{px[i + 1]:.1f}V{py[j + 1]:.1f}H{px[i]:.1f}z"
            for i, j in np.argwhere((seconds > 0) & (level == k))
        )
        parts += [f'<path class="level l{k}" d="{cells}"/>'] if cells else []
    if x[0] < 0.0 < x[-1]:
        parts.append(f'<path class="zero" d="M{float(axes.px(0.0)):.1f} {py[-1]:.1f}V{py[0]:.1f}"/>')
    if y[0] < 0.0 < y[-1]:
        parts.append(f'<path class="zero" d="M{px[0]:.1f} {float(axes.py(0.0)):.1f}H{px[-1]:.1f}"/>')
    shown = [f"{edge:.2g}" if edge < 100.0 else f"{edge:.0f}" for edge in edges]
    return "".join(parts), [f"{a} to {b} s" for a, b in pairwise(shown)]


def _rose(covered: Coverage) -> str:
    """Drawing of the time in every sector of heading, north up and clockwise."""
    middle, below, radius = WIDTH / 2, HEIGHT / 2, HEIGHT / 2 - 32.0
    most = max(float(covered.seconds.max()), 1e-9)
    parts = [f'<circle class="ring" cx="{middle:g}" cy="{below:g}" r="{part * radius:g}"/>' for part in (0.5, 1.0)]
    for (a, b), time in zip(pairwise(covered.x), covered.seconds, strict=True):
        if time > 0:
            r = radius * time / most
            (ax, ay), (bx, by) = ((middle + r * np.sin(angle), below - r * np.cos(angle)) for angle in (a, b))
            parts.append(
                f'<path class="level l3" d="M{middle:g} {below:g}L{ax:.1f} {ay:.1f}A{r:.1f} {r:.1f} 0 0 1 {bx:.1f} '
                f'{by:.1f}z"/>'
            )
    places = (
        ("north", 0.0, -radius - 12.0),
        ("south", 0.0, radius + 22.0),
        ("east", radius + 24.0, 4.0),
        ("west", -radius - 24.0, 4.0),
    )
    parts += [f'<text class="x" x="{middle + dx:g}" y="{below + dy:g}">{name}</text>' for name, dx, dy in places]
    at = np.sin(np.pi / 4)  # beside the rings, between two names
    parts += [
        (
            f'<text class="halo" x="{middle + part * radius * at + 3:.1f}" '
            f'y="{below - part * radius * at - 3:.1f}">{part * most / 60.0:.2g} min</text>'
        )
        for part in (0.5, 1.0)
    ]
    return "".join(parts)
