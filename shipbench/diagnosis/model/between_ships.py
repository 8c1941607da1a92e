"""What differs between one ordinary ship and another, beside hull derivatives and the fitted parameters: part of every fit, never a cause."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ...effects.base import Effect, Parameter
from ...effects.cross_flow_drag import EFFECT as CROSS_FLOW
from ...effects.going_astern import EFFECT as GOING_ASTERN
from ...effects.propeller_walk_astern import EFFECT as ASTERN
from ...effects.race_gain import EFFECT as RACE
from ...effects.thruster_gain import EFFECT as THRUSTERS
from ...effects.thruster_speed_loss import EFFECT as LOSS
from ...effects.wake_variation import EFFECT as WAKE
from ...effects.wind_coefficients import EFFECT as WIND
from ...ops import Array, absolute, arctan2, clip, exp, maximum, minimum, smoothstep, sqrt, tanh
from ...physics.hull import tilted_cross_flow
from ...physics.modifiers import Flow, Modifiers
from ...physics.thruster import fading
from ...ship import Particulars


class Structure(Effect):
    """What differs between one ordinary ship and another beyond hull and rudder lift: race at the rudder, wake in turns, thrusters at speed.

    Without it every ship's own race or thruster tunnel would be reported as missing physics. Centres and spreads: kappa 0.3 to 0.8,
    C_2 - 1 of the wake 0 to 0.6, by side (Yasukawa & Yoshimura 2015), loss of the thrusters' moment up to 50 % (docs/theory.md#thrusters), cross-flow
    drag of a hull whose regressions lack it, side force of a propeller going astern, gamma_R 0.4 to 0.64, by side, l'_R -0.7 to -1
    (Yasukawa & Yoshimura 2015, table 3), X'_vv and X'_rr that eq. (2) lacks (same table: -0.040, 0.011); added mass between sway and yaw, which
    regressions hardly know and the MMG form leaves out (of m L); flow at the rudder that a reversed propeller stops, from none to all (Miyauchi
    et al. 2022); thrust astern, of which eq. (2) knows one level (0.65 of ahead at rest; four-quadrant curves 0.5 to 0.8); wind on
    superstructures of all kinds (Blendermann 1994); added mass in surge, for which charts (Zhou et al. 1983) and ships of the
    literature have 0.4 to 0.75 of Soeding's value (0.036 and 0.071 of the mass); N_v and Y_r of a ship that goes astern,
    which eq. (2) takes for those ahead (from there, as in cubic polynomials, to the change of sign of theory: Yoshimura, Nakao & Ishibashi 2009),
    and her rudder, which then works from its trailing edge; thrust of a propeller that the ship file leaves open (log of the factor): K_T goes with
    the pitch, 0.6 to 1.1 of the diameter, and thrust with the fourth power of the diameter, for which 0.6 T is 20 % too much or too little (KVLCC2,
    KCS). Quadrants that K_T does not know: drag of a propeller that stands still, beside K_T's own (V_A^2, in rho D^2: 0.14, B4-70 has 0.31); flow
    at the rudder behind it, slower or faster by 20 %, and what a propeller that turns astern sucks from there (of n D); the terms with n V_A, in
    k_1, of a propeller that turns astern, and of one that turns ahead on a ship which goes astern (B4-70 against eq. 2: 0.8 to -0.2, and -0.3 to
    -1.5; Roddy, Hess & Faller 2006). The first and the last but one are narrow: in a stop they pass for mass or thrust, and where a ship needs more
    she gets a wider spread (`ordinary.widened`). Last, other forms of what is above: force that thrusters lose for good as the ship gathers way, bow
    and stern, side force of a propeller going astern as a share of its thrust at rest, of a few per cent, and a wake that falls with
    the square of the angle at the propeller, as w_P0 exp(-4 beta_P^2) (0.2 to 0.5 of 1 - w_P0 for w_P0 of 0.18 to 0.33), or of S175
    without end (Son & Nomoto 1982): thrust that she loses in long hard turns passed for mass. Of two tunnels with the same record each gives its own
    force, by where it stands in the hull (0.8 to 1.0 of its thrust): what one has more than the other passed for its lever. late_stall: share of the
    lift that the rudder loses from 26 to 37 deg, since every rudder stalls at 30 to 40 deg (Brix 1993), sharper than a cubic lift does.
    wave_resistance: of X'_uu 0.015 at a Froude number of 0.25, growing with its fourth power (p1 and p2 end at the square of the speed; without it
    a fast ship needed thrust, mass and a propeller of her own). drag_forward: cross-flow drag of sections, 2 q xi beside C_D, larger forward or aft
    (Hooft, Ocean Eng. 21 (1994) 329; without it a ship pushed sideways at rest had another lever of her bow thruster).
    """

    family = "hull"
    summary = "ordinary differences between ships"
    source = "see above"
    parameters = (
        Parameter("race", "1", 0.2, -0.9, 1.0),
        Parameter("wake_in_turns", "1", 0.3, -1.0, 2.0),
        Parameter("thruster_loss", "1", 0.25, -0.5, 1.2),
        Parameter("thruster_force", "1", 0.1, -0.5, 0.5),
        Parameter("cross_flow", "1", 0.6, -1.0, 2.0),
        Parameter("walk_astern", "1", 0.4, -2.0, 2.0),
        Parameter("straightening", "1", 0.3, -0.9, 1.0),
        Parameter("straightening_asymmetry", "1", 0.25, -0.9, 0.9),
        Parameter("X_vv", "1", 0.05, -0.5, 0.5),
        Parameter("X_rr", "1", 0.03, -0.5, 0.5),
        Parameter("wake_asymmetry", "1", 0.25, -1.0, 1.0),
        Parameter("Y_vr", "1", 0.15, -2.0, 2.0),
        Parameter("Y_rr", "1", 0.03, -0.5, 0.5),
        Parameter("N_rr", "1", 0.015, -0.3, 0.3),
        Parameter("N_vvr", "1", 0.15, -2.0, 2.0),
        Parameter("N_vrr", "1", 0.06, -1.0, 1.0),
        Parameter("coupling", "1", 0.05, -0.5, 0.5),
        Parameter("straightening_r", "1", 0.25, -0.9, 1.0),
        Parameter("thrust_astern", "1", 0.15, -0.8, 1.0),
        Parameter("backing", "1", 0.4, -1.4, 0.4),
        Parameter("wind_X", "1", 0.3, -0.9, 3.0),
        Parameter("wind_Y", "1", 0.15, -0.9, 2.0),
        Parameter("wind_N", "1", 0.4, -2.0, 3.0),
        Parameter("wind_lever", "1", 0.04, -0.3, 0.3),
        Parameter("m_x", "1", 0.25, -0.5, 2.0),
        Parameter("N_v_astern", "1", 0.4, -1.0, 2.0),
        Parameter("Y_r_astern", "1", 0.4, -1.0, 2.0),
        Parameter("reversal", "1", 0.3, -0.6, 0.6),
        Parameter("log_thrust", "1", 1.0, -3.0, 3.0),
        Parameter("windmilling", "1", 0.05, -0.3, 1.0),
        Parameter("stopped", "1", 0.2, -0.8, 0.8),
        Parameter("thrust_backing", "1", 0.2, -1.5, 3.0),
        Parameter("braking", "1", 0.4, -3.0, 1.5),
        Parameter("suction", "1", 0.25, -0.8, 0.8),
        Parameter("bow_fading", "1", 0.25, -0.5, 1.2),
        Parameter("stern_fading", "1", 0.25, -0.5, 1.2),
        Parameter("walk_share", "1", 0.03, -0.5, 0.5),
        Parameter("wake_square", "1", 0.3, -1.0, 2.0),
        Parameter("bow_over_stern", "1", 0.1, -0.5, 0.5),
        Parameter("late_stall", "1", 0.3, -0.5, 0.95),
        Parameter("wave_resistance", "1", 0.3, -0.5, 3.0),
        Parameter("drag_forward", "1", 0.2, -2.0, 2.0),
    )
    backing, m_x, astern, braking = 0.5, -0.4, 0.7, -0.7
    parts = ((RACE, -0.45), (WAKE, 0.2), (LOSS, 0.25), (THRUSTERS, 0.0), (CROSS_FLOW, 0.2), (ASTERN, 0.3))

    def spreads(self, ship: Particulars, measured_wind: bool) -> np.ndarray:
        """Standard deviations of the values. The side force of a wind that is not measured cannot be told from the wind itself."""
        thrust = np.hypot(0.8 * ship.lacks("propeller"), 0.2 * ship.lacks("propeller.kt"))
        own = {"wind_Y": float(measured_wind), "log_thrust": float(thrust)}
        return np.array([p.typical * own.get(p.name, 1.0) for p in self.parameters])

    def wider(self, ship: Particulars) -> dict[str, float]:
        """How many times more ships differ in them than their spreads say, which are narrow for the sake of the fit: 0.31 and 0.8 of B4-70, above;
        and waves, which a full hull makes at a lower Froude number, as C_b = 1.12 - 1.68 Fn goes (Alexander, for slow ships; Watson, Practical Ship
        Design, 1998, eq. 3.11). (A barge with C_b 0.88 lay 9 spreads off at Fn 0.18.)"""
        waves = (0.25 / max((1.12 - ship.Cb) / 1.68, 0.1)) ** 4
        return {"windmilling": 3.0, "thrust_backing": 2.5, "wave_resistance": max(waves, 1.0)}

    def plain(self) -> np.ndarray:
        """Values, in units of their spreads, at which it adds nothing to eq. (2)."""
        centres = np.zeros(len(self.parameters))
        centres[: len(self.parts)] = [c for _, c in self.parts]
        names = [p.name for p in self.parameters]
        for name in ("N_v_astern", "Y_r_astern", "reversal"):
            centres[names.index(name)] = self.astern
        for name in ("backing", "m_x", "braking"):
            centres[names.index(name)] = getattr(self, name)
        return np.array([-c / p.typical for c, p in zip(centres, self.parameters, strict=True)])

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        for (effect, centre), value in zip(self.parts, q[:6], strict=True):
            effect.force(e, s, (centre + value, *(0.0,) * (len(effect.parameters) - 1)), ship)
        e.straightening, e.straightening_asymmetry, e.straightening_r = 1.0 + q[6], q[7], 1.0 + q[17]
        e.coupling = q[16] * ship.mass * ship.L
        e.m_x = 1.0 + self.m_x + q[24]
        WIND.force(e, s, (*q[20:23], q[23] * ship.L), ship)
        ahead = smoothstep(s.u - e.u_c, -0.02 * (9.81 * ship.L) ** 0.5, 0.0)  # astern the rudder leads: a reversed propeller stops no flow there
        GOING_ASTERN.force(e, s, (self.astern + q[25], self.astern + q[26], 0.0, ahead * (self.backing + q[19])), ship)
        e.reversal = self.astern + q[27]
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
        in_turns = q[10] * (1.0 - exp(-2.0 * absolute(beta_P))) * tanh(beta_P / 0.05) + q[37] * (1.0 - exp(-4.0 * beta_P * beta_P))
        e.wake = e.wake - (1.0 - ship.w_P0) * in_turns

    def _off_design(self, e: Modifiers, s: Flow, q: Sequence[Array], headway: Array, ship: Particulars) -> None:
        """Quadrants that K_T does not know: a propeller that does not drive or is turned against the flow."""
        n, D, u = s.n / 60.0, ship.D_P, s.u - e.u_c
        ahead, V_A = maximum(n, 0.0), u - ship.w_P0 * maximum(u, 0.0)
        share = V_A * V_A / (V_A * V_A + (0.7 * math.pi * n * D) ** 2 + 1e-4)
        stands = share * share * smoothstep(share, 0.15, 0.3)  # nothing up to J = 0.9, where it drives
        drag = q[0] * maximum(V_A, 0.0) ** 2 * stands
        turned = q[2] * (ahead - n) * V_A + (self.braking + q[3]) * ahead * minimum(V_A, 0.0)
        e.off_design = ship.rho * D**2 * (ship.kt[1] * D * turned - drag)
        e.wake = e.wake + q[1] * (1.0 - ship.w_P0) * stands
        e.backing = e.backing + headway * q[4] * (ahead - n) * D / sqrt(V_A * V_A + 4e-4 * 9.81 * ship.L)


STRUCTURE = Structure()
