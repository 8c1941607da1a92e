"""Manoeuvring coefficients from the main dimensions (level trim). Prime-I: force on rho/2 L^2 U^2; MMG: force on rho/2
L T U^2.

Validity: merchant ships. Against measured KCS and KVLCC2 values the linear derivatives are off by 10 to 25 %, the cubic
ones by 50 % and more: a fit that takes them as exact has these errors.
"""

from __future__ import annotations

import math
from typing import NamedTuple


class Clarke(NamedTuple):
    """Prime-I acceleration derivatives."""

    Y_vd: float
    Y_rd: float
    N_vd: float
    N_rd: float


def clarke_1983(L: float, B: float, T: float, Cb: float) -> Clarke:
    """Added masses in sway and yaw (prime-I).

    Source: Clarke, Gedling & Hine (1983), regression equations; N'_rd with 0.33 B/L as in the original. B/L is held at
    0.2, that of the beamiest merchant ships: up to there N'_rd/Y'_vd is that of an integral over sections (1/12 of a
    prism; KCS and KVLCC2, measured: 0.05), beyond it falls to nothing at 0.3, and a tug would turn without added
    inertia, about an added mass 0.4 L before midship.
    """
    k, b = -math.pi * (T / L) ** 2, min(B / L, 0.2)
    return Clarke(
        Y_vd=k * (1.0 + 0.16 * Cb * B / T - 5.1 * b**2),
        Y_rd=k * (0.67 * b - 0.0033 * (B / T) ** 2),
        N_vd=k * (1.1 * b - 0.041 * B / T),
        N_rd=k * (1.0 / 12.0 + 0.017 * Cb * B / T - 0.33 * b),
    )


class InoueLinear(NamedTuple):
    """MMG-normalised linear derivatives."""

    Y_v: float
    Y_r: float
    N_v: float
    N_r: float


def inoue_linear(L: float, B: float, T: float, Cb: float) -> InoueLinear:
    """Linear derivatives (MMG normalisation), level trim: -(pi k/2 + 1.4 a), pi k/4, -k, -(0.54 k - k^2) with k = 2T/L,
    a = Cb B/L.

    Source: Inoue, Hirano & Kijima (1981). Y_r and N_v are totals: they hold the added-mass Coriolis part.
    """
    k, a = 2.0 * T / L, Cb * B / L
    return InoueLinear(-(0.5 * math.pi * k + 1.4 * a), 0.25 * math.pi * k, -k, -(0.54 * k - k * k))


class InoueNonlinear(NamedTuple):
    """MMG-normalised nonlinear derivatives of the Inoue structure."""

    Y_vv: float
    Y_vr: float
    Y_rr: float
    N_rr: float
    N_vvr: float
    N_vrr: float


def inoue_nonlinear(L: float, B: float, T: float, Cb: float) -> InoueNonlinear:
    """Nonlinear derivatives (MMG normalisation) read off Inoue's charts.

    Source: Inoue, Hirano & Kijima (1981), chart fits of Zhou, Sheng & Feng (1983). The argument Cb B/L is held inside
    the charts' range [0.08, 0.16], outside of which the cubic fits run away.
    """
    a = min(max(Cb * B / L, 0.08), 0.16)
    fine = (1.0 - Cb) * T / B
    return InoueNonlinear(
        Y_vv=0.048265 - 6.293 * fine,
        Y_vr=-0.3791 + 1.28 * fine,
        Y_rr=0.0045 - 0.445 * fine,
        N_rr=-0.0805 + 8.6092 * a**2 - 36.9816 * a**3,
        N_vvr=-6.0856 + 137.4735 * a - 1029.514 * a**2 + 2480.6082 * a**3,
        N_vrr=-0.0635 + 0.04414 * Cb * T / B,
    )


def surge_added_mass(displacement: float, L: float, rho: float) -> float:
    """Added mass in surge [kg], 2.7 rho displacement^(5/3) / L^2 with the displacement in m^3 (Soeding 1982)."""
    return 2.7 * rho * displacement ** (5.0 / 3.0) / L**2


def hull_rudder_interaction(L: float, B: float, Cb: float) -> tuple[float, float]:
    """Interaction (a_H, x'_H): force increase factor 3.6 Cb B/L and its point of application, -0.4 L (Yoshimura &
    Masumoto 2012)."""
    return 3.6 * Cb * B / L, -0.4
