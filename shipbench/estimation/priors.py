"""Priors of everything that is fitted of a ship: one table for the calibrated model and for the diagnosis.

Each coefficient has a normal prior with Huber's tail (`huber_knee`): centre and spread are the mean and the standard
deviation between ordinary ships. Evidence: docs/calibration.md#ordinary-differences-between-ships.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..effects.hull_derivatives import EFFECT as HULL
from .thresholds import THRESHOLDS


@dataclass(frozen=True)
class Prior:
    """One coefficient.

    Args:
        name: as in docs/calibration.md.
        group: part of the ship: resistance, hull, rudder, propeller, thrusters or wind.
        title: what it is, for a reader.
        unit: of centre, spread and bounds.
        centre, spread: mean and standard deviation between ships.
        low, high: bounds of the difference from the centre.
    """

    name: str
    group: str
    title: str
    unit: str
    centre: float
    spread: float
    low: float = -math.inf
    high: float = math.inf


EQ2 = (
    Prior("p1", "resistance", "linear resistance", "0.01 · ½ rho L T · 0.1√(gL)", 0.2, 3),
    Prior("p2", "resistance", "quadratic resistance", "0.015 · ½ rho L T", 1, 1.5),
    Prior("p5", "rudder", "rudder lift slope", "2.5 per rad", 1, 0.5),
    Prior("p7", "rudder", "cubic rudder lift", "2 per rad³", -0.8, 0.8),
    Prior("p8", "rudder", "rudder drag at zero angle", "0.03", 0.3, 1),
    Prior("p10", "rudder", "quadratic rudder drag", "1.5 per rad²", 1, 1),
)
"""Free parameters of eq. (2); their units are those of `parameter_scale`."""
COEFFICIENTS = tuple(
    Prior(p.name, "hull", p.title, "1", 0.0, THRESHOLDS.value("ordinary_spread"), p.low, p.high)
    for p in HULL.parameters
)
"""Hull derivatives and added masses, as relative changes from the regressions."""
STRUCTURE = (
    Prior(
        "race",
        "propeller",
        "excess speed of the propeller race at the rudder",
        "1",
        -0.45,
        0.2,
        -0.9,
        1.0,
    ),
    Prior("wake_in_turns", "propeller", "decrease of the wake in a turn, share of 1 - w_P0", "1", 0.2, 0.3, -1.0, 2.0),
    Prior(
        "thruster_loss",
        "thrusters",
        "loss of thruster force at speed",
        "1",
        0.25,
        0.25,
        -0.5,
        1.2,
    ),
    Prior("thruster_force", "thrusters", "thruster force, relative change", "1", 0, 0.1, -0.5, 0.5),
    Prior("cross_flow", "hull", "cross-flow drag coefficient, difference", "1", 0.2, 0.6, -1.0, 2.0),
    Prior(
        "walk_astern",
        "propeller",
        "propeller walk astern, over that of the Esso Osaka",
        "1",
        0.3,
        0.4,
        -2.0,
        2.0,
    ),
    Prior("straightening", "rudder", "flow straightening at the rudder, relative change", "1", 0, 0.3, -0.9, 1.0),
    Prior(
        "straightening_asymmetry",
        "rudder",
        "flow straightening, port against starboard",
        "1",
        0,
        0.25,
        -0.9,
        0.9,
    ),
    Prior("X_vv", "hull", "X'_vv, which eq. (2) lacks", "1", 0, 0.05, -0.5, 0.5),
    Prior("X_rr", "hull", "X'_rr, which eq. (2) lacks", "1", 0, 0.03, -0.5, 0.5),
    Prior(
        "wake_asymmetry",
        "propeller",
        "decrease of the wake, port against starboard",
        "1",
        0,
        0.25,
        -1.0,
        1.0,
    ),
    Prior("Y_vr", "hull", "side force with v and r", "1", 0, 0.15, -2.0, 2.0),
    Prior("Y_rr", "hull", "side force with r r", "1", 0, 0.03, -0.5, 0.5),
    Prior("N_rr", "hull", "yaw moment with r r", "1", 0, 0.015, -0.3, 0.3),
    Prior("N_vvr", "hull", "yaw moment with v v r", "1", 0, 0.15, -2.0, 2.0),
    Prior("N_vrr", "hull", "yaw moment with v r r", "1", 0, 0.06, -1.0, 1.0),
    Prior("coupling", "hull", "added mass between sway and yaw", "m L", 0, 0.05, -0.5, 0.5),
    Prior("straightening_r", "rudder", "flow straightening of yaw alone, relative change", "1", 0, 0.25, -0.9, 1.0),
    Prior("thrust_astern", "propeller", "thrust astern, relative change", "1", 0, 0.15, -0.8, 1.0),
    Prior("backing", "rudder", "flow at the rudder that a reversed propeller stops", "1", 0.5, 0.4, -1.4, 0.4),
    Prior("wind_X", "wind", "wind surge force, relative change", "1", 0, 0.3, -0.9, 3.0),
    Prior("wind_Y", "wind", "wind side force, relative change", "1", 0, 0.15, -0.9, 2.0),
    Prior("wind_N", "wind", "wind yaw moment, relative change", "1", 0, 0.4, -2.0, 3.0),
    Prior("wind_lever", "wind", "lever of the wind side force", "L", 0, 0.04, -0.3, 0.3),
    Prior("m_x", "hull", "added mass in surge, relative change", "1", -0.4, 0.25, -0.5, 2.0),
    Prior("N_v_astern", "hull", "change of N_v going astern; 1 reverses its sign", "1", 0.7, 0.4, -1.0, 2.0),
    Prior("Y_r_astern", "hull", "change of Y_r going astern; 1 reverses its sign", "1", 0.7, 0.4, -1.0, 2.0),
    Prior("reversal", "rudder", "rudder in flow from astern; 1 reverses its angle", "1", 0.7, 0.3, -0.6, 0.6),
    Prior("log_thrust", "propeller", "logarithm of thrust", "1", 0, 1, -3.0, 3.0),
    Prior(
        "windmilling",
        "propeller",
        "drag of a standing propeller, with V_A²",
        "rho D²",
        0,
        0.05,
        -0.3,
        1.0,
    ),
    Prior("stopped", "propeller", "increase of the wake behind a standing propeller", "1 - w_P0", 0, 0.2, -0.8, 0.8),
    Prior("thrust_backing", "propeller", "n V_A term of a propeller that turns astern", "k_1", 0, 0.2, -1.5, 3.0),
    Prior(
        "braking",
        "propeller",
        "n V_A term of a propeller that turns ahead, going astern",
        "k_1",
        -0.7,
        0.4,
        -3.0,
        1.5,
    ),
    Prior("suction", "rudder", "flow at the rudder to a propeller that turns astern", "n D", 0, 0.25, -0.8, 0.8),
    Prior("bow_fading", "thrusters", "lasting loss of the bow thruster with speed", "1", 0, 0.25, -0.5, 1.2),
    Prior("stern_fading", "thrusters", "lasting loss of the stern thruster with speed", "1", 0, 0.25, -0.5, 1.2),
    Prior("walk_share", "propeller", "propeller walk astern", "thrust at rest", 0, 0.03, -0.5, 0.5),
    Prior(
        "wake_square",
        "propeller",
        "decrease of the wake with the squared drift angle",
        "1 - w_P0",
        0,
        0.3,
        -1.0,
        2.0,
    ),
    Prior("bow_over_stern", "thrusters", "half the difference of two tunnels", "1", 0, 0.1, -0.5, 0.5),
    Prior("late_stall", "rudder", "lift that the rudder loses from 26° to 37°", "1", 0, 0.3, -0.5, 0.95),
    Prior(
        "wave_resistance",
        "hull",
        "wave resistance at a Froude number of 0.25",
        "0.015 of X'_uu",
        0,
        0.3,
        -0.5,
        3.0,
    ),
    Prior("drag_forward", "hull", "cross-flow drag coefficient that grows forward", "1", 0, 0.2, -2.0, 2.0),
)
"""Differences beyond hull derivatives and rudder lift."""
PRIORS = (*EQ2, *COEFFICIENTS, *STRUCTURE)
