"""Causes outside the library: a diagnosis must answer `unknown`, with the variable on which the force depends.

They are not registered and no candidate has their form. q: amplitude as a factor of `STRENGTH`, or of a sensor error of
2 deg or 10 %, then a phase or a reference value.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from ...effects.base import Effect, Parameter
from ...ops import Array, absolute, cos, sin
from ...physics.modifiers import Flow, Modifiers
from ...ship import Particulars
from ...signals import PSI, R, U, V

STRENGTH = {"X": 4e-3, "Y": 6e-3, "N": 6e-5}
"""Accelerations [m/s^2, m/s^2, rad/s^2 at 130 m] of amplitude 1: two to three times what a wind of 7 m/s gives a
container ship."""

Formula = Callable[[Modifiers, Flow, Sequence[Array], Particulars], None]
Misreading = Callable[[np.ndarray, Sequence[Array]], None]
"""Function that changes the states (runs, samples, 10) of the sensors, in place."""


class Outside(Effect):
    """Cause outside the library. variables: those that count as right."""

    family = "outside"
    summary = "a cause outside the library"
    source = "made up for the suite"
    parameters = (Parameter("amplitude", "1", 1.0, -5.0, 5.0),)

    def __init__(self, name: str, variables: Sequence[str], formula: Formula) -> None:
        self.name, self.variables, self.formula = name, frozenset(variables), formula

    def __reduce__(self) -> tuple[Callable[[str], Outside], tuple[str]]:
        return get, (self.name,)

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        self.formula(e, s, q, ship)


class OutsideSensor(Outside):
    """Sensor error outside the library."""

    def __init__(self, name: str, variables: Sequence[str], misread: Misreading) -> None:
        super().__init__(name, variables, lambda *_: None)
        self.misread = misread

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        out = S.copy()
        self.misread(out, q)
        return out


def _unit(axis: str, ship: Particulars) -> float:
    """Force [N] or moment [N m] of amplitude 1."""
    if axis == "N":
        return STRENGTH["N"] * 130.0 / ship.L * 1.8 * ship.mass * ship.L**2 / 16.0
    return STRENGTH[axis] * ship.mass * (1.9 if axis == "Y" else 1.05)


def _heading(e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
    e.push(0.0, 0.0, q[0] * _unit("N", ship) * cos(3.0 * s.psi + q[1]))


def _periodic(e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
    e.push(0.0, q[0] * _unit("Y", ship) * sin(2.0 * math.pi * s.t / (60.0 * (ship.L / 130.0) ** 0.5) + q[1]), 0.0)


def _drift(e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
    e.push(q[0] * _unit("X", ship) * s.t / (120.0 * (ship.L / 130.0) ** 0.5), 0.0, 0.0)


def _ventilation(e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
    e.thrust = e.thrust * (1.0 - 0.5 * absolute(q[0]) * np.minimum(absolute(s.delta) / 0.5, 1.0))


def _revolutions_yaw(e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
    e.push(0.0, 0.0, -q[0] * _unit("N", ship) * (s.n / q[1]) * (s.r / (0.008 * (130.0 / ship.L) ** 0.5)))


def _drift_revolutions(e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
    e.push(0.0, -q[0] * _unit("Y", ship) * (s.n / q[1]) * (s.v / (0.4 * (ship.L / 130.0) ** 0.5)), 0.0)


def _place(e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
    e.push(0.0, q[0] * _unit("Y", ship) * (s.x * cos(q[1]) + s.y * sin(q[1])) / (400.0 * ship.L / 130.0), 0.0)


def _deviation(S: np.ndarray, q: Sequence[Array]) -> None:
    S[..., PSI] += q[0] * math.radians(2.0) * cos(S[..., PSI] + q[1])


def _turned_log(S: np.ndarray, q: Sequence[Array]) -> None:
    S[..., V] += q[0] * math.radians(2.0) * S[..., U]


def _gyro_scale(S: np.ndarray, q: Sequence[Array]) -> None:
    S[..., R] *= 1.0 + 0.1 * q[0]


OUTSIDE = (
    Outside("yaw moment with the third harmonic of heading", ("heading",), _heading),
    Outside("side force of 60 s period", ("time",), _periodic),
    Outside("surge force that grows with time in the run", ("time",), _drift),
    Outside("thrust lost with the size of the rudder angle", ("rudder", "revolutions"), _ventilation),
    Outside("yaw moment with revolutions times yaw rate", ("revolutions", "yaw rate"), _revolutions_yaw),
    Outside("side force with revolutions times drift", ("revolutions", "sway"), _drift_revolutions),
    Outside("side force that goes with the place", ("position",), _place),
    OutsideSensor("compass deviation that goes with the heading", ("heading",), _deviation),
    OutsideSensor("speed log mounted at an angle", ("speed",), _turned_log),
    OutsideSensor("scale of the yaw rate", ("yaw rate",), _gyro_scale),
)
"""A product has two right variables: the force does follow both."""

_ALIASES = {
    "heading": "heading psi course", "time": "time t clock", "rudder": "rudder delta helm",
    "revolutions": "revolutions n rpm shaft propeller thrust",
    "yaw rate": "yaw_rate yawrate r yaw turning", "sway": "sway v drift beta", "speed": "speed u surge forward",
    "position": "position place x y",
}  # fmt: skip


def get(name: str) -> Outside:
    """Outside cause of that name."""
    return next(item for item in OUTSIDE if item.name == name)


def canonical(variable: str) -> frozenset[str]:
    """Standard names of the variables in a text such as "psi", "|delta|", "n*r" or "yaw rate"."""
    text = (
        variable.lower()
        .replace("yaw rate", "yaw_rate")
        .replace("sway velocity", "sway")
        .replace("forward speed", "speed")
    )
    words = "".join(c if c.isalpha() or c == "_" else " " for c in text).split()
    return frozenset(name for name, words_of in _ALIASES.items() if set(words) & set(words_of.split()))
