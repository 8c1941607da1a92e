"""Entry of a channel in mapping.toml: its columns, unit and sign."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..errors import InputError, unknown_name
from ..signals import COMMANDS, ENVIRONMENT, STATES, UNITS
from ..units import sign_factor, unit_factor
from .thresholds import THRESHOLDS

EXTRA_UNITS = {
    "lat": "rad",
    "lon": "rad",
    "sog": "m/s",
    "cog": "rad",
    "apparent_wind_speed": "m/s",
    "apparent_wind_from": "rad",
}
"""Units of channels that a log may hold beside the standard signals: WGS84 position, speed and course over ground
(course clockwise from north), and the apparent wind, its direction where it comes from, clockwise from the bow."""
CHANNELS = (*STATES, *COMMANDS, *ENVIRONMENT, *EXTRA_UNITS)
ANGLES = ("psi", "cog", "wind_from", "apparent_wind_from")
"""Angles that wrap around; lon is converted to a position before anything else."""
LIMITS = {"lat": 0.5 * math.pi, "lon": 2.0 * math.pi}
"""Greatest size of a position on earth [rad]."""
EXPRESSIONS = ("column", "mean", "sum", "diff", "atan2", "quaternion")
"""Expressions for a channel: one column; mean or sum of several; the first less the second; the angle of [y, x]; the
heading of the body-to-earth quaternion [x, y, z, w]."""
ARCS = ("atan2", "quaternion")
MINUTES = ("ddmm.mmmm", "ddmm.mmmmN")
"""Formats of latitude and longitude in NMEA 0183, degrees and minutes in one number; with the letter of the hemisphere
in the cell."""
_OF_FULL = {"%": 100.0, "pwm": 500.0}
_SIGN_WORDS = {"lat": ("north", "south"), "lon": ("east", "west"), "cog": ("clockwise", "counterclockwise"),
               "apparent_wind_from": ("clockwise", "counterclockwise")}  # fmt: skip
_UNITS_LIKE = {
    "lat": "psi",
    "lon": "psi",
    "sog": "u",
    "cog": "psi",
    "apparent_wind_speed": "u",
    "apparent_wind_from": "psi",
}


_MOST = THRESHOLDS.value("largest_factor")


class Part(BaseModel):
    """Table of mapping.toml. An unknown key is an error, never ignored."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=True)


class Channel(Part):
    """Column, or expression of columns: standard value = sign x unit x factor x (reading + offset).

    `gap` [s] replaces the mapping's for this channel (inf: logged on change); `missing` lists readings that are none,
    beside the source's (an empty list: every number is a reading, also those that stand for "not available" by
    convention). `unit = "%"` and `unit = "pwm"` need `full`, the value in `full_unit` at 100 % or at 2000 us.
    `hemisphere` is the column with N or S, E or W; `part` is the place (1 or 2) in a cell that holds latitude and
    longitude.
    """

    column: str | None = None
    mean: tuple[str, ...] | None = Field(None, min_length=2)
    sum: tuple[str, ...] | None = Field(None, min_length=2)
    diff: tuple[str, str] | None = None
    atan2: tuple[str, str] | None = None
    quaternion: tuple[str, str, str, str] | None = None
    unit: str
    sign: str | None = None
    offset: float = Field(0.0, ge=-_MOST, le=_MOST)
    factor: float = Field(1.0, ge=-_MOST, le=_MOST)
    gap: float | None = Field(None, gt=0)
    missing: list[str | float] | None = None
    hemisphere: str | None = None
    part: Literal[1, 2] | None = None
    full: float | None = Field(None, ge=-_MOST, le=_MOST)
    full_unit: str | None = None

    @model_validator(mode="before")
    @classmethod
    def _angle_in_radians(cls, data: Any) -> Any:
        """Set the unit of an arc tangent and of a quaternion's heading to radians."""
        return {"unit": "rad", **data} if isinstance(data, dict) and set(data) & set(ARCS) else data

    @property
    def kinds(self) -> tuple[str, ...]:
        """Keys given among `column` and the expressions; a checked mapping has one."""
        return tuple(kind for kind in EXPRESSIONS if getattr(self, kind) is not None)

    @property
    def columns(self) -> tuple[str, ...]:
        """Columns with the numbers, in their order in the expression."""
        given = getattr(self, self.kinds[0])
        return (given,) if isinstance(given, str) else tuple(given)

    @property
    def every_column(self) -> tuple[str, ...]:
        """Names of all columns that are read for it."""
        return (*self.columns, *([self.hemisphere] if self.hemisphere else []))

    @property
    def neutral(self) -> float:
        """Reading that corresponds to zero."""
        return 1500.0 if self.unit == "pwm" else 0.0

    def __str__(self) -> str:
        names = ", ".join(f"'{name}'" for name in self.columns)
        read = names if self.kinds == ("column",) else f"{self.kinds[0]}({names})"
        return f"{read}, part {self.part}" if self.part else read


def unit_of(channel: str) -> str:
    """Standard unit of a channel."""
    return EXTRA_UNITS.get(channel) or UNITS[channel]


def channel_factor(name: str, channel: Channel) -> float:
    """Factor from (reading + offset) to the standard unit and sign.

    Raises:
        InputError: unknown unit or sign.
    """
    like = _UNITS_LIKE.get(name, name)
    if channel.unit in _OF_FULL:
        if channel.full is None or channel.full_unit is None:
            raise InputError(f'unit "{channel.unit}" without full; accepted: {_full_of(name)}.')
        factor = channel.factor * channel.full / _OF_FULL[channel.unit] * unit_factor(like, channel.full_unit)
    elif name in ("lat", "lon") and channel.unit in MINUTES:
        factor = channel.factor * unit_factor(like, "deg")
    else:
        factor = channel.factor * unit_factor(like, channel.unit)
    if channel.sign is None:
        return factor
    if name in _SIGN_WORDS:
        if channel.sign not in _SIGN_WORDS[name]:
            raise unknown_name(f"sign of '{name}'", channel.sign, _SIGN_WORDS[name])
        return -factor if channel.sign == _SIGN_WORDS[name][1] else factor
    return factor * sign_factor(name, channel.sign)


def _full_of(name: str) -> str:
    """Example of the meaning of 100 %."""
    value, unit = {"rad": (35.0, "deg"), "rpm": (120.0, "rpm"), "N": (100.0, "kN")}.get(
        unit_of(name), (1.0, unit_of(name))
    )
    return (
        f'the value at full deflection, such as full = {value}, full_unit = "{unit}" (of %, the same as factor = '
        f'{value / 100:g}, unit = "{unit}")'
    )


def check_channel(name: str, channel: Channel, path: str | Path) -> None:
    """Check that the entry names one channel, one expression, a unit and a sign, and that its keys fit each other.

    Raises:
        InputError: it does not; `path` is the mapping.
    """
    if name not in CHANNELS:
        raise unknown_name(f"channel in [channels] of {path}:", name, CHANNELS)
    if len(channel.kinds) != 1:
        raise InputError(
            f"{path}: channel '{name}' has {' and '.join(channel.kinds) or 'no column'}; accepted: one of "
            f"{', '.join(EXPRESSIONS)}."
        )
    where = f"{path}: channel '{name}', column {channel}"
    if channel.kinds[0] in ARCS and channel.unit != "rad":
        raise InputError(f'{where}: unit = "{channel.unit}"; {channel.kinds[0]} makes radians. Remove unit.')
    try:
        channel_factor(name, channel)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
    if any(abs(size) < 1.0 / _MOST for size in (channel.factor, channel.full) if size is not None):
        raise InputError(
            f"{where}: factor or full is 0 or next to it; accepted: any other number (it multiplies the reading)."
        )
    if channel.unit not in _OF_FULL and (channel.full is not None or channel.full_unit is not None):
        raise InputError(
            f'{where}: full belongs to unit = "%" or "pwm", not to "{channel.unit}". Remove full and full_unit.'
        )
    as_written = [k for k in ("hemisphere", "part") if getattr(channel, k) is not None] + [channel.unit] * (
        channel.unit in MINUTES
    )
    if as_written and (name not in ("lat", "lon") or channel.kinds != ("column",)):
        raise InputError(f"{where}: {as_written[0]} serves a lat or lon of one column. Remove it.")
    if as_written and channel.sign is not None and as_written[0] != "part":
        raise InputError(f"{where}: {as_written[0]} and sign = '{channel.sign}'; accepted: one of them. Remove sign.")
