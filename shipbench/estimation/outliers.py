"""Segments of a record that are not fitted: the surplus of a long one, and outliers.

Outliers are segments that no ship's motion explains: a ship that is held, pushed or aground, or a record that jumps.
One such segment of ten seconds can have more influence on a cause than all others together.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..records import Run
from .forward import Plant
from .laplace import Fit
from .thresholds import THRESHOLDS


def strange_pieces(found: Fit) -> np.ndarray:
    """Outlying segments: their latent force, in any axis, is far above that of the others; the largest first."""
    gram, knots, z = found.gram, found.plant.knots, found.estimate
    left = len(z) // THRESHOLDS.count("segments_per_outlier") - int(np.sum(~found.plant.seg.mask.any(axis=1)))
    if left <= 0:
        return np.zeros(0, dtype=int)
    squares = np.empty((len(z), 3))
    for axis in range(3):
        at = slice(6 + axis * knots, 6 + (axis + 1) * knots)
        squares[:, axis] = np.sum(z[:, at] @ gram.K_inv * z[:, at], axis=1) + np.sum(
            gram.K_inv * found.cov[:, at, at], axis=(1, 2)
        )
    others = (squares.sum(axis=0) - squares) / (len(z) - 1)
    worst = np.max(squares / others, axis=1)
    order = np.argsort(-worst)[:left]
    return order[worst[order] > THRESHOLDS.value("doubtful_distance") ** 2]


def left_out(plant: Plant, runs: Sequence[Run]) -> list[str]:
    """State the parts left out of the fit: the share of a long record, and outliers, in the times of their runs."""
    seg = plant.seg
    fitted, whole = (
        seg.dt * float(np.maximum(seg.mask.sum(axis=1) - 1, 0).sum()),
        float(sum(run.t[-1] - run.t[0] - seg.dt for run in runs)),
    )
    found = []
    if fitted < (1.0 - THRESHOLDS.value("reported_share")) * whole:
        found.append(
            f"{fitted / whole:.0%} of the record is fitted, {len(seg.run)} pieces of {plant.steps * seg.dt:.0f} s, "
            "spread over all runs; "
            "`--thorough` fits up to twice as much."
        )
    pieces = []
    for piece in np.flatnonzero(~seg.mask.any(axis=1)):
        run = runs[seg.run[piece]]
        begins = run.t[0] + seg.start[piece]
        pieces.append(f"run '{run.id}', {begins:g} to {min(begins + plant.steps * seg.dt, run.t[-1]):g} s")
    if pieces:
        times = THRESHOLDS.value("doubtful_distance")
        found.append(
            f"left out, since the missing force is more than {times:.0f} times the ordinary one there "
            f"(ship held or pushed, or a record that jumps?): {'; '.join(pieces)}."
        )
    return found
