"""Coefficients of the ship as a vector: layout, and the values of eq. (2), hull and structure."""

from __future__ import annotations

from typing import NamedTuple, Protocol

import numpy as np

from ..effects.hull_derivatives import EFFECT as HULL
from ..physics import eq2
from ..ship import Particulars
from .between_ships import STRUCTURE
from .eq2_rollout import parameter_scale
from .priors import EQ2
from .rollout import Active
from .thresholds import THRESHOLDS

NUM_HULL = len(HULL.parameters)
FREE = tuple(int(prior.name[1:]) for prior in EQ2)
"""Parameters of p0..p10 that a symmetric ship has: resistance, lift and drag of the rudder."""
CENTRE, SPREAD = (np.array([getattr(prior, name) for prior in EQ2]) for name in ("centre", "spread"))
"""Prior means and standard deviations of the free parameters, in units of `parameter_scale`."""
_ONE_SIGN = np.array([p.name in ("Y_v", "N_v", "N_r") for p in HULL.parameters])
"""Derivatives that have one sign on every hull."""
NUM_BASE = len(FREE) + NUM_HULL + len(STRUCTURE.parameters)
PLACES = {p.name: len(FREE) + NUM_HULL + i for i, p in enumerate(STRUCTURE.parameters)}
"""Place of each parameter of the structure among all NUM_BASE."""


class HasShipScales(Protocol):
    """Units of the coefficients of one ship, alone (`ShipScales`) or with those of everything else."""

    @property
    def p(self) -> np.ndarray: ...

    @property
    def structure(self) -> np.ndarray: ...

    @property
    def centre(self) -> np.ndarray | None: ...


class ShipScales(NamedTuple):
    """Units of the coefficients of one ship: `p` of p0..p10, `structure` of the structure's values. `centre`: what is
    added to `base`, None for nothing."""

    p: np.ndarray
    structure: np.ndarray
    centre: np.ndarray | None = None

    @classmethod
    def of(cls, ship: Particulars, c: eq2.Coefficients, measured_wind: bool) -> ShipScales:
        """Units for a ship, with or without a measured wind."""
        return cls(parameter_scale(c), STRUCTURE.spreads(ship, measured_wind))


def hull_changes(base: np.ndarray) -> np.ndarray:
    """Relative changes (..., NUM_HULL) of the hull's derivatives and added masses, from their values in `base`."""
    change, linear = THRESHOLDS.value("ordinary_spread") * base, THRESHOLDS.value("hull_change_linear")
    least = 1.0 - linear
    bounded = np.maximum(change, least * np.exp(np.minimum(change + linear, 0.0) / least) - 1.0)
    return np.where(_ONE_SIGN, bounded, change)


def parameters(scales: HasShipScales, base: np.ndarray) -> tuple[list[np.ndarray | float], list[Active]]:
    """Parameters p0..p10, and the changes of the hull and of the structure, from `base` (..., 15).

    Leading axes are kept, so that (D, 1) spreads over segments.
    """
    base = base if scales.centre is None else base + scales.centre
    p: list[np.ndarray | float] = [0.0] * 11
    for i, index in enumerate(FREE):
        p[index] = (CENTRE[i] + SPREAD[i] * base[..., i]) * scales.p[index]
    at = len(FREE) + NUM_HULL
    changes = hull_changes(base[..., len(FREE) : at])
    hull = tuple(changes[..., i] for i in range(NUM_HULL))
    structure = tuple(spread * base[..., at + i] for i, spread in enumerate(scales.structure))
    return p, [Active(HULL, hull), Active(STRUCTURE, structure)]
