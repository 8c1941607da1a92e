"""Units and signs that a data set's files may use, as factors to the standard ones."""

from __future__ import annotations

import math
import re

from .errors import unknown_name
from .signals import UNITS

LENGTHS = {"m": 1.0, "km": 1000.0, "ft": 0.3048, "nmi": 1852.0}
_ANGLE = {"rad": 1.0, "deg": math.pi / 180.0, "cdeg": math.pi / 18_000.0}
_SPEED = {"m/s": 1.0, "kn": 1852.0 / 3600.0, "km/h": 1.0 / 3.6, "ft/s": 0.3048, "cm/s": 0.01}
_RATE = {"rad/s": 1.0, "deg/s": math.pi / 180.0, "deg/min": math.pi / 10800.0, "cdeg/s": math.pi / 18_000.0}
_SHAFT = {"rpm": 1.0, "rev/s": 60.0, "rad/s": 60.0 / (2.0 * math.pi)}
_FORCE = {"N": 1.0, "kN": 1e3, "MN": 1e6, "tf": 9806.65}
_PARTS = re.compile(r"(\d+(?:\.\d+)?(?:[eE][-+]?\d+)?) (\S+)")
_BY_OURS = {"m": LENGTHS, "rad": _ANGLE, "m/s": _SPEED, "rad/s": _RATE, "rpm": _SHAFT, "N": _FORCE}

_FLIPS = {
    "x": "south", "y": "west", "psi": "counterclockwise", "u": "astern", "v": "port", "r": "port", "n": "astern",
    "delta": "port",
    "F_b": "port", "F_s": "port", "wind_from": "counterclockwise",
}  # fmt: skip
_KEEPS = {
    "x": "north", "y": "east", "psi": "clockwise", "u": "ahead", "v": "starboard", "r": "starboard", "n": "ahead",
    "delta": "starboard",
    "F_b": "starboard", "F_s": "starboard", "wind_from": "clockwise",
}  # fmt: skip


def unit_factor(signal: str, unit: str) -> float:
    """Factor from `unit` to the standard unit of `signal`; "1e-7 deg" and "0.1 kn" are units for logs that count in
    such steps.

    Raises:
        InputError: the unit is not known for this signal.
    """
    table = _BY_OURS[UNITS[signal]]
    steps = _PARTS.fullmatch(unit)
    size, name = (float(steps[1]), steps[2]) if steps else (1.0, unit)
    if name not in table or not 1e-12 <= size <= 1e12:
        raise unknown_name(f"unit of '{signal}'", unit, table)
    return size * table[name]


def sign_factor(signal: str, positive: str) -> float:
    """Sign (+1 or -1) for the side or sense that is positive in the file.

    Raises:
        InputError: the word is not known for this signal.
    """
    base = signal.removesuffix("_c")
    words = [w for w in (_FLIPS.get(base), _KEEPS.get(base)) if w]
    if positive not in words:
        raise unknown_name(f"sign of '{signal}'", positive, [*words, *(["to"] if signal == "wind_from" else [])])
    return -1.0 if positive == _FLIPS[base] else 1.0
