"""Wind forces on the ship above water. Wind direction is where the true wind comes FROM [rad, clockwise from north]."""

from __future__ import annotations

import math

from ..ops import Array, absolute, arctan2, cos, sin

RHO_AIR = 1.225
"""Density of air [kg/m^3] at 15 degrees C (ISA)."""


def apparent_wind(psi: Array, u: Array, v: Array, wind_speed: Array, wind_from: Array) -> tuple[Array, Array]:
    """Ship velocity relative to the air in body axes [m/s]: (u_rw, v_rw) = (u, v) + W (cos, sin)(wind_from - psi)."""
    angle = wind_from - psi
    return u + wind_speed * cos(angle), v + wind_speed * sin(angle)


KINDS = {"true": (0.0, 0.0), "true-bow": (1.0, 0.0), "apparent-north": (0.0, 1.0), "apparent": (1.0, 1.0)}
"""Kinds of recorded wind -> whether its direction counts from the bow, and whether the ship's own motion is in it."""


def true_wind(psi: Array, u: Array, v: Array, speed: Array, come_from: Array, kind: str) -> tuple[Array, Array]:
    """North and east component of W (cos, sin)(wind_from), the true wind [m/s], of one recorded as `kind` (of `KINDS`).

    "apparent" is what an anemometer on board shows, W_A (cos, sin)(angle off the bow): the inverse of `apparent_wind`.
    """
    from_bow, moving = KINDS[kind]
    direction = come_from + from_bow * psi
    north, east = speed * cos(direction), speed * sin(direction)
    return north - moving * (u * cos(psi) - v * sin(psi)), east - moving * (u * sin(psi) + v * cos(psi))


def blendermann(u_rw: Array, v_rw: Array, A_F: float, A_L: float, L: float) -> tuple[Array, Array, Array]:
    """Wind force (X, Y, N) about midship of a loaded container ship.

    gamma = -atan2(v_rw, u_rw); D = 1 - kappa/2 (1 - CDl/CDt) sin^2(2 gamma); C_X = -CD_lAF cos(gamma)/D, C_Y = CD_t
    sin(gamma)/D, C_N = -0.18 (|gamma| - pi/2) C_Y (lateral area centred at midship); forces on rho_a/2 V^2 times A_F,
    A_L, A_L L.

    Source: Blendermann (1994), container ship with deck load: CD_t 0.90, CD_lAF 0.55, kappa 0.40. Limit: no force in
    still air at rest.
    """
    CD_t, CD_lAF, kappa = 0.90, 0.55, 0.40
    CD_l = CD_lAF * A_F / A_L
    gamma = -arctan2(v_rw, u_rw + 1e-12)
    s2 = sin(2.0 * gamma)
    D = 1.0 - 0.5 * kappa * (1.0 - CD_l / CD_t) * s2 * s2
    C_Y = CD_t * sin(gamma) / D
    q = 0.5 * RHO_AIR * (u_rw * u_rw + v_rw * v_rw)
    return (
        -q * A_F * CD_lAF * cos(gamma) / D,
        q * A_L * C_Y,
        -q * A_L * L * 0.18 * (absolute(gamma) - math.pi / 2) * C_Y,
    )


def harmonic(u_rw: Array, v_rw: Array, A_F: float, A_L: float, L: float) -> tuple[Array, Array, Array]:
    """Wind force (X, Y, N) about midship from the lowest harmonics, for a ship whose superstructure is not known.

    C_X = -0.9 cos(gamma), C_Y = 0.95 sin(gamma), C_N = 0.1 sin(2 gamma), gamma as in `blendermann`. Written in
    velocities: nothing is undefined in still air.

    Source: simplified form in github.com/nikpau/mmgdynamics, but for C_N: that has 0.2, twice the second harmonic of
    Blendermann's 0.18 (pi/2 - gamma) C_Y (0.09), whose slope 0.18 holds for all his types of ship.
    """
    q = 0.5 * RHO_AIR
    speed = (u_rw * u_rw + v_rw * v_rw + 1e-12) ** 0.5
    return -0.9 * q * A_F * u_rw * speed, -0.95 * q * A_L * v_rw * speed, -0.2 * q * A_L * L * u_rw * v_rw
