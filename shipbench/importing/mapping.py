"""Schema of mapping.toml: the columns of each signal with unit, sign and clock; and the division of the log into
runs."""

from __future__ import annotations

import difflib
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, Field, ValidationError

from ..errors import InputError, option
from ..names import check_name
from ..toml_files import read_toml
from .entries import Channel, Part, check_channel
from .thresholds import THRESHOLDS

SOURCE_KEYS = ("files", "time", "file", "channels", "missing", "antenna", "speed_sensor", "run")


class Clock(Part):
    """Columns and format of the time. `rate` [Hz] alone serves a log without a time column; `shift` [s] is added to
    every time.

    `repeated`: rows that share a stamp keep it ("first"), or are spread evenly until the next stamp. `backwards`: rows
    that go back in time are refused, left out ("drop"), sorted, or begin a recording of their own ("split": the clock
    was set back).
    """

    column: str | None = None
    columns: tuple[str, str] | None = None
    format: str = "s"
    zone: str | None = None
    rate: float | None = Field(None, ge=THRESHOLDS.value("least_rate"), le=THRESHOLDS.value("largest_rate"))
    shift: float = Field(0.0, ge=-THRESHOLDS.value("latest_time"), le=THRESHOLDS.value("latest_time"))
    repeated: Literal["first", "spread"] = "first"
    backwards: Literal["error", "drop", "sort", "split"] = "error"

    @property
    def names(self) -> tuple[str, ...]:
        """Columns that hold the time."""
        return self.columns or ((self.column,) if self.column else ())


class Layout(Part):
    """Layout of the file. `header` is the number of the header's row, 0 where there is none (columns are then called
    "1", "2", ...); `skip` the rows between it and the data (such as a row of units); `delimiter = " "` stands for runs
    of blanks; `thousands` stands between groups of three digits."""

    delimiter: str | None = Field(None, min_length=1, max_length=1)
    decimal: Literal[".", ","] = "."
    thousands: Literal[".", ",", " ", "'"] | None = None
    encoding: str = "utf-8"
    header: int = Field(1, ge=0, le=THRESHOLDS.count("rows_above_data"))
    skip: int = Field(0, ge=0, le=THRESHOLDS.count("rows_above_data"))
    sheet: str | None = None


class Point(Part):
    """Position on board [m]: x forward of midship, y to starboard of the centre line; the longest ships have 460 m."""

    x: float = Field(ge=-THRESHOLDS.value("largest_lever"), le=THRESHOLDS.value("largest_lever"))
    y: float = Field(0.0, ge=-THRESHOLDS.value("largest_lever"), le=THRESHOLDS.value("largest_lever"))


class Origin(Part):
    """Point where the local plane touches the earth [deg]."""

    lat: float = Field(ge=-90, le=90)
    lon: float = Field(ge=-180, le=180)


class Source(Part):
    """Kind of file. `antenna` is the point that x, y, lat, lon, sog and cog belong to, `speed_sensor` the one of u and
    v (default: midship)."""

    files: str = "*"
    time: Clock
    file: Layout = Layout()
    channels: dict[str, Channel] = Field(min_length=1)
    missing: list[str | float] = Field(default_factory=list)
    antenna: Point | None = None
    speed_sensor: Point | None = None
    run: str | None = None


class Split(Part):
    """Division of logs into runs; all in s and m/s. `gap`: longer pauses split; `window`: runs of that length;
    `shortest`: shorter ones are left out; `longest`: longer ones are cut in parts of one group; `still_speed`:
    stretches slower than that for `still_time` are left out."""

    gap: float = Field(THRESHOLDS.value("default_gap"), gt=0)
    window: float | None = Field(None, gt=0, allow_inf_nan=False)
    shortest: float | None = Field(None, ge=0, allow_inf_nan=False)
    longest: float = Field(THRESHOLDS.value("default_longest"), gt=0, allow_inf_nan=False)
    still_speed: float | None = Field(None, gt=0)
    still_time: float = Field(THRESHOLDS.value("default_still_time"), gt=0)


class Mapping(Part):
    """Content of mapping.toml. A mapping of one kind of file has the keys of `Source` at the top; of several, tables
    [sources.NAME]."""

    name: str = Field(min_length=1)
    dt: float = Field(gt=0, allow_inf_nan=False)
    actuators: Literal["measured", "commanded"] | None = None
    source: str = ""
    licence: str = ""
    origin: Origin | None = None
    antialias: bool = True
    split: Split = Split()
    sources: dict[str, Source] = Field(min_length=1)

    def has(self, channel: str) -> bool:
        """Whether any source has the channel."""
        return any(channel in source.channels for source in self.sources.values())

    def gap(self, channel: str) -> float:
        """Longest time [s] between two samples of `channel` that is not a gap."""
        own = next(s.channels[channel].gap for s in self.sources.values() if channel in s.channels)
        return own or self.split.gap


def load_mapping(path: str | Path, **overrides: Any) -> Mapping:
    """Read and check a mapping.

    Args:
        path: the TOML file.
        overrides: `name`, `dt`, and keys of [split], which replace those of the file where they are not None.

    Raises:
        InputError: not TOML; a missing or unknown key (with the nearest accepted one), channel, unit or sign; channels
            that make no data set.
    """
    data = read_toml(path)
    for key, value in overrides.items():
        table = data.setdefault("split", {}) if key in Split.model_fields else data
        if value is not None and isinstance(table, dict):  # a split that is no table is refused below
            table[key] = value
    mapping = validated(data, path)
    check_name(mapping.name, f"{path}: name")
    for source in mapping.sources.values():
        mark = source.file.delimiter
        if mark is not None and (mark.isalnum() or not mark.isascii() or mark in '"\r\n\0.+-'):
            raise InputError(
                f"{path}: [file] delimiter = {mark!r}; accepted: a mark between columns, such as ',', ';', '|', "
                "'\\t', or ' ' for blanks."
            )
        if source.file.thousands == source.file.decimal:
            raise InputError(
                f"{path}: [file] decimal and thousands are both '{source.file.decimal}'; accepted: two marks. "
                "Correct one."
            )
        for name, channel in source.channels.items():
            check_channel(name, channel, path)
        _check_clock(source.time, path)
    _check_together(mapping, path)
    return mapping


def validated(data: dict[str, Any], path: str | Path) -> Mapping:
    """Mapping from checked keys and types of its entries; of one kind of file, its keys stand at the top.

    Raises:
        InputError: a missing or unknown key, or a value of another type.
    """
    single = "sources" not in data
    if single:
        data = {k: v for k, v in data.items() if k not in SOURCE_KEYS} | {
            "sources": {"log": {k: data[k] for k in SOURCE_KEYS if k in data}}
        }
    try:
        return Mapping.model_validate(data)
    except ValidationError as error:
        raise _explained(error, path, single) from None


def _explained(error: ValidationError, path: str | Path, single: bool) -> InputError:
    first = error.errors()[0]
    loc = [str(k) for k in first["loc"]]
    shown = ".".join(loc[2:] if single and loc[:2] == ["sources", "log"] else loc)
    more = f" ({error.error_count() - 1} more faults)" if error.error_count() > 1 else ""
    if first["type"] == "extra_forbidden":
        accepted = _accepted(loc[:-1], single)
        near = difflib.get_close_matches(loc[-1], accepted, n=1, cutoff=0.5)
        hint = f" Did you mean '{near[0]}'?" if near else ""
        return InputError(f"{path}: unknown key '{shown}'.{hint} Accepted there: {', '.join(accepted)}.{more}")
    if first["type"] == "model_type":
        keys, given = ", ".join(_accepted(loc, single)), str(first["input"])[:80]
        such = f', such as {loc[-1]} = {{ column = "{given}" }}' if loc[-2:-1] == ["channels"] else ""
        return InputError(f"{path}: {shown} = '{given}'; accepted: a table with {keys}{such}.{more}")
    value = "" if first["type"] == "missing" else f" (value: {str(first['input'])[:80]})"
    draft = option("shipbench data import LOG --propose mapping.toml", 'shipbench.propose_mapping(LOG, "mapping.toml")')
    return InputError(f"{path}: {shown}: {first['msg']}{value}{more}. `{draft}` writes a draft.")


def _accepted(loc: list[str], single: bool) -> list[str]:
    """Keys that the table at `loc` may have."""
    parts: dict[str, type[BaseModel]] = {
        "time": Clock, "file": Layout, "antenna": Point, "speed_sensor": Point, "origin": Origin, "split": Split,
    }  # fmt: skip
    if not loc:
        keys = [k for k in Mapping.model_fields if not single or k != "sources"]
        return [*keys, *SOURCE_KEYS] if single else keys
    model = Source if loc[0] == "sources" and len(loc) == 2 else parts.get(loc[-1], Channel)
    return list(model.model_fields)


def _check_clock(clock: Clock, path: str | Path) -> None:
    given = [k for k in ("column", "columns", "rate") if getattr(clock, k) is not None]
    if len(given) != 1:
        raise InputError(
            f'{path}: [time] has {" and ".join(given) or "no column"}; accepted: one of column = "...", columns = '
            '["date", "time"], '
            "or rate = 10.0 [Hz] for a log without a time column."
        )
    if clock.zone is not None:
        from zoneinfo import ZoneInfo

        try:
            ZoneInfo(clock.zone)
        except (KeyError, ValueError, OSError):
            raise InputError(
                f"{path}: [time] zone = '{clock.zone}'; accepted: names such as 'UTC' or 'Europe/Amsterdam'."
            ) from None


def _check_together(mapping: Mapping, path: str | Path) -> None:
    names = [c for s in mapping.sources.values() for c in s.channels]
    twice = sorted({c for c in names if names.count(c) > 1})
    if twice:
        raise InputError(f"{path}: channel '{twice[0]}' stands in more than one source; accepted: one.")
    if "psi" not in names:
        raise InputError(
            f"{path}: no channel 'psi'; the heading is needed (a course over ground is no heading). Mapped: "
            f"{', '.join(names)}."
        )
    if not {"x", "y"} <= set(names) and not {"lat", "lon"} <= set(names):
        raise InputError(f"{path}: no position; map both x and y [m], or both lat and lon. Mapped: {', '.join(names)}.")
    if {"x", "y"} & set(names) and {"lat", "lon"} & set(names):
        raise InputError(
            f"{path}: a position as x, y and as lat, lon; accepted: one of them. Mapped: {', '.join(names)}."
        )
    for a, b in (
        ("sog", "cog"),
        ("wind_speed", "wind_from"),
        ("apparent_wind_speed", "apparent_wind_from"),
        ("lat", "lon"),
        ("x", "y"),
    ):
        if (a in names) != (b in names):
            here, gone = (a, b) if a in names else (b, a)
            raise InputError(f"{path}: '{here}' is mapped without '{gone}'; accepted: both or neither.")
        at = [s for s, source in mapping.sources.items() if {a, b} & set(source.channels)]
        if len(at) > 1:
            raise InputError(
                f"{path}: '{a}' and '{b}' stand in the sources {' and '.join(at)}; accepted: both in one, on one clock."
            )
    if len(mapping.sources) > 1 and any(s.run for s in mapping.sources.values()):
        raise InputError(
            f"{path}: `run` serves a mapping with one source. Split several merged sources by gaps, windows or "
            "standing still."
        )
    if mapping.split.window is not None and mapping.split.window < mapping.dt:
        raise InputError(
            f"{path}: split.window = {mapping.split.window:g} s is below dt = {mapping.dt:g} s; accepted: two "
            "samples or more."
        )
    if mapping.split.gap < mapping.dt * 0.5:
        raise InputError(
            f"{path}: split.gap = {mapping.split.gap:g} s is below dt = {mapping.dt:g} s; give the longest pause to "
            "be bridged."
        )
