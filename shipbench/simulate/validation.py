"""Comparison of the simulator with published figures, one row a figure. Tolerances are those of the project; rows
without one are printed for comparison."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..physics.mmg import load_mmg_ship
from ..physics.propeller import thrust_coefficient_four_quadrant
from .manoeuvres import self_propulsion_rpm, straight_state, turning_circle, zigzag_overshoots
from .simulator import Simulator

KVLCC2_SPEED, KVLCC2_RPM = 1.179, 624.0
KCS_SPEED, KCS_RPM = 12.3467, 115.5

# Overshoots (first, second) [deg] of another implementation of the same published coefficients.
_ZIGZAG = {
    "kvlcc2_l7": {10: (5.6, 16.6), -10: (8.2, 10.6), 20: (12.3, 18.5), -20: (16.2, 13.7)},
    "kcs": {10: (6.2, 12.2), -10: (7.8, 9.4), 20: (13.8, 16.2), -20: (16.1, 14.0)},
}

# Wageningen polynomial (Oosterveld & van Oossanen 1975), Z = 4, A_E/A_0 = 0.70, P/D = 0.8.
_KT_POLYNOMIAL = {0.0: 0.354, 0.2: 0.291, 0.4: 0.212, 0.6: 0.123, 0.8: 0.028}


def _row(
    ship: str,
    quantity: str,
    computed: float,
    published: float,
    unit: str,
    tolerance: float | None,
    relative: bool,
    source: str,
) -> dict[str, Any]:
    error = abs(computed - published) / (abs(published) if relative else 1.0)
    return {
        "ship": ship, "quantity": quantity, "computed": computed, "published": published, "unit": unit,
        "tolerance": None if tolerance is None else (f"{100 * tolerance:g} %" if relative else f"{tolerance:g}"),
        "passed": None if tolerance is None else bool(error <= tolerance), "source": source,
    }  # fmt: skip


def integrator_order(ship: str = "container130") -> float:
    """Measured order of the simulator's integration: slope of log error on log step in a turn with the actuators at
    rest.

    Steps 4, 2 and 1 s against 0.0625 s over 64 s; the ship is already turning, so no limit is met inside a step.
    """
    mmg = load_mmg_ship(ship)
    s0 = straight_state(4.0, 93.0)
    s0[0, 4], s0[0, 5], s0[0, 7] = -0.3, 0.006, np.deg2rad(15.0)
    command = np.array([[93.0, np.deg2rad(15.0), 0.0, 0.0]])

    def end(step: float) -> np.ndarray:
        U = np.repeat(command[None], int(64 / step), axis=1)
        return Simulator(mmg, max_step=step).rollout(s0, U, step)[0, -1, :6]

    truth = end(0.0625)
    scale = np.array([100.0, 100.0, 1.0, 4.0, 0.3, 0.006])
    steps = np.array([4.0, 2.0, 1.0])
    errors = [float(np.linalg.norm((end(h) - truth) / scale)) for h in steps]
    return float(np.polyfit(np.log(steps), np.log(errors), 1)[0])


def table() -> list[dict[str, Any]]:
    """Rows with ship, quantity, computed, published, unit, tolerance, passed (None where only printed beside),
    source."""
    rows = []
    model, kcs = Simulator(load_mmg_ship("kvlcc2_l7"), 0.1), Simulator(load_mmg_ship("kcs"), 0.5)
    paper = "Yasukawa & Yoshimura (2015), Table 4"
    turn = turning_circle(model, KVLCC2_SPEED, KVLCC2_RPM, 35.0, 0.1, 60.0)
    rows += [
        _row("kvlcc2_l7", "advance, +35 deg", turn.advance, 3.31, "L", 0.03, True, paper),
        _row("kvlcc2_l7", "tactical diameter, +35 deg", turn.tactical_diameter, 3.36, "L", 0.03, True, paper),
    ]
    turn = turning_circle(model, KVLCC2_SPEED, KVLCC2_RPM, -35.0, 0.1, 60.0)
    rows += [
        _row("kvlcc2_l7", "advance, -35 deg", turn.advance, 3.36, "L", None, True, "reference's own run"),
        _row(
            "kvlcc2_l7",
            "tactical diameter, -35 deg",
            turn.tactical_diameter,
            3.34,
            "L",
            None,
            True,
            "reference's own run",
        ),
    ]
    rows.append(
        _row(
            "kcs",
            "self-propulsion at 24 kn",
            self_propulsion_rpm(kcs, KCS_SPEED),
            KCS_RPM,
            "rpm",
            0.005,
            True,
            "SIMMAN study of KVLCC and KCS",
        )
    )
    for sign, advance, diameter in ((1, 3.36, 3.59), (-1, 3.24, 3.36)):
        turn = turning_circle(kcs, KCS_SPEED, KCS_RPM, 35.0 * sign, 0.5, 300.0)
        rows += [
            _row("kcs", f"advance, {35 * sign:+d} deg", turn.advance, advance, "L", None, True, "reference's own run"),
            _row(
                "kcs",
                f"tactical diameter, {35 * sign:+d} deg",
                turn.tactical_diameter,
                diameter,
                "L",
                None,
                True,
                "reference's own run",
            ),
        ]
    for name, sim, speed, rpm, dt, duration in (
        ("kvlcc2_l7", model, KVLCC2_SPEED, KVLCC2_RPM, 0.1, 200.0), ("kcs", kcs, KCS_SPEED, KCS_RPM, 0.5, 900.0)
    ):  # fmt: skip
        angles = _ZIGZAG[name]
        for (angle, published), computed in zip(
            angles.items(), zigzag_overshoots(sim, speed, rpm, [*angles], dt, duration), strict=True
        ):
            for label, ours, theirs in zip(("1st", "2nd"), computed.tolist(), published, strict=True):
                rows.append(
                    _row(
                        name,
                        f"zig-zag {angle:+d}/{angle:+d}, {label} overshoot",
                        ours,
                        theirs,
                        "deg",
                        None,
                        True,
                        "reference's own run",
                    )
                )
    for J, value in _KT_POLYNOMIAL.items():
        computed = float(thrust_coefficient_four_quadrant(np.float64(J)))
        rows.append(
            _row(
                "B4-70, P/D 0.8",
                f"K_T at J = {J:g}, 4 quadrants",
                computed,
                value,
                "1",
                0.01,
                False,
                "Wageningen polynomial",
            )
        )
    rows.append(
        _row(
            "container130", "order of the integrator", integrator_order(), 4.0, "1", 0.2, False, "classical Runge-Kutta"
        )
    )
    return rows
