"""Shallow water: multipliers of the hull derivatives and of the added masses against depth over draught."""

from __future__ import annotations

import math
from typing import NamedTuple

from ..ops import Array, cos, sin
from .hull import HullFactors


class DepthFactors(NamedTuple):
    """Multipliers at a given depth; all 1 in deep water."""

    hull: HullFactors
    m_x: Array
    m_y: Array
    J_z: Array


def depth_factors(depth: Array, L: float, B: float, T: float, Cb: float) -> DepthFactors:
    """Multipliers at water depth `depth` [m] (held at or above 1.05 T).

    Derivatives: ratio of the regressions with k_e = k / [T/2h + ((pi T/2h) cot(pi T/2h))^q] to those with k = 2T/L, q = 2.3 (Y_v), 0.7 (Y_r, N_r),
    1.7 (N_v); resistance 1 + 0.388 (T/h)^2. Added masses: (H^a + c)/H^a, H = h/T - 1.

    Source: Tang et al. (2020) and Furukawa et al. (2016) as implemented in nikpau/mmgdynamics. Limit: 1 in deep water. The nonlinear derivatives are left alone:
    published factors disagree with each other by more than they differ from 1 above h/T = 1.5.
    """
    h = depth * (depth > 1.05 * T) + 1.05 * T * (depth <= 1.05 * T)
    ratio = T / h
    angle = 0.5 * math.pi * ratio
    cot = cos(angle) / sin(angle)
    k = 2.0 * T / L
    base = 1.4 * Cb * B / L

    def k_e(q: float) -> Array:
        return k / (0.5 * ratio + (angle * cot) ** q)

    H = h / T - 1.0
    bt, lt = B / T, L / T
    return DepthFactors(
        hull=HullFactors(
            Y_v=(0.5 * math.pi * k_e(2.3) + base) / (0.5 * math.pi * k + base),
            Y_r=k_e(0.7) / k,
            N_v=k_e(1.7) / k,
            N_r=(0.54 * k_e(0.7) - k_e(0.7) ** 2) / (0.54 * k - k**2),
            resistance=1.0 + 0.388 * ratio**2,
        ),
        m_x=1.0 + max(3.77 + 1.14 * bt - 0.233 * lt - 3.43 * Cb, 0.0) / H**1.3,
        m_y=1.0 + (0.413 + 0.0320 * bt + 0.129 * bt**2) / H**0.82,
        J_z=1.0 + (0.413 + 0.0192 * bt + 0.00554 * bt**2) / H**0.82,
    )
