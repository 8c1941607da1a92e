"""What of a record is not fitted: what a long one has too much of, and pieces that no ship's motion explains: held, pushed or aground, a record that
jumps. One such piece of ten seconds can speak louder for a cause than all others together."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...records import Run
from ..model.forward import Plant
from .laplace import Fit

_STRANGE = 30.0
"""Times the square of the latent force in the other pieces (five times their force)."""
_ONE_IN = 100
"""At most one piece in so many is left out: what happens more often is a part of these runs."""
_MOST = 0.95
"""Share of the record below which it is said how much is fitted."""


def strange_pieces(found: Fit) -> np.ndarray:
    """Pieces whose latent force, in any axis, is far beyond that of the others; the strangest first."""
    gram, knots, z = found.gram, found.plant.knots, found.estimate
    left = len(z) // _ONE_IN - int(np.sum(~found.plant.seg.mask.any(axis=1)))
    if left <= 0:
        return np.zeros(0, dtype=int)
    squares = np.empty((len(z), 3))
    for axis in range(3):
        at = slice(6 + axis * knots, 6 + (axis + 1) * knots)
        squares[:, axis] = np.sum(z[:, at] @ gram.K_inv * z[:, at], axis=1) + np.sum(gram.K_inv * found.cov[:, at, at], axis=(1, 2))
    others = (squares.sum(axis=0) - squares) / (len(z) - 1)
    worst = np.max(squares / others, axis=1)
    order = np.argsort(-worst)[:left]
    return order[worst[order] > _STRANGE]


def left_out(plant: Plant, runs: Sequence[Run]) -> list[str]:
    """What was left out of the fit: the share of a long record, and strange pieces, in the times of their runs."""
    seg = plant.seg
    fitted, whole = seg.dt * float(np.maximum(seg.mask.sum(axis=1) - 1, 0).sum()), float(sum(run.t[-1] - run.t[0] - seg.dt for run in runs))
    found = []
    if fitted < _MOST * whole:
        found.append(
            f"{fitted / whole:.0%} of the record is fitted, {len(seg.run)} pieces of {plant.steps * seg.dt:.0f} s, spread over all runs; "
            "`--thorough` fits up to twice as much."
        )
    pieces = []
    for piece in np.flatnonzero(~seg.mask.any(axis=1)):
        run = runs[seg.run[piece]]
        begins = run.t[0] + seg.start[piece]
        pieces.append(f"run '{run.id}', {begins:g} to {min(begins + plant.steps * seg.dt, run.t[-1]):g} s")
    if pieces:
        found.append(
            f"left out, since the missing force is more than {_STRANGE**0.5:.0f} times the ordinary one there (ship held or pushed, or a record that "
            f"jumps?): {'; '.join(pieces)}."
        )
    return found
