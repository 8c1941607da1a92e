"""Rudder forces: the MMG form in the propeller race (also reversing) and the lift and drag form of the source paper's
fit.

A positive rudder angle turns the ship to starboard: Y_R < 0 and N_R > 0 ahead.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from ..ops import Array, absolute, arctan2, cos, maximum, sign, sin, smoothstep, sqrt, where


@dataclass(frozen=True)
class MMGRudder:
    """Coefficients of the MMG rudder; lengths in ship lengths, area [m^2], height [m]."""

    A_R: float
    H_R: float
    f_alpha: float
    t_R: float
    a_H: float
    x_R: float
    x_H: float
    gamma_plus: float
    gamma_minus: float
    l_R: float
    epsilon: float
    kappa: float
    k_xr: float = 0.144
    c_pr: float = -0.176


def inflow_speed(
    u: Array, n: Array, thrust: Array, w_P: Array, c: MMGRudder, D: float, rho: float, race_factor: Array = 1.0
) -> Array:
    """Longitudinal inflow at the rudder [m/s] in the propeller race, without division by the advance ratio.

    n >= 0: u_R = eps sqrt(eta [u_P + kappa (sqrt(u_P^2 + 8 T/(rho pi D^2)) - u_P)]^2 + (1 - eta) u_P^2), u_P = (1 -
    w_P) u, eta = D/H_R. n < 0:  Kitagawa's form u_R = sign(s) sqrt|s|, s = eta sign(a) a^2 + (1 - eta) b^2 + c_pr u^2,
    a = b - k_xr sqrt(8|T|/(rho pi D^2)), b = eps (1 - w_P) u.

    Source: Yasukawa & Yoshimura (2015), eq. 38, written for low speed, and Kitagawa's form for n < 0, both as in
    Miyauchi et al. (2022). Limits: eps kappa sqrt(eta)
    times the race speed at u = 0; close to zero when backing with headway. Going astern with n < 0 it is u.
    """
    eta = min(D / c.H_R, 1.0)
    u_P = (1.0 - w_P) * u
    jet2 = 8.0 * absolute(thrust) / (rho * math.pi * D**2)
    race = sqrt(maximum(u_P * u_P + where(thrust > 0, jet2, -jet2), 1e-8))
    inner = u_P + c.kappa * race_factor * (race - u_P)
    ahead = (
        c.epsilon
        * sqrt(eta * inner * inner + (1.0 - eta) * u_P * u_P + 1e-10)
        * where(inner >= 0, 1.0 + 0.0 * inner, -1.0)
    )
    b = c.epsilon * u_P
    a = b - c.k_xr * sqrt(jet2 + 1e-10)
    loss = c.c_pr * smoothstep(
        -n, 0.0, 0.5
    )  # the loss grows with reversed revolutions, so that u_R is continuous at n = 0
    s = eta * sign(a) * a * a + (1.0 - eta) * b * b + loss * u * u
    backing = where(u >= 0, sign(s) * sqrt(absolute(s) + 1e-10), u)
    return where(n >= 0, ahead, backing)


def mmg_rudder(
    u: Array,
    v: Array,
    r: Array,
    delta: Array,
    u_R: Array,
    c: MMGRudder,
    L: float,
    rho: float,
    lift: Callable[[Array], Array] | None = None,
) -> tuple[Array, Array, Array]:
    """Rudder force (X_R, Y_R, N_R) about midship; `lift(alpha_R)` multiplies F_N where the blade is not as built.

    F_N = rho/2 A_R f_alpha U_R^2 sin(alpha_R), alpha_R = delta - atan2(v_R, u_R), v_R = -gamma_R (v + l_R L r);
    X_R = -(1 - t_R) F_N sin(delta), Y_R = -(1 + a_H) F_N cos(delta), N_R = -(x_R + a_H x_H) L F_N cos(delta).

    Source: Yasukawa & Yoshimura (2015), eq. 26-36. Limit: no force at zero rudder going straight.
    """
    side = v + c.l_R * L * r
    v_R = -where(side < 0, c.gamma_plus + 0.0 * side, c.gamma_minus) * side  # beta_R > 0 is side < 0
    flip = where(u_R >= 0, 1.0 + 0.0 * u_R, -1.0)  # reversed flow: the blade works from its trailing edge
    alpha = delta * flip - arctan2(v_R, absolute(u_R) + 1e-9)
    F_N = 0.5 * rho * c.A_R * c.f_alpha * (u_R * u_R + v_R * v_R) * sin(alpha)
    if lift is not None:
        F_N = F_N * lift(alpha)
    return (
        -(1.0 - c.t_R) * F_N * sin(delta),
        -(1.0 + c.a_H) * F_N * cos(delta),
        -(c.x_R + c.a_H * c.x_H) * L * F_N * cos(delta),
    )


def lift_slope(aspect_ratio: float) -> float:
    """Slope of the normal-force coefficient, f_alpha = 6.13 A / (A + 2.25) per rad (Fujii; Yasukawa & Yoshimura 2015,
    eq. 31)."""
    return 6.13 * aspect_ratio / (aspect_ratio + 2.25)
