"""Propeller thrust: open-water polynomials, four quadrants, wake in manoeuvring, and the side force going astern.

Shaft speed is in rev/s here (the state's rpm is converted by the caller); thrust T in N, ahead positive.
"""

from __future__ import annotations

import math

from ..ops import Array, absolute, arctan2, cos, exp, maximum, sin, sqrt, where

# Fourier coefficients A_k, B_k (k = 0..20) of 100 C_T for the Wageningen B4-70 screw at P/D = 0.8.
# Source: Roddy, Hess & Faller (2006), NSWCCD-50-TR-2006/004; ten harmonics are not enough (K_T(0) would fall to 0.28).
B4_70_PD08_A = (
    2.8757, 13.007, 0.62869, 2.8104, -1.6832, -4.4894, 0.37703, 3.1647, -0.13492, -1.9905, 0.17576,
    1.975, -0.11063, -0.069828, 0.25665, 0.80681, -0.18781, 0.29821, 0.48643, 0.33893, -0.26851,
)  # fmt: skip
B4_70_PD08_B = (
    0.0, -77.762, -1.3032, 10.58, -1.0413, 4.5769, 1.4296, -0.39612, -0.9917, 2.0759, 0.90153,
    -0.029877, -0.56354, 0.94773, 0.23681, -0.53204, -0.071537, 0.52768, 0.0174, -0.68105, -0.204,
)  # fmt: skip

# Side force and moment of a right-handed screw turning astern: A1..A5 and B1..B5 of the Hachii form, Esso Osaka model.
# Source: low-speed MMG code of Osaka University, as in Miyauchi et al. (2022), doi 10.1007/s00773-022-00889-3.
_SIDE_A = (-7.9e-5, 7.99e-3, -4.93e-3, -5.87e-3, -5.58e-4)
_SIDE_B = (3.5e-5, -3.17e-3, 1.96e-3, 2.33e-3, 2.25e-4)


def thrust_quadratic(
    n: Array, V_A: Array, D: float, kt: tuple[float, float, float], rho: float, astern: float = 0.65
) -> Array:
    """Thrust from K_T = k0 + k1 J + k2 J^2, multiplied out so that nothing is divided by n.

    T = rho D^2 (k0 D^2 n|n| + k1 D n V_A + k2 V_A|V_A|) for n >= 0; turning astern the J-term is dropped and k0 is
    scaled by `astern`.

    Limits: first quadrant as published (Yasukawa & Yoshimura 2015, eq. 22-23). For n < 0 only the size is right: 0.65
    k0 is the level of the B4-70 four-quadrant curve at J = -0.2 to -0.5. At rest with n = 0 the thrust is 0.
    """
    ahead = maximum(n, 0.0)
    back = n - ahead
    return (
        rho
        * D**2
        * (
            kt[0] * D**2 * (ahead * ahead - astern * back * back)
            + kt[1] * D * ahead * V_A
            + kt[2] * V_A * absolute(V_A)
        )
    )


def thrust_four_quadrant(n: Array, V_A: Array, D: float, rho: float) -> Array:
    """Thrust of a B4-70 screw, P/D = 0.8, in all four quadrants.

    beta = atan2(V_A, 0.7 pi n D); T = rho/2 (V_A^2 + (0.7 pi n D)^2) pi/4 D^2 C_T(beta), 100 C_T = sum_k A_k cos(k
    beta) + B_k sin(k beta), k = 0..20.

    Source: Roddy, Hess & Faller (2006). Limit: 0 at rest with n = 0.
    """
    tip = 0.7 * math.pi * D * n
    beta = arctan2(V_A, tip + 1e-12)  # the shift keeps the derivative finite at rest
    c, s = cos(beta), sin(beta)
    total = B4_70_PD08_A[0] + 0.0 * beta
    ck, sk = c, s
    for a, b in zip(B4_70_PD08_A[1:], B4_70_PD08_B[1:], strict=True):
        total = total + a * ck + b * sk
        ck, sk = ck * c - sk * s, sk * c + ck * s  # angle addition: 2 trigonometric calls instead of 40
    return 0.5 * rho * (V_A * V_A + tip * tip) * (math.pi / 4.0) * D**2 * total / 100.0


def thrust_coefficient_four_quadrant(J: Array) -> Array:
    """K_T(J) of the B4-70 screw, P/D = 0.8, turning ahead: K_T = T / (rho n^2 D^4)."""
    return thrust_four_quadrant(1.0, J, 1.0, 1.0)


def wake_fraction(
    u: Array, v: Array, r: Array, w_P0: float, x_P: float, C1: float, C2_plus: float, C2_minus: float
) -> Array:
    """Wake fraction while manoeuvring.

    (1 - w_P) = (1 - w_P0) {1 + (1 - exp(-C1 |beta_P|)) (C2 - 1)}, beta_P = beta - x'_P r' taken geometrically as
    atan2(-(v + x_P r), u).

    Source: Yasukawa & Yoshimura (2015), eq. 24. Limits: w_P0 straight ahead; 0 going astern (the hull is then
    downstream); with C1 = 0 the wake stays w_P0.
    """
    beta_P = arctan2(-(v + x_P * r), maximum(u, 0.0) + 1e-3)
    C2 = where(beta_P > 0, C2_plus + 0.0 * beta_P, C2_minus)
    wake = 1.0 - (1.0 - w_P0) * (1.0 + (1.0 - exp(-C1 * absolute(beta_P))) * (C2 - 1.0))
    return where(u > 0, wake, 0.0 * wake)


def side_force_astern(n: Array, u: Array, D: float, L: float, T: float, rho: float) -> tuple[Array, Array]:
    """Side force Y_P [N] and moment N_P [N m] about midship of a right-handed screw turning astern.

    Y_P = rho/2 L T (nD)^2 {A1 + A2 J, J in [-0.35, -0.06]; A3 + A4 J below; A5 above}, J = u / (nD); N_P likewise with
    L^2 and B. The stern goes to port: Y_P < 0, N_P > 0. Zero for n >= 0.

    Source: form of Hachii with the values of the Esso Osaka, as in Miyauchi et al. (2022), doi
    10.1007/s00773-022-00889-3.
    """
    tip = where(n < 0, n, -1.0 + 0.0 * n) * D
    J = u / where(tip < -1e-6, tip, -1e-6 + 0.0 * tip)

    def piecewise(c: tuple[float, ...]) -> Array:
        return where(J > -0.06, c[4] + 0.0 * J, where(J < -0.35, c[2] + c[3] * maximum(J, -1.0), c[0] + c[1] * J))

    pressure = 0.5 * rho * L * T * where(n < 0, n * n, 0.0 * n) * D**2
    return pressure * piecewise(_SIDE_A), pressure * L * piecewise(_SIDE_B)


def race_speed(V_A: Array, thrust: Array, D: float, rho: float) -> Array:
    """Axial speed far behind the propeller, sqrt(V_A^2 + 8 T / (rho pi D^2)) (momentum theory); 0 where the thrust
    would stop the flow."""
    return sqrt(maximum(V_A * V_A + 8.0 * thrust / (rho * math.pi * D**2), 1e-8))


def race_through(V_A: Array, thrust: Array, D: float, rho: float) -> Array:
    """Axial speed far behind a propeller that drives ahead in a flow which may come from astern: negative where that is
    the stronger of the two."""
    s = V_A * absolute(V_A) + 8.0 * thrust / (rho * math.pi * D**2)
    return s / sqrt(sqrt(s * s + 1e-8))
