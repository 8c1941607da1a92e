"""Columns of a linearisation in units of the noise, with its correlations taken out, and their products."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from .columns import Columns
from .forward import Plant
from .gram import Products
from .linearisation import Point, Scales
from .packed import GREATEST, pack, products


def products_of(
    plant: Plant, scales: Scales, point: Point, columns: Columns, channels: Sequence[int] = range(6)
) -> Products:
    """Products of `whitened` columns, of some channels."""
    seg, colour = plant.seg, scales.colour
    P, blocks = list[np.ndarray](), _blocks(plant, point, columns)
    for channel in channels:
        factor = colour.factor[channel] if colour.share[channel] > 0.0 else None
        part = products(blocks, channel, 1.0 / scales.noise[channel], factor, seg.mask & seg.seen[channel])
        if part is None:
            Z = whitened(plant, scales, point, columns, channels)
            P = [pack(np.swapaxes(z, 1, 2) @ z) for z in Z]
            break
        P.append(part)
    size, samples = sum(block.shape[-1] for block in blocks), seg.mask.sum(axis=1)
    return Products.of(
        P, size, samples, plant.knots, plant.knot_time, seg.run, seg.runs, colour.log_determinant(samples)
    )


@np.errstate(over="ignore", invalid="ignore")
def whitened(
    plant: Plant, scales: Scales, point: Point, columns: Columns, channels: Sequence[int] = range(6)
) -> np.ndarray:
    """Whitened columns [eta, w, base, own, candidates, e] (channels, B, K + 1, ...) in units of the scales; e is the
    residual with all linear contributions added back, so that all terms compete anew."""
    seg, B, blocks = plant.seg, len(point.eta), _blocks(plant, point, columns)
    edges = np.cumsum([0, *(block.shape[-1] for block in blocks)])
    Z = np.empty((len(channels), B, plant.steps + 1, edges[-1]))
    for block, (low, high) in zip(blocks, pairwise(edges), strict=True):
        by_channel = np.moveaxis(block.reshape(B, plant.steps + 1, 6, -1), 2, 0)
        for at, channel in enumerate(channels):
            np.divide(by_channel[channel], scales.noise[channel], out=Z[at, ..., low:high])
    if not np.isfinite(np.vdot(Z, Z)):
        Z[~(np.abs(Z) < GREATEST)] = 0.0
    scales.colour.whiten(Z, channels)
    Z[:, ~seg.mask] = 0.0
    Z[~seg.seen[list(channels)]] = 0.0
    return Z


@np.errstate(over="ignore", invalid="ignore")
def _blocks(plant: Plant, point: Point, columns: Columns) -> list[np.ndarray]:
    """Blocks (B, T, C) of the columns, in the order of `whitened`."""
    seg, B = plant.seg, len(point.eta)
    beside = np.concatenate([point.eta, np.moveaxis(point.w, -1, 1).reshape(B, -1)], axis=1)
    e = (seg.states[..., :6] - columns.predicted).reshape(B, -1)
    e = e + _times(columns.latent, beside) + columns.base @ point.base
    for term, value, own in zip(point.terms, point.values, columns.own, strict=True):
        e = e + _times(own, value[seg.run] if term.per_run else np.broadcast_to(value, (B, term.size)))
    return [columns.latent, columns.base, *columns.own, *columns.candidates, e[..., None]]


def _times(columns: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Products (B, T) of columns (B, T, C) and coefficients (B, C)."""
    return (columns @ values[:, :, None])[..., 0]
