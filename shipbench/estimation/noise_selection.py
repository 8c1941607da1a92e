"""Selection of the noise model of each channel, and its description for the reader."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product

import numpy as np

from ..signals import R, U, V
from .budget import is_spent
from .laplace import Fit, evidence_with
from .noise import CHANNEL_UNITS, RESIDUALS, Colour
from .thresholds import THRESHOLDS

_LASTING, _SMOOTH = ((1.0, 4.0, 16.0, 64.0), (2.0, 6.0, 20.0)), ((16.0, 64.0), (0.5, 1.0, 2.0, 4.0))
"""Grids of autocorrelated errors and of filtered noise: variance over that of the white part, and time [samples]."""
_FIRST = ((1.0, 2.0), (4.0, 6.0))
"""Pairs of share and time that are tried before a grid."""
_WAVES = (_LASTING[0], (1.7, 2.0, 2.3), (0.1, 0.25))
"""Grid of motion with the waves: share, period in lags of the lowest correlation, and damping ratio."""


def colour_of(found: Fit, share: float = 1.0, waves_alone: bool = False) -> Colour:
    """Noise model of each channel that fits the residuals far better than white noise.

    found: a fit of this share of the segments. waves_alone: look for wave motion only, not for errors that last.
    Channels that are not reached before the time budget is spent keep white noise.
    """
    worth = 0.5 * THRESHOLDS.value("evidence_of_another_model") * share
    colour = Colour.white(found.plant.steps + 1)
    best = evidence_with(found, colour)
    for channel in np.flatnonzero(found.plant.seg.seen).tolist():
        if is_spent():
            break
        grids = _swinging(found, colour, channel) + (
            [] if waves_alone else _lasting(found, colour, channel, best + worth)
        )
        reached, way = max((_climbed(found, grid) for grid in grids), key=lambda c: c[0], default=(best, colour))
        if reached > best + worth:
            best, colour = _tuned(found, way, channel, reached)
    return colour


def _climbed(found: Fit, grid: np.ndarray) -> tuple[float, Colour]:
    """Log evidence and noise model at a maximum of the grid, by hill climbing along the first two axes from its second
    entry."""
    at = (1, 1, *[0] * (grid.ndim - 2))
    known = {at: evidence_with(found, grid[at])}
    while True:
        steps = [
            (axis, step) for axis in range(grid.ndim) for step in (-1, 1) if 0 <= at[axis] + step < grid.shape[axis]
        ]
        for axis, step in steps:
            beside = (*at[:axis], at[axis] + step, *at[axis + 1 :])
            if beside not in known and not is_spent():
                known[beside] = evidence_with(found, grid[beside])
        summit = max(known, key=lambda place: known[place])
        if summit == at:
            return known[at], grid[at]
        at = summit


def _tuned(found: Fit, colour: Colour, channel: int, best: float) -> tuple[float, Colour]:
    """Log evidence and noise model of `colour`, which has the evidence `best`, with a longer or a shorter period in a
    channel.

    The period changes as long as the evidence rises, a segment holds one period, and a sample is at most half a period.
    """
    share, time, period = (float(x[channel]) for x in (colour.share, colour.time, colour.period))
    for factor in (1.15, 1.0 / 1.15):
        stretch = factor
        while 2.0 < period * stretch < found.plant.steps and not is_spent():
            way = colour.with_channel(channel, share, time * stretch, period * stretch)
            worth = evidence_with(found, way)
            if worth <= best:
                break
            best, colour, stretch = worth, way, stretch * factor
    return best, colour


def _lasting(found: Fit, colour: Colour, channel: int, least: float) -> list[np.ndarray]:
    """Grids of share and time of errors that last for seconds, or were filtered, where such noise reaches the `least`
    evidence."""
    if max(evidence_with(found, colour.with_channel(channel, share, time)) for share, time in _FIRST) < least:
        return []
    return [
        _grid(_LASTING, lambda share, time: colour.with_channel(channel, share, time)),
        _grid(_SMOOTH, lambda share, time: colour.with_channel(channel, share, time, smooth=True)),
    ]


def _grid(axes: tuple[tuple[float, ...], ...], way: Callable[..., Colour]) -> np.ndarray:
    grid = np.empty([len(axis) for axis in axes], dtype=object)
    for at, values in zip(np.ndindex(grid.shape), product(*axes), strict=True):
        grid[at] = way(*values)
    return grid


def _swinging(found: Fit, colour: Colour, channel: int) -> list[np.ndarray]:
    """Grid of share, period and damping of wave motion, where the residuals oscillate."""
    seg = found.plant.seg
    e = np.where(seg.mask, seg.states[..., channel] - found.columns.predicted[..., channel], 0.0)
    lags = range(1, min(THRESHOLDS.count("wave_lag"), e.shape[1] - 1) + 1)
    correlation = [float(np.sum(e[:, lag:] * e[:, :-lag]) / np.sum(e**2)) for lag in lags]
    if min(correlation) > -THRESHOLDS.value("wave_correlation"):
        return []
    half = 1 + int(np.argmin(correlation))

    def way(share: float, factor: float, damping: float) -> Colour:
        period = factor * half
        return colour.with_channel(channel, share, period / (2.0 * np.pi * damping), period)

    return [_grid(_WAVES, way)]


def swinging_force(found: Fit, colour: Colour) -> Colour:
    """Noise model `colour` with wave noise in the velocities along whose axes the latent force oscillates.

    Where the wave period is long beside the knots of the latent force, the force follows the waves, and no residual
    shows them.
    """
    for axis, channel in enumerate((U, V, R)):
        w = np.where(found.plant.seg.mask, found.point.w[..., axis] @ found.plant.hat.T, 0.0)
        lags = range(1, min(THRESHOLDS.count("swell_lag"), w.shape[1] - 1) + 1)
        correlation = np.array([np.sum(w[:, lag:] * w[:, :-lag]) for lag in lags]) / max(np.sum(w**2), 1e-300)
        lowest, later = np.minimum.accumulate(correlation), np.maximum.accumulate(correlation[::-1])[::-1]
        half = int(np.argmax(later - lowest))
        if np.isinf(colour.period[channel]) and later[half] - lowest[half] > THRESHOLDS.value("swell_correlation"):
            period = 1.0 + half + float(np.argmax(correlation[half:]))
            share, time = _WAVES[0][1], period / (2.0 * np.pi * _WAVES[2][0])
            colour = colour.with_channel(channel, share, time, period)
    return colour


def noise_in_words(found: Fit) -> dict[str, str]:
    """Describe the noise of each channel that is not white: wave motion, or errors of the sensor that last.

    It is no cause, but the reader has to know of it.
    """
    colour, dt = found.scales.colour, found.plant.seg.dt
    size = np.exp(0.5 * found.hyper.log_noise) * found.scales.noise * np.sqrt(colour.share)
    told = {}
    for channel in np.flatnonzero(colour.share).tolist():
        name = RESIDUALS[channel]
        unit, factor = CHANNEL_UNITS["position" if name in ("x", "y") else name]
        period, time = dt * colour.period[channel], dt * colour.time[channel]
        kind = (
            f"swings with a period of about {period:.2g} s, as in waves" if np.isfinite(period)
            else f"errors that are smooth for about {time:.2g} s, as of a filter" if colour.smooth[channel]
            else f"errors that last for about {time:.2g} s"
        )  # fmt: skip
        told[name] = f"{kind} (standard deviation {factor * size[channel]:.2g} {unit})"
    return told
