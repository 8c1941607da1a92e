"""Test whether the ship file is that of the ship that sailed, and the results that hold while that is in doubt."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...effects.base import EFFECTS
from ...estimation.coefficients import NUM_BASE, PLACES
from ...estimation.laplace import Fit
from ...estimation.robust_prior import STRANGE_SIZE, is_strange, needed
from ..actuators.kinds import slow_on_any_ship
from ..thresholds import THRESHOLDS
from .agreement import shows_on_any_ship
from .analysis import Analysis
from .other_size import better_size, size_instead_of

_OF_SIMULATION = (
    "Is the simulation of this ship, with her units and signs? It differs from the runs by more than the coefficients "
    "of ordinary ships do from each other."
)
_QUESTION = "Is the ship file that of this ship (L, B, T, displacement, propeller, rudder, units)?"


def doubts_of(found: Analysis, of_simulation: bool = False) -> list[str]:
    """Warning on signs that the model does not belong to the data: the ship file's, or a simulation of the user's own.

    Signs: the fit lies outside the prior between ships, hull or propeller would be another ship's, a ship of quite
    another size explains the runs better, or one of nearly the same size does as well as the causes while the fit is an
    outlier. Causes in whose place an unknown one is reported raise none, nor do parameters within the prior without
    causes.
    """
    fit = found.final if found.unknown is None else found.selection.null
    z = needed(fit)
    signs = []
    if is_strange(z) and is_strange(needed(found.selection.null)):
        signs.append(_moved(z))
    if abs(z[PLACES["log_thrust"]]) > THRESHOLDS.value("doubtful_distance"):
        signs.append(
            f"the propeller would have to give {_thrust_factor(fit):.2g} times the thrust that the ship file makes "
            "likely"
        )
    for term, value in zip(fit.model.terms, fit.values, strict=True):
        if term.effect.family in ("hull", "propulsion") and np.max(np.abs(value)) > STRANGE_SIZE:
            signs.append(f"{term.label} would have to be {np.max(np.abs(value)):.1f} times its typical size")
    if not signs and not of_simulation:
        signs = _signs_of_size(found, z)
    if not signs:
        return []
    question = _OF_SIMULATION if of_simulation else _QUESTION
    return [
        f"{'; '.join(signs)}. {question} Until that is sure, only causes that do not depend on it are named. "
        "These are errors of sensors, delay and play of actuators in their own record, actuators too slow for any "
        "ship, and forces that break the symmetry of port and starboard or depend on an earth-fixed direction. "
        f"The candidates below are ranked as if the {'simulation' if of_simulation else 'file'} were right."
    ]


def _signs_of_size(found: Analysis, z: np.ndarray) -> list[str]:
    """Signs that a ship of another size sailed."""
    if np.sum(z**2) > THRESHOLDS.value("huber_knee") ** 2 and (signs := better_size(found.selection.plain)):
        return signs
    fit = found.final if found.unknown is None else found.selection.null
    size = _size_instead(found, [term.label for term in fit.model.terms]) if _is_odd(z) else []
    return [_moved(z), *size] if size else []


def odd_for(found: Analysis, named: Sequence[str]) -> list[str]:
    """Warning where an identified cause may also be due to the file of another ship, and the fit is an outlier, though
    not beyond all ships, or a ship of nearly the same size does as well as the cause."""
    by_file = [name for name in named if not whatever_the_ship(name, found)]
    if not by_file:
        return []
    z = needed(found.final)
    signs = [f"{_moved(z)}, which few ships need"] if _is_odd(z) else _size_instead(found, by_file)
    if not signs:
        return []
    return [
        f"{'; '.join(signs)}. {_QUESTION} A wrong ship file may also cause {' and '.join(by_file)}: "
        f"{'it is' if len(by_file) == 1 else 'they are'} certain only when the file is."
    ]


def _is_odd(z: np.ndarray) -> bool:
    one, together = THRESHOLDS.value("doubtful_distance"), THRESHOLDS.value("doubtful_sum")
    return bool(np.max(np.abs(z)) > one or np.sum(z**2) > together)


def _size_instead(found: Analysis, among: Sequence[str]) -> list[str]:
    """Return a sign if a ship of nearly the same size does as well as those of the causes `among` that go by the ship
    file and act as forces."""
    terms = {
        t.label: i
        for i, t in enumerate(found.final.model.terms)
        if t.label in among and not whatever_the_ship(t.label, found)
    }
    worth = sum(0.5 * found.score(i)[0] for i in terms.values())
    return size_instead_of(" and ".join(terms), worth, found.selection.plain) if terms else []


def whatever_the_ship(name: str, found: Analysis) -> bool:
    """Check whether a cause shows beside the coefficients of another ship, too (docs/calibration.md#ship-file).

    So do a fault of a sensor, delay or play of an actuator between command and record, and a force that breaks a
    symmetry which every ship has. With the file of a shorter ship an ordinary rudder or shaft is slow: it must be slow
    for the longest ship. A wind of each run and a bank do not: they act through coefficients alone, and what these lack
    in one manoeuvre or place passes for them. Of a change, what has changed decides.
    """
    effect = EFFECTS.get(name)
    if effect.traits.search == "change":
        effect = next((t.effect for t in found.final.model.terms if t.since is not None), effect)
    return shows_on_any_ship(effect) or any(g.effect == name and slow_on_any_ship(g) for g in found.gears)


def own_propeller(found: Analysis) -> list[str]:
    """Return a note on the thrust of a propeller that the ship file leaves open."""
    factor, ship = _thrust_factor(found.final), found.final.plant.ship
    if max(factor, 1.0 / factor) < THRESHOLDS.value("reported_ratio"):
        return []
    what = "diameter, kt" if ship.lacks("propeller") else "kt"
    return [
        f"the ship file does not give the propeller's {what}: the runs suggest {factor:.2g} times the thrust of the "
        "estimate, by which the model "
        f"`physics` goes; give [propeller] {what}. Causes are judged with the thrust that suits the runs."
    ]


def _moved(z: np.ndarray) -> str:
    largest, together = ("more than 100" if x > 100.0 else f"{x:.1f}" for x in (np.max(np.abs(z)), np.sum(z**2) ** 0.5))
    return f"the fit moves a parameter by {largest} times its ordinary spread (all together {together} times)"


def _thrust_factor(fit: Fit) -> float:
    at = PLACES["log_thrust"]
    return float(np.exp(fit.scales.structure[at - NUM_BASE] * fit.solution.mean[at]))
