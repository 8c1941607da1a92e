"""Whether the ship file is that of the ship that sailed, and what can be said while that is in doubt."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects.base import EFFECTS
from ..actuators.kinds import slow_on_any_ship
from ..inference.laplace import Fit
from ..inference.robust_prior import STRANGE_SIZE, is_strange, needed
from ..model.linearisation import NUM_BASE, PLACES
from .agreement import shows_on_any_ship
from .analysis import Analysis
from .other_size import better_size, size_instead_of

ORDINARY_SUM = 20.0
"""Sum of squares below which no other size is tried, which takes as long as the first fit. (With the files of ships of less than 0.6 or more than 1.7
times the length: 22 and more.)"""
ODD, ODD_SUM = 5.0, 75.0
"""Of one parameter and of all, from which a cause that goes by the ship file is told with a warning. (Of 74 sets with right files 8 reach
one of them, all of ships of the literature; of 42 with wrong ones 33.)"""
_MOST = 100.0
STRANGE_THRUST = 4.0
"""Of the thrust the fit asks for, in units of what the ship file leaves open of it (of kt a factor of 1.2, of the diameter 2.2 besides)."""
ODD_THRUST = 1.3
"""Factor of the thrust of an estimated propeller from which it is spoken of."""
_QUESTION = "Is the ship file that of this ship (L, B, T, displacement, propeller, rudder, units)?"


def doubts_of(found: Analysis) -> list[str]:
    """Signs that the model does not belong to the data, in one warning: the fit leaves what is ordinary, hull or propeller would be another ship's,
    a ship of quite another size explains the runs better, or one of nearly the same size does as well as the causes where the fit is odd. Causes in
    whose place something unknown is told raise none, nor do parameters that are ordinary without causes."""
    fit = found.final if found.unknown is None else found.selection.null
    z = needed(fit)
    signs = []
    if is_strange(z) and is_strange(needed(found.selection.null)):
        signs.append(_moved(z))
    if abs(z[PLACES["log_thrust"]]) > STRANGE_THRUST:
        signs.append(f"the propeller would have to give {_thrust_factor(fit):.2g} times the thrust that the ship file makes likely")
    for term, value in zip(fit.model.terms, fit.values, strict=True):
        if term.effect.family in ("hull", "propulsion") and np.max(np.abs(value)) > STRANGE_SIZE:
            signs.append(f"{term.label} would have to be {np.max(np.abs(value)):.1f} times its typical size")
    if not signs and np.sum(z**2) > ORDINARY_SUM:
        signs = better_size(found.selection.plain)
    if not signs and _is_odd(z) and (size := _size_instead(found, [term.label for term in fit.model.terms])):
        signs = [_moved(z), *size]
    if not signs:
        return []
    return [
        f"{'; '.join(signs)}. {_QUESTION} Until that is sure, nothing is named but what shows whatever the ship is (faults of sensors, delay and "
        "play of gears seen in their own record, those slow for any ship, and forces that know port from starboard or a direction of the earth, with "
        "their sizes on the ship of the file); the candidates below are ranked as if it were."
    ]


def odd_for(found: Analysis, named: Sequence[str]) -> list[str]:
    """A warning where a cause is named that the file of another ship may make, too, and the fit is odd, though not beyond all ships, or a ship of
    nearly the same size does as well as the cause."""
    by_file = [name for name in named if not whatever_the_ship(name, found)]
    if not by_file:
        return []
    z = needed(found.final)
    signs = [f"{_moved(z)}, which few ships need"] if _is_odd(z) else _size_instead(found, by_file)
    if not signs:
        return []
    return [
        f"{'; '.join(signs)}. {_QUESTION} The file of another ship, too, may make {' and '.join(by_file)}: believe "
        f"{'it' if len(by_file) == 1 else 'them'} only when that is sure."
    ]


def _is_odd(z: np.ndarray) -> bool:
    return bool(np.max(np.abs(z)) > ODD or np.sum(z**2) > ODD_SUM)


def _size_instead(found: Analysis, among: Sequence[str]) -> list[str]:
    """What is said if a ship of nearly the same size does as well as those of the causes `among` that go by the ship file and act as forces."""
    terms = {t.label: i for i, t in enumerate(found.final.model.terms) if t.label in among and not whatever_the_ship(t.label, found)}
    worth = sum(0.5 * found.score(i)[0] for i in terms.values())
    return size_instead_of(" and ".join(terms), worth, found.selection.plain) if terms else []


def whatever_the_ship(name: str, found: Analysis) -> bool:
    """Whether a cause shows beside the coefficients of another ship, too: a fault of a sensor, delay or play of a gear seen in its own record, a
    force that breaks a symmetry which every ship has. (46 trials, with nothing, wind, a rudder offset or a current hidden, each diagnosed with
    another ship's file: no sensor and no such force was named but those that were there, while thrust, mass and others were.) With the file of a
    shorter ship an ordinary rudder or shaft is slow: it must be slow for the longest ship. A wind of each run and a bank act through coefficients
    alone, and what these lack in a run's manoeuvre, or in those of one place, passes for them (a current shows in track and speeds besides; a ship
    that towed a barge on an elastic line had a bank). Of a change, what has changed decides."""
    effect = EFFECTS.get(name)
    if effect.traits.search == "change":
        effect = next((t.effect for t in found.final.model.terms if t.since is not None), effect)
    return shows_on_any_ship(effect) or any(g.effect == name and slow_on_any_ship(g) for g in found.gears)


def own_propeller(found: Analysis) -> list[str]:
    """What the runs say of a propeller that the ship file leaves open."""
    factor, ship = _thrust_factor(found.final), found.final.plant.ship
    if max(factor, 1.0 / factor) < ODD_THRUST:
        return []
    what = "diameter, kt" if ship.lacks("propeller") else "kt"
    return [
        f"the ship file does not give the propeller's {what}: the runs suggest {factor:.2g} times the thrust of the estimate, by which the model "
        f"`physics` goes; give [propeller] {what}. Causes are judged with the thrust that suits the runs."
    ]


def _moved(z: np.ndarray) -> str:
    largest, together = (f"more than {_MOST:.0f}" if x > _MOST else f"{x:.1f}" for x in (np.max(np.abs(z)), np.sum(z**2) ** 0.5))
    return f"the fit moves a parameter by {largest} times its ordinary spread (all together {together} times)"


def _thrust_factor(fit: Fit) -> float:
    at = PLACES["log_thrust"]
    return float(np.exp(fit.scales.structure[at - NUM_BASE] * fit.solution.mean[at]))
