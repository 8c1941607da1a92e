"""Hull forces of the MMG model: the published polynomial and the low-speed form that is regular at rest.

Velocities are relative to the water, at midship. Each returns (X_H, Y_H, N_H) in N and N m about midship.
"""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np

from ..ops import Array, absolute, arctan2, clip, sqrt

# 12-point Gauss-Legendre rule on [-1/2, 1/2] for the cross-flow integral.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_NODES, _WEIGHTS = _NODES / 2.0, _WEIGHTS / 2.0

_EPS_SPEED = 0.05
"""Regularising speed [m/s] at ship length 100 m; scaled with sqrt(L)."""


@dataclass(frozen=True)
class PolynomialHull:
    """MMG derivatives, forces on rho/2 L T U^2, moments on rho/2 L^2 T U^2 (Yasukawa & Yoshimura 2015, eq. 8-10)."""

    R0: float
    X_vv: float
    X_vr: float
    X_rr: float
    X_vvvv: float
    Y_v: float
    Y_r: float
    Y_vvv: float
    Y_vvr: float
    Y_vrr: float
    Y_rrr: float
    N_v: float
    N_r: float
    N_vvv: float
    N_vvr: float
    N_vrr: float
    N_rrr: float


@dataclass(frozen=True)
class UnifiedHull:
    """Low-speed coefficients (Yoshimura, Nakao & Ishibashi 2009); X0_F, X0_A < 0 are the resistance ahead and
    astern."""

    X0_F: float
    X0_A: float
    X_vv: float
    X_vr: float
    X_rr: float
    Y_v: float
    Y_r: float
    N_v: float
    N_r: float
    C_D: float
    C_rY: float
    C_rN: float


@dataclass(frozen=True)
class HullFactors:
    """Multipliers of the linear derivatives, of the nonlinear terms of each axis and of the resistance; arrays per run
    or floats."""

    Y_v: Array = 1.0
    Y_r: Array = 1.0
    N_v: Array = 1.0
    N_r: Array = 1.0
    X_nonlinear: Array = 1.0
    Y_nonlinear: Array = 1.0
    N_nonlinear: Array = 1.0
    resistance: Array = 1.0

    def __mul__(self, other: HullFactors) -> HullFactors:
        return HullFactors(**{f.name: getattr(self, f.name) * getattr(other, f.name) for f in fields(self)})


DEEP = HullFactors()


def polynomial(
    u: Array, v: Array, r: Array, c: PolynomialHull, L: float, T: float, rho: float, f: HullFactors = DEEP
) -> tuple[Array, Array, Array]:
    """Hull force from the cubic MMG polynomial.

    v' = v/U, r' = rL/U with U = sqrt(u^2 + v^2 + eps^2) and |r'| <= 1.5, so that it stays finite at rest; the
    resistance is R0 u|u|.

    Source: Yasukawa & Yoshimura (2015), eq. 8-10. Limits: zero at rest; good for |beta| < 25 deg, |r'| < 1, u > 0.
    """
    eps = _EPS_SPEED * (L / 100.0) ** 0.5
    speed = sqrt(u * u + v * v + eps * eps)
    vp, rp = v / speed, clip(r * L / speed, -1.5, 1.5)
    force = 0.5 * rho * L * T * speed * speed
    X = force * f.X_nonlinear * (c.X_vv * vp**2 + c.X_vr * vp * rp + c.X_rr * rp**2 + c.X_vvvv * vp**4)
    X = X - 0.5 * rho * L * T * c.R0 * f.resistance * u * absolute(u)
    Y3 = c.Y_vvv * vp**3 + c.Y_vvr * vp**2 * rp + c.Y_vrr * vp * rp**2 + c.Y_rrr * rp**3
    N3 = c.N_vvv * vp**3 + c.N_vvr * vp**2 * rp + c.N_vrr * vp * rp**2 + c.N_rrr * rp**3
    Y = force * (f.Y_v * c.Y_v * vp + f.Y_r * c.Y_r * rp + f.Y_nonlinear * Y3)
    N = force * L * (f.N_v * c.N_v * vp + f.N_r * c.N_r * rp + f.N_nonlinear * N3)
    return X, Y, N


def cross_flow(v: Array, r: Array, L: float, C_rY: float, C_rN: float) -> tuple[Array, Array]:
    """Integrals over the length, xi = x/L in [-1/2, 1/2], of w|w| and w|w| xi with w = v + C_r r L xi (per unit C_D;
    m^2/s^2)."""
    Y, N = 0.0, 0.0
    for xi, weight in zip(_NODES.tolist(), _WEIGHTS.tolist(), strict=True):
        wY, wN = v + C_rY * L * xi * r, v + C_rN * L * xi * r
        Y = Y + weight * wY * absolute(wY)
        N = N + weight * xi * wN * absolute(wN)
    return Y, N


def tilted_cross_flow(v: Array, r: Array, L: float) -> tuple[Array, Array]:
    """Integrals of 2 xi w|w| and 2 xi^2 w|w|, w = v + r L xi, of a drag that grows along the length (distributions
    along the hull: J. P. Hooft, Ocean Eng. 21 (1994) 329)."""
    Y, N = 0.0, 0.0
    for xi, weight in zip(_NODES.tolist(), _WEIGHTS.tolist(), strict=True):
        w = v + L * xi * r
        drag = 2.0 * weight * xi * w * absolute(w)
        Y, N = Y + drag, N + xi * drag
    return Y, N


def unified(
    u: Array, v: Array, r: Array, c: UnifiedHull, L: float, T: float, rho: float, f: HullFactors = DEEP
) -> tuple[Array, Array, Array]:
    """Hull force of the unified model for ocean and harbour: linear lift terms plus cross-flow drag; nothing is divided
    by the speed.

    X = rho/2 L T {[X0_F + (X0_A - X0_F)|beta|/pi] u U + (X_vv v^2 + X_rr L^2 r^2) u/U + X_vr L v r}
    Y = rho/2 L T {Y_v v|u| + Y_r L r u - C_D int |w|w dxi},  N = rho/2 L^2 T {N_v v u + N_r L r|u| - C_D int |w|w xi
    dxi}

    Source: Yoshimura, Nakao & Ishibashi (2009), with the quadratic drag terms X_vv, X_rr of the ship's polynomial,
    which oppose u.
    Limits: zero at rest; pure sway gives Y = -rho/2 L T C_D v|v|.
    """
    speed = sqrt(u * u + v * v + 1e-12)
    angle = absolute(arctan2(v, u + 1e-12)) / np.pi
    drag = c.X0_F + (c.X0_A - c.X0_F) * angle
    IY, IN = cross_flow(v, r, L, c.C_rY, c.C_rN)
    q = 0.5 * rho * L * T
    X = q * (
        f.resistance * drag * u * speed
        + f.X_nonlinear * ((c.X_vv * v * v + c.X_rr * L**2 * r * r) * u / speed + c.X_vr * L * v * r)
    )
    Y = q * (f.Y_v * c.Y_v * v * absolute(u) + f.Y_r * c.Y_r * L * r * u - f.Y_nonlinear * c.C_D * IY)
    N = q * L * (f.N_v * c.N_v * v * u + f.N_r * c.N_r * L * r * absolute(u) - f.N_nonlinear * c.C_D * IN)
    return X, Y, N
