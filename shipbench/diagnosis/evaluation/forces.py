"""Forces of identified causes on the ship along the runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects.base import flow_first
from ...estimation.coefficients import HULL, NUM_HULL, parameters
from ...estimation.laplace import Fit, point_from
from ...estimation.linearisation import Point, actives
from ...estimation.robust_prior import NOTICEABLE
from ...estimation.rollout import Active

AXES = ("surge", "sway", "yaw")


def force_of_term(found: Fit, index: int) -> dict[str, float]:
    """Greatest force of the index-th term on the runs, see `_greatest`; empty for effects on sensors or actuator
    dynamics."""
    now = actives(found.plant, found.scales, _point(found))
    if now[index].effect.enters != "force":
        return {}
    return _greatest(found, [*now[:index], *now[index + 1 :]])


def force_of_hull(found: Fit) -> dict[str, float]:
    """Greatest force of the hull's changes against the regressions, see `_greatest`."""
    return _greatest(found, actives(found.plant, found.scales, _point(found)), plain_hull=True)


def _point(found: Fit) -> Point:
    """Point of the estimates."""
    return point_from(found.model, found.point, found.solution, found.prior, found.estimate)


def _greatest(found: Fit, without: Sequence[Active], plain_hull: bool = False) -> dict[str, float]:
    """Percentile 99 of the magnitude of a cause's force in surge and sway [N] and moment about midship in yaw [N m],
    over all time steps.

    It is the change of the acceleration in the middle of every step, at the estimated motion, when the cause is left
    out, times the inertia of the baseline model. Axes where it is not practically significant are left out.
    """
    plant, point = found.plant, _point(found)
    now = actives(plant, found.scales, point)
    p, ship = parameters(found.scales, point.base)
    bare = [Active(HULL, (0.0,) * NUM_HULL), *ship[1:]] if plain_hull else ship
    middle = np.swapaxes(0.5 * (found.motion[:, :-1] + found.motion[:, 1:]), 0, 1)[None]
    path = plant.path_of(now)

    def rates(terms: Sequence[Active], hull: Sequence[Active]) -> np.ndarray:
        forces = flow_first([a for a in terms if a.effect.enters == "force"])
        return plant.rates_from(middle, p, [*forces, *hull], path, often=False)

    change = rates(now, ship) - rates(without, bare)
    change = np.swapaxes(change[0], 0, 1)[plant.seg.mask[:, 1:]]
    c = plant.c
    inertia = np.array([[c.m + c.m_x, 0.0, 0.0], [0.0, c.m11, c.m12_Y], [0.0, c.m12_N, c.m22]])
    acceleration, force = (np.quantile(np.abs(v), 0.99, axis=0) for v in (change, change @ inertia.T))
    noticed = (acceleration >= NOTICEABLE * found.scales.w) & np.isfinite(force)
    return {axis: float(f) for axis, f, seen in zip(AXES, force, noticed, strict=True) if seen}
