"""Values of a channel, in standard unit and sign, from the cells of a block: columns, expressions of columns, positions
as written."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ..errors import InputError
from .cells import Cells
from .coordinates import coordinates
from .entries import ANGLES, ARCS, LIMITS, MINUTES, Channel, channel_factor
from .sentinels import CODES, beyond_a_turn, not_available
from .thresholds import THRESHOLDS


def channel_values(cells: Cells, name: str, channel: Channel) -> np.ndarray:
    """Values (n,) in standard unit and sign, NaN where there is none.

    Raises:
        InputError: a cell is no number, or a position is none on earth.
    """
    factor = channel_factor(name, channel)
    missing = _missing(cells, name, channel)
    if name in ("lat", "lon") and channel.kinds == ("column",):
        columns = [coordinates(cells, name, channel, missing)]
    else:
        columns = [cells.numbers(column, missing) for column in channel.columns]
    if channel.kinds[0] not in ARCS and channel.missing != []:
        columns = [_available(cells, name, channel, readings) for readings in columns]
        if name in ANGLES:
            _tell_turns(cells, name, abs(factor) * np.concatenate(columns))
    circular = channel.kinds == ("mean",) and name in ANGLES
    readings = _mean_angle(columns, abs(factor)) if circular else _EXPRESSIONS[channel.kinds[0]](columns)
    values = factor * (readings + channel.offset - channel.neutral)
    _check_range(cells, name, channel, values)
    return values


def _missing(cells: Cells, name: str, channel: Channel) -> list[str | float]:
    """Marks of a missing value in a channel: its own list, and the source's without codes of other channels: 511 is no
    heading, but may be a shaft speed."""
    kept = []
    for mark in cells.source.missing:
        of = [other for other, codes in CODES.items() if any(mark == code for code, _, _ in codes)]
        if name in of or not set(of) & set(cells.source.channels):
            kept.append(mark)
        else:
            count = int(sum((cells.numbers(column, ()) == mark).sum() for column in channel.columns))
            cells.met.doubtful[
                f"readings of {name} that are {mark:g}, kept: `missing` of the source is taken for the code of "
                f"{of[0]}. "
                f"If they are none: missing = [{mark:g}] in channels.{name}"
            ] += count
    return [*kept, *(channel.missing or [])]


def _available(cells: Cells, name: str, channel: Channel, readings: np.ndarray) -> np.ndarray:
    """Readings without those that stand for "not available"; removed and suspect readings are counted for the
    summary."""
    if channel.unit == "pwm":
        none = (readings <= 0.0) | (readings == 65_535.0)
        cells.met.what[f"readings of {name} that are 0 or 65535 us (no pulse), taken as missing"] += int(none.sum())
        readings = np.where(none, np.nan, readings)
    masks, doubtful = not_available(name, readings, channel_factor(name, channel), channel.neutral)
    for words, mask in masks.items():
        cells.met.what[f"readings of {name} that are {words}, taken as missing"] += int(mask.sum())
    for value in np.unique(readings[doubtful]):
        cells.met.doubtful[
            (
                f"readings of {name} are {value:.10g}, far from all others. If it stands for no reading: missing = "
                f"[{value:.10g}] in channels.{name}"
            )
        ] += int((readings == value).sum())
    return np.where(np.logical_or.reduce([np.zeros(len(readings), bool), *masks.values()]), np.nan, readings)


def _tell_turns(cells: Cells, name: str, angles: np.ndarray) -> None:
    """Count angles [rad] beyond 360 degrees by more than a turn, for the summary: those that jump, and their range."""
    odd = beyond_a_turn(angles)
    cells.met.doubtful[f"readings of {name} jump beyond -180 to 360 deg: outliers, or a code to list in `missing`"] += (
        int(odd.sum())
    )
    there = np.rad2deg(angles[np.isfinite(angles) & ~odd])
    if len(there) and (there.max() > 720.0 or there.min() < -360.0):
        cells.met.reach[name] = max(cells.met.reach.get(name, 0.0), float(np.abs(there).max()))


def _mean_angle(columns: Sequence[np.ndarray], factor: float) -> np.ndarray:
    """Mean direction, in the unit that `factor` makes radians of: of 359 and 1 degrees it is 0, not 180."""
    angles = factor * np.stack(columns)
    return np.arctan2(np.sin(angles).mean(axis=0), np.cos(angles).mean(axis=0)) / factor


def _arc(columns: Sequence[np.ndarray]) -> np.ndarray:
    """Angle of [y, x] in radians; none where both are zero."""
    y, x = columns
    return np.where((y == 0.0) & (x == 0.0), np.nan, np.arctan2(y, x))


def _heading(columns: Sequence[np.ndarray]) -> np.ndarray:
    """Rotation about the vertical [rad] of the body-to-earth quaternion [x, y, z, w], of any length but zero."""
    x, y, z, w = columns
    return _arc([2.0 * (w * z + x * y), w * w + x * x - y * y - z * z])


_EXPRESSIONS: dict[str, Callable[[Sequence[np.ndarray]], np.ndarray]] = {
    "column": lambda columns: columns[0],
    "mean": lambda columns: np.mean(columns, axis=0),
    "sum": lambda columns: np.sum(columns, axis=0),
    "diff": lambda columns: columns[0] - columns[1],
    "atan2": _arc,
    "quaternion": _heading,
}


def _check_range(cells: Cells, name: str, channel: Channel, values: np.ndarray) -> None:
    limit = LIMITS.get(name)
    if limit is None or not (np.abs(values) > limit + 1e-9).any():
        return
    worst = float(np.rad2deg(np.nanmax(np.abs(values))))
    where = f"{cells.path}, rows from {cells.first_row}: '{name}' reaches {worst:g} deg"
    hint = "Check unit and format of its column."
    if channel.unit == "deg":
        degrees = np.abs(np.rad2deg(values[np.isfinite(values)]))
        if THRESHOLDS.value("counted_position") <= worst <= np.rad2deg(limit) * 1e7:
            hint = f'Is it counted in 1e-7 deg? Then write unit = "1e-7 deg" (or factor = 1e-7) in {name}.'
        elif worst <= np.rad2deg(limit) * 100.0 and (degrees % 100.0 <= 60.0).all() and _lat_in_minutes(cells):
            hint = (
                f'Are the last two whole digits minutes? Then write unit = "ddmm.mmmm" in {name}, and hemisphere '
                '= "COLUMN" for N/S or E/W.'
            )
    raise InputError(f"{where}; accepted: up to {np.rad2deg(limit):g}. {hint}")


def _lat_in_minutes(cells: Cells) -> bool:
    """Whether the latitude is, or may be, in ddmm.mmmm: what is advised for one of the two fits the other."""
    lat = cells.source.channels.get("lat")
    if lat is None or lat.kinds != ("column",) or lat.unit in MINUTES:
        return True
    return bool((np.abs(coordinates(cells, "lat", lat, _missing(cells, "lat", lat))) > 90.0).any())
