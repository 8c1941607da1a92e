"""Shallow water: multipliers of the hull derivatives and of the added masses against depth over draught."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..ops import Array, cos, maximum, sin
from .hull import HullFactors


class DepthFactors(NamedTuple):
    """Multipliers at a given depth; all 1 in deep water."""

    hull: HullFactors
    m_y: Array
    J_z: Array


def depth_factors(depth: Array, L: float, B: float, T: float, Cb: float) -> DepthFactors:
    """Multipliers at water depth `depth` [m] (held at or above 1.15 T).

    Y_v: -F + (1 - F)^(-0.4 Cb B/T), N_r: -F + (1 - F)^(14.28 T/L - 1.5), F = T/h (Kijima). Y_r and N_v: ratio of the
    regressions with k_e = k / [T/2h + ((pi T/2h) cot(pi T/2h))^q] to those with k = 2T/L, q = 0.7 and 1.7 (Tang).
    Resistance 1 + 0.388 F^2 (Furukawa). Nonlinear derivatives
    K0 + K1 b + K2 b^2; added masses K0 + a K1 b + c K2 b^2 with b = Cb B (1 + B/L)^2 / T, (a, c) = (2/3, 8/15) for m_y
    and (2/5, 24/105) for J_z (Ankudinov).

    Source: Taimuri et al. (2020), Ocean Eng. 218; Tang et al. (2020) and Furukawa et al. (2016) as in
    github.com/nikpau/mmgdynamics. Limit: 1 in deep water.
    """
    h = maximum(depth, 1.15 * T)
    ratio = T / h
    angle = 0.5 * math.pi * ratio
    cot = cos(angle) / sin(angle)
    k = 2.0 * T / L

    def k_e(q: float) -> Array:
        return k / (0.5 * ratio + (angle * cot) ** q)

    H = h / T - 1.0
    K0 = 1.0 + 0.0775 / H**2 - 0.011 / H**3 + 0.000068 / H**5
    K1 = -0.0643 / H + 0.0724 / H**2 - 0.0113 / H**3 + 0.0000767 / H**5
    K2 = 0.0342 / H if B / T <= 4.0 else 0.137 * T / B / H
    b = Cb * B * (1.0 + B / L) ** 2 / T
    nonlinear = K0 + K1 * b + K2 * b**2
    return DepthFactors(
        hull=HullFactors(
            Y_v=(1.0 - ratio) ** (-0.4 * Cb * B / T) - ratio,
            Y_r=k_e(0.7) / k,
            N_v=k_e(1.7) / k,
            N_r=(1.0 - ratio) ** (14.28 * T / L - 1.5) - ratio,
            X_nonlinear=nonlinear,
            Y_nonlinear=nonlinear,
            N_nonlinear=nonlinear,
            resistance=1.0 + 0.388 * ratio**2,
        ),
        m_y=K0 + 2.0 / 3.0 * K1 * b + 8.0 / 15.0 * K2 * b**2,
        J_z=K0 + 2.0 / 5.0 * K1 * b + 24.0 / 105.0 * K2 * b**2,
    )
