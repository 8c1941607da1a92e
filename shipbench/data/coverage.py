"""Coverage of a data set, and resulting identifiability gaps: times spent in regions of state and command, in ship
lengths.

Thresholds are angles, shares or multiples of sqrt(g L) and sqrt(L/g), so that a model and its ship are judged alike
(Froude's law).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..records import Dataset
from ..ship import complete
from ..signals import COMMANDS, DELTA, ENVIRONMENT, F_B, F_S, PSI, N, R, U, V

_G = 9.81
NEEDED = 3.0
"""Number of unit times from which a region counts as covered: enough for the ship's response, and more than once."""
STEERAGE = 0.01
"""Froude number below which the ship counts as lying still, and its drift angle is undefined (0.36 m/s at 130 m)."""


def unit_time(L: float) -> float:
    """Time 10 sqrt(L/g) [s] to sail one's own length at a Froude number of 0.1 (36 s at 130 m)."""
    return 10.0 * float(np.sqrt(L / _G))


@dataclass(frozen=True)
class Samples:
    """Samples of all runs, each standing for `dt` seconds."""

    dataset: Dataset

    @cached_property
    def states(self) -> np.ndarray:
        """States (samples, 10)."""
        return np.concatenate([r.states for r in self.dataset.runs])

    @cached_property
    def inputs(self) -> np.ndarray:
        """Inputs (samples, inputs)."""
        return np.concatenate([r.inputs for r in self.dataset.runs])

    @cached_property
    def speed(self) -> np.ndarray:
        """Resultant speed [m/s]."""
        return np.hypot(self.states[:, U], self.states[:, V])

    @cached_property
    def froude(self) -> np.ndarray:
        """Froude number, negative going astern."""
        return np.sign(self.states[:, U]) * self.speed / np.sqrt(_G * self.dataset.ship.L)

    @cached_property
    def drift(self) -> np.ndarray:
        """Drift angle [rad], from the bow (or the stern, going astern) to the velocity, positive to starboard; NaN
        lying still."""
        angle = np.arctan2(self.states[:, V], np.abs(self.states[:, U]))
        return np.where(np.abs(self.froude) > STEERAGE, angle, np.nan)

    def environment(self, name: str) -> np.ndarray | None:
        """Measured channel, or None."""
        return self.inputs[:, self.dataset.inputs.index(name)] if name in self.dataset.inputs else None

    def heading_arc(self) -> float:
        """Least arc [rad] that holds 95 % of the headings."""
        angles = np.sort(self.states[:, PSI] % (2 * np.pi))
        held = int(np.ceil(0.95 * len(angles))) - 1
        ends = np.concatenate([angles, angles + 2 * np.pi])
        return float(np.min(ends[held : held + len(angles)] - angles))


@dataclass(frozen=True)
class Gap:
    """Identifiability gap, the figures behind it, and the manoeuvre that would close it."""

    subject: str
    because: str
    manoeuvre: str


@dataclass(frozen=True)
class _Region:
    """Set of samples: its information, its name, and the figure that it lacks most (beside the time)."""

    subject: str
    name: str
    where: np.ndarray
    figure: str
    manoeuvre: str


def _regions(s: Samples) -> list[_Region]:
    """Regions that a ship's model needs, with the figures that are printed beside the time."""
    S, fn = s.states, s.froude
    n, delta = S[:, N], np.rad2deg(S[:, DELTA])
    full = float(np.percentile(np.abs(n), 95))
    drift = np.rad2deg(np.nan_to_num(s.drift))
    turning = np.abs(S[:, R]) * s.dataset.ship.L / np.maximum(s.speed, 1e-9)
    regions = [
        _Region("reversed propeller: stopping, propeller walk astern", "shaft speed below -10 % of the usual maximum",
            n < -0.1 * full,
                f"least {n.min():.3g} rpm", "a crash stop: full astern from cruising speed, until the ship lies still"),
        _Region("forces going astern", f"sternway (Froude number below -{STEERAGE})", fn < -STEERAGE,
            f"least u {S[:, U].min():.3g} m/s",
                "back the ship from rest, with the rudder to either side"),
        _Region("forces near zero speed", f"Froude number below 3 x {STEERAGE}", np.abs(fn) < 3 * STEERAGE,
                f"least Froude number {np.abs(fn).min():.3f}",
                "coast down with the shaft stopped, until the ship "
                "lies still"),
        _Region("stall of the rudder", "rudder beyond 25 deg", np.abs(delta) > 25.0,
            "99 % within "
            f"{np.percentile(np.abs(delta), 99):.1f} deg",
                "turns at 20, 30 and 35 deg of rudder, to either side"),
        _Region("cross-flow drag of the hull", "drift beyond 10 deg", np.abs(drift) > 10.0,
            f"99 % within {np.percentile(np.abs(drift), 99):.1f} deg",
                "hard turns, and thruster pushes sideways at low speed"),
        _Region("turning: yaw damping and its nonlinear terms",
            "turns tighter than 10 ship lengths (r L / speed > "
            "0.1)",
                (turning > 0.1) & (np.abs(fn) > STEERAGE),
                "99 % of r L / speed within "
                f"{np.percentile(turning[np.abs(fn) > STEERAGE], 99) if (np.abs(fn) > STEERAGE).any() else 0.0:.2f}",
                "zig-zags 10/10 and 20/20, and a turning circle"),
    ]  # fmt: skip
    for side, sign in (("port", -1.0), ("starboard", 1.0)):
        regions.append(_Region(f"rudder force to {side}, and with it the ship's asymmetry",
                f"rudder beyond 5 deg to {side}", sign * delta > 5.0,
                               f"most {max(float(np.max(sign * delta)), 0.0):.1f} deg",
                               "repeat the turns with the "
                               f"rudder to {side}"))  # fmt: skip
    ship = complete(s.dataset.ship)
    for name, index in (("bow", F_B), ("stern", F_S)):
        used = np.abs(S[:, index])
        if s.dataset.ship.thrusters is not None or used.any():
            pushes = used > max(0.1 * max(ship.F_max, used.max()), 1e-9)
            regions.append(_Region(f"{name} thruster", f"force beyond 10 % of the {name} thruster's most", pushes,
                                   f"most {used.max():.3g} N",
                                   f"pushes with the {name} thruster at rest and at two "
                                   "speeds"))  # fmt: skip
    return regions


def gaps(dataset: Dataset) -> list[Gap]:
    """Parts that these data cannot identify, for any model: by the times spent in regions, the spread of headings and
    the recorded channels."""
    s, found = Samples(dataset), []
    unit = unit_time(dataset.ship.L)
    for region in _regions(s):
        seconds = float(np.count_nonzero(region.where)) * dataset.dt
        if seconds < NEEDED * unit:
            found.append(Gap(region.subject,
                    f"{region.name}: {seconds:.3g} s, at least {NEEDED * unit:.3g} s are "
                    f"needed; {region.figure}",
                             region.manoeuvre))  # fmt: skip
    arc = np.rad2deg(s.heading_arc())
    if arc < 90.0:
        found.append(Gap("current and wind apart from offsets of rudder, hull and propeller",
                f"95 % of the headings lie within {arc:.0f} deg, "
                         "at least 90 are needed",
                         "the same straight runs on reciprocal courses, or one full turn"))  # fmt: skip
    found += _constant_inputs(s)
    return found + _missing_channels(s)


def _constant_inputs(s: Samples) -> list[Gap]:
    """Gap of a constant shaft speed, and of constant speeds."""
    found, n, fn = [], s.states[:, N], s.froude
    ahead = n > 0.1 * np.percentile(np.abs(n), 95)
    if ahead.any():
        low, high = np.percentile(n[ahead], [5, 95])
        if high < 1.1 * low:
            found.append(Gap("propeller walk apart from a rudder offset; thrust and race against the shaft speed",
                             f"ahead, 90 % of the shaft speeds lie between {low:.4g} and {high:.4g} rpm, a ratio of "
                             f"{high / low:.2f}; 1.1 is needed",
                             "straight runs with the shaft speed up and down by a quarter"))  # fmt: skip
    moving = fn > STEERAGE
    if moving.any():
        low, high = np.percentile(s.speed[moving], [5, 95])
        if high < 1.25 * low:
            found.append(Gap("resistance apart from thrust",
                    f"90 % of the speeds lie between {low:.3g} and "
                    f"{high:.3g} m/s, a ratio of "
                             f"{high / low:.2f}; 1.25 is needed",
                             "coast down with the shaft stopped, and speed up "
                             "from rest"))  # fmt: skip
    return found


def _missing_channels(s: Samples) -> list[Gap]:
    """Gaps that no manoeuvre can close: channels that are not recorded, or never change."""
    found, dataset = [], s.dataset
    used = [name for i, name in enumerate(COMMANDS[:2]) if np.ptp(s.inputs[:, i]) > 0.0]
    repeats = all(
        np.array_equal(r.states[1:, N:F_B], r.inputs[:-1, :2]) or np.array_equal(r.states[:, N:F_B], r.inputs[:, :2])
        for r in dataset.runs
    )
    if dataset.actuators == "commanded" or (used and repeats):
        found.append(Gap("lag, rate limit, delay and dead band of rudder and shaft",
                "n and delta repeat their "
                "commands in every sample: the "
                         "positions of the actuators are not measured",
                         "record rudder angle and shaft speed beside "
                         "the commands"))  # fmt: skip
    wind = s.environment("wind_speed")
    if wind is None or s.environment("wind_from") is None:
        found.append(Gap("gusts, and wind that differs from run to run", "wind_speed and wind_from are not recorded",
                         "record the true wind; or repeat a run on another day"))  # fmt: skip
    depth = s.environment("depth")
    if depth is None or np.ptp(depth) < 0.1 * np.median(depth):
        is_there = (
            f"depth is {np.min(depth):.3g} to {np.max(depth):.3g} m in all samples"
            if depth is not None
            else f"{ENVIRONMENT[2]} is not recorded"
        )
        found.append(Gap("shallow water", is_there, "record the depth, and repeat a steady turn at another depth"))
    return found
