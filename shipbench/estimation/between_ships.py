"""Structural differences between ordinary ships, beside hull and fitted parameters. They are nuisance parameters of
every fit, never a cause."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..effects.base import Effect, Parameter
from ..effects.cross_flow_drag import EFFECT as CROSS_FLOW
from ..effects.going_astern import EFFECT as GOING_ASTERN
from ..effects.propeller_walk_astern import EFFECT as ASTERN
from ..effects.race_gain import EFFECT as RACE
from ..effects.thruster_gain import EFFECT as THRUSTERS
from ..effects.thruster_speed_loss import EFFECT as LOSS
from ..effects.wake_variation import EFFECT as WAKE
from ..effects.wind_coefficients import EFFECT as WIND
from ..ops import Array, absolute, arctan2, clip, exp, maximum, minimum, smoothstep, sqrt, tanh
from ..physics.hull import tilted_cross_flow
from ..physics.modifiers import Flow, Modifiers
from ..physics.thruster import fading
from ..ship import Particulars
from . import priors


class Structure(Effect):
    """Differences between ordinary ships beyond hull derivatives and rudder lift.

    Values are differences from the prior means of `priors.STRUCTURE`. Without them
    every ship's own propeller race or thruster tunnel would be reported as missing physics.

    Source: docs/calibration.md#ordinary-differences-between-ships, with meaning and units.
    """

    family = "hull"
    summary = "ordinary differences between ships"
    source = "docs/calibration.md#ordinary-differences-between-ships"
    parameters = tuple(Parameter(p.name, "1", p.spread, p.low, p.high) for p in priors.STRUCTURE)
    parts = (RACE, WAKE, LOSS, THRUSTERS, CROSS_FLOW, ASTERN)

    def spreads(self, ship: Particulars, measured_wind: bool) -> np.ndarray:
        """Prior standard deviations of the values. The side force of an unmeasured wind is confounded with the wind
        itself."""
        thrust = np.hypot(0.8 * ship.lacks("propeller"), 0.2 * ship.lacks("propeller.kt"))
        own = {"wind_Y": float(measured_wind), "log_thrust": float(thrust)}
        return np.array([p.typical * own.get(p.name, 1.0) for p in self.parameters])

    def wider(self, ship: Particulars) -> dict[str, float]:
        """Factors of the standard deviations of parameters whose prior is narrower in the fit than between ships.

        A full hull makes waves at a lower Froude number: C_b = 1.12 - 1.68 Fn.

        Source: Alexander's formula in Watson, Practical Ship Design, 1998, eq. 3.11.
        """
        waves = (0.25 / max((1.12 - ship.Cb) / 1.68, 0.1)) ** 4
        return {"windmilling": 3.0, "thrust_backing": 2.5, "wave_resistance": max(waves, 1.0)}

    def centres(self) -> np.ndarray:
        """Prior means of the values, as differences from eq. (2)."""
        return np.array([p.centre for p in priors.STRUCTURE])

    def plain(self) -> np.ndarray:
        """Values, in units of their standard deviations, at which the structure adds no force to eq. (2)."""
        return np.array([-c / p.typical for c, p in zip(self.centres(), self.parameters, strict=True)])

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        q = [p.centre + value for p, value in zip(priors.STRUCTURE, q, strict=True)]
        for effect, value in zip(self.parts, q[:6], strict=True):
            effect.force(e, s, (value, *(0.0,) * (len(effect.parameters) - 1)), ship)
        e.straightening, e.straightening_asymmetry, e.straightening_r = 1.0 + q[6], q[7], 1.0 + q[17]
        e.coupling = q[16] * ship.mass * ship.L
        e.m_x = 1.0 + q[24]
        WIND.force(e, s, (*q[20:23], q[23] * ship.L), ship)
        ahead = smoothstep(
            s.u - e.u_c, -0.02 * (9.81 * ship.L) ** 0.5, 0.0
        )  # astern the rudder leads: a reversed propeller stops no flow there
        GOING_ASTERN.force(e, s, (q[25], q[26], 0.0, ahead * q[19]), ship)
        e.reversal = q[27]
        e.thrust = e.thrust * exp(q[28]) * (1.0 + q[18] * smoothstep(-s.n, 0.0, 1.0))
        self._off_design(e, s, q[29:34], ahead, ship)
        ASTERN.force(e, s, (0.0, q[36]), ship)
        e.late_stall = q[39]
        lost = fading(s.u - e.u_c, ship.L)
        e.bow, e.stern = e.bow * (1.0 + q[38]) * (1.0 - q[34] * lost), e.stern * (1.0 - q[38]) * (1.0 - q[35] * lost)
        unit = 0.5 * ship.rho * ship.L * ship.T
        u, v, r = s.u - e.u_c, s.v - e.v_c, s.r * ship.L
        drift = clip(v / sqrt(u * u + v * v + 1e-3 * ship.L), -0.5, 0.5)
        waves = 0.015 * q[40] * (u * u / (9.81 * ship.L * 0.25**2)) ** 2 * u * absolute(u)
        X, Y = q[8] * v * v + q[9] * r * r - waves, absolute(r) * (q[11] * v + q[12] * r)
        e.push(unit * X, unit * Y, unit * ship.L * r * (q[13] * absolute(r) + drift * (q[14] * v + q[15] * r)))
        I_Y, I_N = tilted_cross_flow(v, s.r, ship.L)
        e.push(0.0, -unit * q[41] * I_Y, -unit * ship.L * q[41] * I_N)
        beta_P = arctan2(-(v + ship.x_P * s.r), maximum(u, 0.0) + 0.1)
        in_turns = q[10] * (1.0 - exp(-2.0 * absolute(beta_P))) * tanh(beta_P / 0.05) + q[37] * (
            1.0 - exp(-4.0 * beta_P * beta_P)
        )
        e.wake = e.wake - (1.0 - ship.w_P0) * in_turns

    def _off_design(self, e: Modifiers, s: Flow, q: Sequence[Array], headway: Array, ship: Particulars) -> None:
        """Add the quadrants that K_T does not cover: a propeller that does not drive or is turned against the flow."""
        n, D, u = s.n / 60.0, ship.D_P, s.u - e.u_c
        ahead, V_A = maximum(n, 0.0), u - ship.w_P0 * maximum(u, 0.0)
        share = V_A * V_A / (V_A * V_A + (0.7 * math.pi * n * D) ** 2 + 1e-4)
        stands = share * share * smoothstep(share, 0.15, 0.3)  # nothing up to J = 0.9, where it drives
        drag = q[0] * maximum(V_A, 0.0) ** 2 * stands
        turned = q[2] * (ahead - n) * V_A + q[3] * ahead * minimum(V_A, 0.0)
        e.off_design = ship.rho * D**2 * (ship.kt[1] * D * turned - drag)
        e.wake = e.wake + q[1] * (1.0 - ship.w_P0) * stands
        e.backing = e.backing + headway * q[4] * (ahead - n) * D / sqrt(V_A * V_A + 4e-4 * 9.81 * ship.L)


STRUCTURE = Structure()
