"""Effects between command and actuator, and default actuator dynamics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...effects.base import EFFECTS
from ...physics.actuators import Gear
from ..thresholds import THRESHOLDS

_RATE_POWER = {"n": 2, "delta": 1, "F": 0}
"""Power of the square root of the length by which a rate falls (Froude's law)."""


@dataclass(frozen=True)
class Ordinary:
    """Bounds of the default dynamics, at 130 m: greatest time constant [s], smallest rate [actuator's unit per s]."""

    T: float
    rate: float


ORDINARY = {
    "n": Ordinary(THRESHOLDS.value("shaft_time_constant"), THRESHOLDS.value("shaft_rate")),
    "delta": Ordinary(THRESHOLDS.value("rudder_time_constant"), np.deg2rad(THRESHOLDS.value("rudder_rate"))),
    "F": Ordinary(THRESHOLDS.value("thruster_time_constant"), 0.0),
}
"""Bounds for shaft, rudder and thrusters. The rate of thrusters has no bound."""


@dataclass(frozen=True)
class GearFinding:
    """Effect on actuator dynamics.

    score: 2 log likelihood ratio against the best default dynamics, of one stage or two, samples discounted for their
    correlation, less log(10 N) for the added value; value: of the effect's parameter, ci95; per_run (N,); detectable:
    detection limit (of a rate the greatest), NaN for none.
    """

    effect: str
    score: float
    value: float
    ci95: tuple[float, float]
    per_run: np.ndarray
    actuator: str
    gear: Gear
    detectable: float = np.nan


@dataclass(frozen=True)
class Kind:
    """Effect on one actuator: bounds of its value, and the field of the dynamics that it sets; `beyond` is subtracted
    when it is reported."""

    effect: str
    field: str
    low: float
    high: float
    beyond: float = 0.0

    @property
    def at(self) -> int:
        """Index of its value beside time constant and rate, or in place of one of them."""
        return {"T": 0, "rate": 1}.get(self.field, 2)

    def like(self, ordinary: np.ndarray, size: float) -> np.ndarray:
        """Logarithms of time constant, rate[, value] of dynamics with this effect, otherwise the `ordinary` ones."""
        return np.concatenate([ordinary[: self.at], [np.log(size)], ordinary[self.at + 1 :]])


def least_rate(actuator: str, scale: float) -> float:
    """Least rate of default dynamics, by Froude's law; a full-scale rudder under 130 m need be no faster (SOLAS)."""
    if actuator == "delta" and scale > 0.4:
        scale = max(scale, 1.0)
    return ORDINARY[actuator].rate / scale ** _RATE_POWER[actuator]


def slow_on_any_ship(found: GearFinding) -> bool:
    """Check whether dynamics too slow for this ship are too slow for the longest ship as well.

    Values that do not depend on the length count as such.
    """
    scale = (THRESHOLDS.value("longest_ship") / 130.0) ** 0.5
    changed = EFFECTS.get(found.effect).traits.gear_field
    if changed == "T":
        return ORDINARY[found.actuator].T * scale < found.gear.T
    return changed != "rate" or bool(found.gear.rate < least_rate(found.actuator, scale))


def kinds_of(actuator: str, scale: float, span: float, ordinary: Gear) -> list[Kind]:
    """Effects of an actuator; `span` is the range of its commands."""
    T, rate = ORDINARY[actuator].T * scale, least_rate(actuator, scale)
    bounds = {
        "T": (T, 60.0 * scale, ordinary.T), "rate": (0.02 * rate, rate),
        "delay": (0.15 * scale, THRESHOLDS.value("longest_delay") * scale),
        "deadband": (0.004 * span, 0.3 * span), "backlash": (0.004 * span, 0.3 * span),
    }  # fmt: skip
    found = [
        e for e in map(EFFECTS.get, EFFECTS.names()) if any(channel.startswith(actuator) for channel in e.acts_through)
    ]
    return [Kind(e.name, name, *bounds[name]) for name in bounds for e in found if e.traits.gear_field == name]
