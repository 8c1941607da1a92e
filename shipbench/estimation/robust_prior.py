"""Robust prior between ships: single parameters may be outliers.

A normal prior leaves no room for them, and the part of a parameter that it holds back would be reported as a cause.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .between_ships import STRUCTURE
from .budget import is_spent
from .coefficients import NUM_BASE, PLACES
from .gauss_newton import fit
from .gram import Reduced, solve
from .laplace import Fit
from .thresholds import THRESHOLDS

NOTICEABLE = THRESHOLDS.value("noticeable_force")
"""Size from which a force is practically significant, in units of the latent force."""
STRANGE = THRESHOLDS.value("outlying_parameter")
STRANGE_SIZE = THRESHOLDS.value("huber_knee")
STRANGE_SUM = THRESHOLDS.value("outlying_sum")
"""Limits of the prior between ships: a parameter, a mass or thrust, the sum of squares of all parameters."""
_SAME = 0.05
"""Relative change of the spreads at which they have converged."""


def widths_of(found: Fit, reduced: Reduced | None = None) -> np.ndarray:
    """Factors (NUM_BASE,) of the prior standard deviations, 1 within the prior: Huber's weights, at the optimum of this
    linearisation (iteratively reweighted)."""
    widths, knee = np.ones(NUM_BASE), THRESHOLDS.value("huber_knee")
    for _ in range(20):
        new = np.sqrt(np.maximum(np.abs(_base(found, reduced or found.reduced, widths)) / knee, 1.0))
        if np.max(np.abs(new / widths - 1.0)) < 0.1 * _SAME:
            break
        widths = new
    return widths


def needed(found: Fit, least: float = NOTICEABLE) -> np.ndarray:
    """Parameters (NUM_BASE,) in units of the prior standard deviation between ships (`STRUCTURE.wider`), as estimated
    beside a latent force of at least the size `least`. Differences that so small a force could explain need not belong
    to the ship."""
    reduced = found.gram.reduce(np.maximum(found.hyper.log_force, 2.0 * np.log(least)))
    z = _base(found, reduced, widths_of(found, reduced))
    for name, factor in STRUCTURE.wider(found.plant.ship).items():
        z[PLACES[name]] /= factor
    return z


def is_strange(z: np.ndarray) -> bool:
    """Check whether the parameters (NUM_BASE,) that are `needed` lie outside the prior between ships."""
    return bool(np.max(np.abs(z)) > STRANGE or np.sum(z**2) > STRANGE_SUM)


def _base(found: Fit, reduced: Reduced, widths: np.ndarray) -> np.ndarray:
    return solve(reduced, replace(found.model, widths=tuple(widths)).prior(found.log_tau2)).mean[:NUM_BASE]


def widened(found: Fit) -> Fit:
    """Fit the same model with as wide a prior for each parameter as it needs.

    The old fit is kept where the wider one has less evidence: winds of single runs and wind coefficients can compensate
    each other.
    """
    for _ in range(3):
        widths = widths_of(found)
        if is_spent() or np.max(np.abs(widths / np.asarray(found.model.widths or 1.0) - 1.0)) < _SAME:
            break
        model = replace(found.model, widths=tuple(widths))
        wider = fit(
            found.plant,
            found.scales,
            model,
            found.point,
            found.hyper,
            found.log_tau2,
            candidates=found.candidates,
            guess=found.motion,
        )
        if wider.evidence < found.evidence:
            break
        found = wider
    return found
