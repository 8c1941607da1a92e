"""Modifications of a ship's equations by effects: one list of places, read by the simulated ship and by the fitted one
alike.

An effect (`shipbench.effects`) writes its formula once, as changes of these fields; each ship applies a field to its
own rudder, hull and propeller. That keeps hidden cause and identified cause the same physics in two different
structures.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import NamedTuple

from ..ops import Array, absolute, smoothstep, tanh
from .hull import DEEP, HullFactors


class Flow(NamedTuple):
    """State of the flow for an effect, at one instant: place [m], time since the run began [s], motion over ground,
    actuators [rpm, rad, N, N]."""

    x: Array
    y: Array
    t: Array
    psi: Array
    u: Array
    v: Array
    r: Array
    n: Array
    delta: Array
    F_b: Array
    F_s: Array


@dataclass
class Modifiers:
    """Neutral as constructed: nothing is missing.

    u_c, v_c: velocity of the water in body axes [m/s]; drift: share of the wind's velocity that the water has besides.
    air_u, air_v: velocity of the air beyond the measured wind, body axes [m/s]; wind_X, wind_Y, wind_N: factors of the
    wind's forces and moment; wind_lever: of its side force, to add [m]. delta: rudder angle to add [rad]; rudder:
    factor of the rudder's lift; rudder_asymmetry a: factor 1 + a to starboard and 1 - a to port;
    stall: share of the lift lost beyond `stall_angle` [rad]; late_stall: the same from 26 to 37 deg, as any rudder may.
    race, thrust: factors of the race's excess speed and of the thrust; off_design: thrust [N] beside that of K_T, to
    add before the factor; straightening: factor of the sideways flow at the rudder, 1 + its asymmetry where it comes
    from port (positive) and 1 - where from starboard; straightening_r: factor of its part by yaw alone; backing: share
    of the flow at the rudder that a reversed propeller stops; reversal: a rudder angle counts 1 - 2 reversal where the
    flow comes from astern (1/2: nothing, 1: the other way); wake: added to the wake fraction. bow, stern: factors of
    the thrusters; lever: shift of the bow thruster [m]; loss: share of side force and moment lost at speed. mass, m_x,
    m_y, J_z: factors of the ship's mass (with its inertia), of added mass in surge and sway and of added inertia in
    yaw; coupling: added mass between sway and yaw, to add [kg m]; x_G: shift of the centre of gravity [m]. hull:
    factors of the hull's derivatives. X, Y, N: forces [N] and moment about midship [N m] to add.
    """

    u_c: Array = 0.0
    v_c: Array = 0.0
    drift: Array = 0.0
    air_u: Array = 0.0
    air_v: Array = 0.0
    wind_X: Array = 1.0
    wind_Y: Array = 1.0
    wind_N: Array = 1.0
    wind_lever: Array = 0.0
    delta: Array = 0.0
    rudder: Array = 1.0
    rudder_asymmetry: Array = 0.0
    stall: Array = 0.0
    stall_angle: Array = 0.4
    late_stall: Array = 0.0
    race: Array = 1.0
    straightening: Array = 1.0
    straightening_asymmetry: Array = 0.0
    straightening_r: Array = 1.0
    backing: Array = 0.0
    reversal: Array = 0.0
    thrust: Array = 1.0
    off_design: Array = 0.0
    wake: Array = 0.0
    bow: Array = 1.0
    stern: Array = 1.0
    lever: Array = 0.0
    loss: Array = 0.0
    mass: Array = 1.0
    m_x: Array = 1.0
    m_y: Array = 1.0
    J_z: Array = 1.0
    coupling: Array = 0.0
    x_G: Array = 0.0
    hull: HullFactors = field(default=DEEP)
    X: Array = 0.0
    Y: Array = 0.0
    N: Array = 0.0

    def scale_hull(self, **factors: Array) -> None:
        """Multiply factors of the hull, such as `Y_v=1.2`."""
        self.hull = replace(self.hull, **{k: getattr(self.hull, k) * f for k, f in factors.items()})

    def push(self, X: Array = 0.0, Y: Array = 0.0, N: Array = 0.0) -> None:
        """Add a force [N] and a moment [N m] about midship."""
        self.X, self.Y, self.N = self.X + X, self.Y + Y, self.N + N

    def water(self, air: tuple[Array, Array] | None, u: Array, v: Array) -> tuple[Array, Array]:
        """Velocity of the water in body axes [m/s]; u, v over ground, `air` the same relative to the air, or None where
        it is unknown."""
        if air is None or is_neutral(self.drift, 0.0):
            return self.u_c, self.v_c
        return self.u_c + self.drift * (u - air[0]), self.v_c + self.drift * (v - air[1])

    def wind_on(self, X: Array, Y: Array, N: Array) -> tuple[Array, Array, Array]:
        """Wind force [N] and moment [N m] on this ship, from those on an ordinary superstructure."""
        return self.wind_X * X, self.wind_Y * Y, self.wind_N * N + self.wind_lever * Y

    def sideways(self, w_R: Array) -> Array:
        """Sideways flow at the rudder [m/s] after straightening by hull and propeller; a single screw straightens the
        two sides unequally."""
        if is_neutral(self.straightening, 1.0) and is_neutral(self.straightening_asymmetry, 0.0):
            return w_R
        return self.straightening * (w_R + self.straightening_asymmetry * absolute(w_R))

    def lift_factor(self, alpha: Array) -> Array:
        """Factor of the rudder's lift at the angle of attack `alpha` [rad, positive turns to starboard]."""
        factor = self.rudder
        if not is_neutral(self.rudder_asymmetry, 0.0):
            factor = factor * (1.0 + self.rudder_asymmetry * tanh(alpha / 0.05))
        if not is_neutral(self.stall, 0.0):
            factor = factor * (1.0 - self.stall * smoothstep(absolute(alpha) - self.stall_angle, 0.0, 0.35))
        if not is_neutral(self.late_stall, 0.0):
            factor = factor * (1.0 - self.late_stall * smoothstep(absolute(alpha), 0.45, 0.65))
        return factor


def is_neutral(value: Array, neutral: float) -> bool:
    """Whether a field is still the plain number of a neutral `Modifiers`: its term can then be left out."""
    return isinstance(value, float) and value == neutral
