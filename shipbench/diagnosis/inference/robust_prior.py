"""How far single parameters of a ship may lie from what is ordinary. A normal spread has no room for one that lies far off, and what it holds back
passes for a cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..budget import is_spent
from ..model.between_ships import STRUCTURE
from ..model.linearisation import NUM_BASE, PLACES
from .gauss_newton import fit
from .gram import Reduced, solve
from .laplace import Fit

NOTICEABLE = 0.14
"""Size from which a force is noticeable, and may doubt the ship file, in units of the latent force: 0.7 mm/s^2, a third of what a wind of 7 m/s
gives; in yaw 1.4e-5 rad/s^2 at 130 m. Exact sensors or many samples show with certainty that ships differ in form from eq. (2)."""
STRANGE, STRANGE_SIZE = 8.0, 3.0
"""In spreads: from here on a parameter is no ordinary ship's; and in typical sizes: a mass or a thrust."""
STRANGE_SUM = 160.0
"""Sum of squares of the fit's parameters, in units of what ships differ by, beside the causes.
(Sums with right ship files: 15 to 63 on MMG ships, up to 148 on ships of the literature and on the Esso Osaka; with wrong ones from 18 on; what
is not seen here may be seen by `better_size`.)"""
_FAR = 3.5
"""In spreads: up to here a parameter is ordinary, beyond its prior falls by Huber's linear tail instead of the square."""
_SOLVES, _FITS, _SAME = 20, 3, 0.05


def widths_of(found: Fit, reduced: Reduced | None = None) -> np.ndarray:
    """(NUM_BASE,) factors of the spreads, 1 for what is ordinary: Huber's weights, at the optimum of this linearisation (iteratively reweighted)."""
    widths = np.ones(NUM_BASE)
    for _ in range(_SOLVES):
        new = np.sqrt(np.maximum(np.abs(_base(found, reduced or found.reduced, widths)) / _FAR, 1.0))
        if np.max(np.abs(new / widths - 1.0)) < 0.1 * _SAME:
            break
        widths = new
    return widths


def needed(found: Fit, least: float = NOTICEABLE) -> np.ndarray:
    """(NUM_BASE,) parameters in units of what ships differ by (`STRUCTURE.wider`), as they would be beside a latent force of at least the size
    `least`: what so small a force could stand for need not be the ship's."""
    reduced = found.gram.reduce(np.maximum(found.hyper.log_force, 2.0 * np.log(least)))
    z = _base(found, reduced, widths_of(found, reduced))
    for name, factor in STRUCTURE.wider(found.plant.ship).items():
        z[PLACES[name]] /= factor
    return z


def is_strange(z: np.ndarray) -> bool:
    """Whether hull, propeller or rudder would be no ordinary ship's, given the parameters (NUM_BASE,) that are `needed`."""
    return bool(np.max(np.abs(z)) > STRANGE or np.sum(z**2) > STRANGE_SUM)


def _base(found: Fit, reduced: Reduced, widths: np.ndarray) -> np.ndarray:
    return solve(reduced, replace(found.model, widths=tuple(widths)).prior(found.log_tau2)).mean[:NUM_BASE]


def widened(found: Fit) -> Fit:
    """The same model, fitted with as wide a spread for each parameter as it needs; as it is, where such a fit ends in a worse place (winds of single
    runs whose size and coefficients make up for each other)."""
    for _ in range(_FITS):
        widths = widths_of(found)
        if is_spent() or np.max(np.abs(widths / np.asarray(found.model.widths or 1.0) - 1.0)) < _SAME:
            break
        model = replace(found.model, widths=tuple(widths))
        wider = fit(found.plant, found.scales, model, found.point, found.hyper, found.log_tau2, candidates=found.candidates, guess=found.motion)
        if wider.evidence < found.evidence:
            break
        found = wider
    return found
