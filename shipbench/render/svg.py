"""Small SVG drawings: axes with ticks, and lines. They contain numbers and fixed words only, never a user's text."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

_LEFT, _RIGHT, _TOP, _BOTTOM = 46.0, 16.0, 10.0, 36.0


@dataclass(frozen=True)
class Axes:
    """A plot of `width` x `height` user units; `x` and `y` are the limits of the data, `y` may be logarithmic."""

    x: tuple[float, float]
    y: tuple[float, float]
    width: float = 400.0
    height: float = 300.0
    log: bool = False

    def px(self, values: np.ndarray | float) -> np.ndarray:
        """Horizontal position in user units of data values, to the right."""
        low, high = self.x
        return np.asarray(_LEFT + (np.asarray(values, float) - low) / (high - low) * (self.width - _LEFT - _RIGHT))

    def py(self, values: np.ndarray | float) -> np.ndarray:
        """Vertical position in user units of data values, downwards; values without a logarithm lie on the lower
        edge."""
        low, high, values = *self.y, np.asarray(values, float)
        if self.log:
            with np.errstate(all="ignore"):
                low, high, values = np.log(low), np.log(high), np.log(np.maximum(values, low))
        return np.asarray(self.height - _BOTTOM - (values - low) / (high - low) * (self.height - _TOP - _BOTTOM))

    def line(self, x: np.ndarray, y: np.ndarray) -> str:
        """Path data (attribute `d`) through the points (n,), broken where one is not finite."""
        return path(np.column_stack([self.px(x), self.py(y)]))

    def band(self, x: np.ndarray, low: np.ndarray, high: np.ndarray) -> str:
        """Path data (attribute `d`) of the area between two lines."""
        return (
            path(np.column_stack([self.px(np.concatenate([x, x[::-1]])), self.py(np.concatenate([low, high[::-1]]))]))
            + "z"
        )

    def grid(self, xlabel: str, ylabel: str, names: Sequence[str] = (), xticks: Sequence[float] = ()) -> str:
        """Grid lines, ticks and labels; `names` replace the numbers of a horizontal axis of categories 0, 1, ...,
        `xticks` its round numbers."""
        bottom, right = self.height - _BOTTOM, self.width - _RIGHT
        parts = []
        for value in ticks(*self.y, self.log):
            at = f"{float(self.py(value)):.1f}"
            parts.append(
                f'<path class="grid" d="M{_LEFT:g} {at}H{right:g}"/><text class="y" x="{_LEFT - 5:g}" '
                f'y="{at}">{label(value)}</text>'
            )
        round_numbers = [v for v in xticks if self.x[0] <= v <= self.x[1]] or ticks(*self.x)
        places = [(float(i), text) for i, text in enumerate(names)] if names else [(v, label(v)) for v in round_numbers]
        for value, text in places:
            at = f"{float(self.px(value)):.1f}"
            parts.append(
                f'<path class="grid" d="M{at} {_TOP:g}V{bottom:g}"/><text class="x" x="{at}" '
                f'y="{bottom + 14:g}">{text}</text>'
            )
        parts.append(f'<text class="x" x="{(_LEFT + right) / 2:g}" y="{self.height - 5:g}">{xlabel}</text>')
        parts.append(f'<text class="x" transform="translate(11 {(_TOP + bottom) / 2:g}) rotate(-90)">{ylabel}</text>')
        return "".join(parts)


def path(points: np.ndarray) -> str:
    """Path data (attribute `d`) through `points` (n, 2) in user units, in tenths; a gap where one is not finite."""
    points = np.round(points, 1)
    parts, pen = [], None
    for point in points:
        if not np.isfinite(point).all():
            pen = None
        elif pen is None:
            parts.append(f"M{point[0]:.6g} {point[1]:.6g}")
            pen = point
        else:
            dx, dy = np.round(point - pen, 1) + 0.0  # no negative zero
            parts.append(f"l{dx:.6g} {dy:.6g}" if dy >= 0 else f"l{dx:.6g}{dy:.6g}")
            pen = point
    return "".join(parts)


def ticks(low: float, high: float, log: bool = False) -> list[float]:
    """Round numbers inside the limits."""
    from matplotlib.ticker import LogLocator, MaxNLocator

    if log and high / low < 30.0:
        found = LogLocator(subs=(1.0, 2.0, 5.0)).tick_values(low, high)
    elif log:
        found = LogLocator(numticks=7).tick_values(low, high)
    else:
        found = MaxNLocator(nbins=5).tick_values(low, high)
    slack = 1e-9 * (high - low)
    return [float(v) for v in found if low - slack <= v <= high + slack]


def label(value: float) -> str:
    """Text of a tick's number."""
    return f"{0.0 if abs(value) < 1e-12 else value:.6g}"


def limits(lows: Sequence[float], highs: Sequence[float], typical: Sequence[float]) -> tuple[tuple[float, float], bool]:
    """Limits of a vertical axis of errors, and whether it is logarithmic: where the `typical` errors lie more than a
    factor of 12 apart."""
    positive = [v for v in typical if np.isfinite(v) and v > 0]
    top = max([v for v in highs if np.isfinite(v)], default=1.0)
    if positive and max(positive) > 12.0 * min(positive) and top > 0:
        least = min([v for v in lows if np.isfinite(v) and v > 0], default=top)
        return (max(least, 1e-3 * max(positive)) / 1.2, 1.15 * top), True
    return (0.0, 1.05 * top if top > 0 else 1.0), False
