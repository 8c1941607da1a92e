"""Readings that stand for "not available": AIS codes, fill values of recorders, the largest integer of a field. Each
channel is judged by itself."""

from __future__ import annotations

import numpy as np

from ..units import unit_factor
from .entries import ANGLES, LIMITS
from .thresholds import THRESHOLDS

_DEG, _DEG_PER_MIN, _KNOT = unit_factor("psi", "deg"), unit_factor("r", "deg/min"), unit_factor("u", "kn")
_TURN = 2.0 * np.pi
_MARGIN = THRESHOLDS.value("angle_margin") * _DEG
_AIS, _NO_FIX = "AIS: not available", "no fix"
CODES: dict[str, tuple[tuple[float, float, str], ...]] = {
    "lat": ((91.0, _DEG, f"91 deg ({_AIS})"), (0.0, _DEG, f"0 deg ({_NO_FIX})")),
    "lon": ((181.0, _DEG, f"181 deg ({_AIS})"), (0.0, _DEG, f"0 deg ({_NO_FIX})")),
    "psi": ((511.0, _DEG, f"511 deg ({_AIS})"),),
    "cog": ((511.0, _DEG, f"511 deg ({_AIS})"), (360.0, _DEG, f"360 deg ({_AIS})")),
    "sog": ((102.3, _KNOT, f"102.3 kn ({_AIS})"),),
    "u": ((102.3, _KNOT, f"102.3 kn ({_AIS})"),),
    "r": ((-128.0, _DEG_PER_MIN, f"-128 deg/min ({_AIS})"), (-731.386, _DEG_PER_MIN, f"-731 deg/min ({_AIS})")),
}
"""Value, its standard unit, in words: position reports of the AIS (ITU-R M.1371-5, table 48; -731 deg/min is the
decoded -128), receivers without a fix."""
_LARGEST = {
    **LIMITS, **dict.fromkeys((*ANGLES, "r"), _TURN),
    **dict.fromkeys(("u", "v", "sog"), THRESHOLDS.value("largest_speed")),
    **dict.fromkeys(("delta", "delta_c"), THRESHOLDS.value("largest_rudder")),
    **dict.fromkeys(("n", "n_c"), THRESHOLDS.value("largest_shaft_speed")),
    **dict.fromkeys(("wind_speed", "apparent_wind_speed"), THRESHOLDS.value("largest_wind")),
    "depth": THRESHOLDS.value("largest_depth"),
}  # fmt: skip
"""Largest value of any ship, shaft, sea or storm, in standard units; a fill value beyond it is no reading, whatever the
others are."""
_ORDERED = ("n", "delta", "F_b", "F_s", "n_c", "delta_c", "F_b_c", "F_s_c")
"""Channels that may step to any value at once; the others are continuous."""
_NINES = np.array([999.0, 9999.0, 99_999.0, 999_999.0])
_WHOLE = np.array([32_767.0, 32_768.0, 65_535.0, 2_147_483_647.0, 2_147_483_648.0, 4_294_967_295.0])
_SCALED = np.unique((np.r_[_NINES, _WHOLE][:, None] / 10.0 ** np.arange(8)).ravel())
_FILLS = _SCALED[THRESHOLDS.value("smallest_fill") < _SCALED]
_FACTORS = [
    _DEG, _DEG_PER_MIN, _KNOT, unit_factor("u", "km/h"), unit_factor("x", "ft"), unit_factor("n", "rev/s"),
]  # fmt: skip
_CONVERTED = np.unique((np.r_[_NINES, 0.01 * _WHOLE[:3]][:, None] * np.array(_FACTORS)).ravel())
"""Fill values that were converted to the standard unit from degrees, knots, km/h, feet or rev/s."""


def not_available(
    name: str, readings: np.ndarray, factor: float, neutral: float = 0.0
) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Masks (n,) of readings that are none, by kind; and a mask of readings that look like fill values, but may be
    readings.

    Args:
        name: the channel.
        readings: (n,) as in the log, NaN where there is none.
        factor: of a reading to the standard unit; its sign does not matter.
        neutral: reading that corresponds to zero.
    """
    values = abs(factor) * (readings - neutral)
    known = {words: np.isclose(values, code * unit, rtol=1e-4, atol=0.0) for code, unit, words in CODES.get(name, ())}
    beyond = np.abs(values) > _LARGEST.get(name, np.inf) * (1.0 + 1e-6)
    if name == "depth":
        beyond |= values < 0.0
    fills = _is_one_of(_FILLS, np.abs(readings), 0.0)
    if beyond.any():
        fills |= beyond & _is_one_of(_CONVERTED, np.abs(values), 1e-5)
    hits = np.logical_or.reduce([fills, *known.values()])
    if not hits.any():
        return {}, hits
    others = np.isfinite(values) & ~hits
    counted_on = name in ANGLES and bool(
        (np.abs(values[others]) > _TURN + _MARGIN).any()
    )  # over north: readings beyond a turn are readings
    sure = hits & beyond & (not counted_on)
    doubtful = np.zeros(len(values), bool)
    if name in _ORDERED:
        far, idle = _far(values, others)
        sure, doubtful = sure | (hits & far & (not idle)), hits & ~sure & far & idle
    else:
        sure |= _unled(values, hits & ~sure, hits, name in ANGLES and not counted_on)
    masks = {words: mask & sure for words, mask in known.items()}
    rest = sure & ~np.logical_or.reduce([np.zeros(len(values), bool), *known.values()])
    masks |= {f"{value:.10g} (a fill value)": rest & (readings == value) for value in np.unique(readings[rest])}
    return {words: mask for words, mask in masks.items() if mask.any()}, doubtful


def _is_one_of(table: np.ndarray, values: np.ndarray, tolerance: float) -> np.ndarray:
    """Whether values (n,) are in a sorted table, to a relative tolerance."""
    place = np.clip(np.searchsorted(table, values), 1, len(table) - 1)
    near = np.minimum(np.abs(values - table[place]), np.abs(values - table[place - 1]))
    return near <= tolerance * values


def _far(values: np.ndarray, others: np.ndarray) -> tuple[np.ndarray, bool]:
    """Mask of values farther from the others than these are from each other, or from zero where all are alike; and
    whether all others are zero."""
    if not others.any():
        return np.zeros(len(values), bool), True
    low, high = values[others].min(), values[others].max()
    span = high - low if high > low else abs(high)
    return (values > high + span) | (values < low - span), bool(span == 0.0)


def _unled(values: np.ndarray, hit: np.ndarray, suspect: np.ndarray, wraps: bool) -> np.ndarray:
    """Hits that a continuous channel cannot have reached: the steps to the neighbouring readings exceed every step
    between readings in the block that are not suspect."""
    others = np.flatnonzero(np.isfinite(values) & ~suspect)
    if len(others) < 2 or not hit.any():
        return np.zeros(len(values), bool)

    def distance(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        gap = np.abs(a - b)
        return np.minimum(gap % _TURN, -gap % _TURN) if wraps else gap

    whole = np.diff(np.cumsum(suspect)[others]) == 0
    steps = distance(values[others[1:]], values[others[:-1]])[whole]
    largest = steps.max() if len(steps) else 0.0
    rows = np.flatnonzero(hit)
    place = np.searchsorted(others, rows)
    before = np.where(place > 0, distance(values[rows], values[others[np.maximum(place - 1, 0)]]), np.inf)
    after = np.where(
        place < len(others), distance(values[rows], values[others[np.minimum(place, len(others) - 1)]]), np.inf
    )
    limit = np.maximum(
        largest, _MARGIN if wraps else THRESHOLDS.value("flicker") * np.abs(values[rows])
    )  # a flicker of the last digit is no step
    unled = np.zeros(len(values), bool)
    unled[rows] = np.minimum(before, after) > limit
    return unled


def beyond_a_turn(values: np.ndarray) -> np.ndarray:
    """Angles (n,) [rad] outside of -180 to 360 degrees that the ship did not turn to: they begin and end with a step of
    half a turn or more."""
    rows = np.flatnonzero(np.isfinite(values))
    found = np.zeros(len(values), bool)
    out = (values[rows] > _TURN + _MARGIN) | (values[rows] < -0.5 * _TURN - _MARGIN)
    jumps = np.abs(np.diff(values[rows])) >= 0.5 * _TURN
    edges = np.diff(out.astype(int))
    begins, ends = np.flatnonzero(edges > 0) + 1, np.flatnonzero(edges < 0) + 1
    for begin in begins:
        after = ends[ends > begin]
        if len(after) and jumps[begin - 1] and jumps[after[0] - 1]:
            found[rows[begin : after[0]]] = True
    return found
