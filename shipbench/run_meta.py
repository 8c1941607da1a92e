"""Metadata of a run: the table [runs.<id>] of dataset.toml, checked."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import date, datetime
from numbers import Integral, Real
from typing import Any, Literal, NamedTuple

from .errors import InputError
from .names import check_label, check_run, shown

SPLITS = ("train", "test")
"""Sides of a published split."""
_FILES = 1_000_000
"""Most characters of `file`, which names thousands of logs where a run comes from so many."""


class Origin(NamedTuple):
    """Latitude and longitude [deg] of the point x = y = 0."""

    lat: float
    lon: float


@dataclass(frozen=True, kw_only=True)
class RunMeta:
    """Metadata of a run; None where not stated.

    Args:
        manoeuvre: kind of manoeuvre, such as "zigzag 20/20".
        group: text or a whole number that is shared by the runs that no fold may part.
        parent: id of the run of which this one is a window.
        split: "train" or "test" of a published split.
        from_, to: begin and end of the run: ISO 8601 date and time (UTC where no zone is given), or seconds of the log.
            The key of `from_` in files is `from`.
        file: log from which the run was imported, or several with commas between them.
        origin: latitude and longitude [deg] of x = y = 0.
        other: further entries of the run, by key.

    Raises:
        InputError: an entry has another type, is no accepted value, or holds invisible characters.
    """

    manoeuvre: str | None = None
    group: str | int | None = None
    parent: str | None = None
    split: Literal["train", "test"] | None = None
    from_: str | date | float | None = None
    to: str | date | float | None = None
    file: str | None = None
    origin: Origin | None = None
    other: Mapping[str, Any] = field(default_factory=dict)
    _order: tuple[str, ...] = field(default=(), repr=False, compare=False)
    """Keys in their original order, so that a file is written again as it was."""

    def __post_init__(self) -> None:
        for key, check in _CHECKS.items():
            value = getattr(self, _attribute(key))
            if value is not None:
                object.__setattr__(self, _attribute(key), check(value, key))
        object.__setattr__(self, "other", _other(self.other))
        if not self._order:
            object.__setattr__(self, "_order", tuple(self.as_dict()))

    @classmethod
    def of(cls, known: RunMeta | Mapping[str, Any], where: str) -> RunMeta:
        """Metadata of a flat table, as [runs.<id>] of dataset.toml has it; keys that are no field go into `other`.

        Args:
            known: the table, or metadata that are returned as they are.
            where: beginning of a message, such as "run 'run07'".

        Raises:
            InputError: as the class.
        """
        if isinstance(known, RunMeta):
            return known
        if not isinstance(known, Mapping):
            raise InputError(
                f"{where}: meta = {shown(known)[:80]}; accepted: a dict like {{'manoeuvre': 'turn'}}, or a RunMeta."
            )
        own = {_attribute(key): value for key, value in known.items() if key in _CHECKS}
        other = {key: value for key, value in known.items() if key not in _CHECKS}
        try:
            return cls(**own, other=other, _order=tuple(known))
        except InputError as error:
            raise InputError(f"{where}: {error}") from None

    def in_group(self, group: str) -> RunMeta:
        """Return a copy that belongs to a group; a group that is stated already has priority."""
        return self if self.group is not None else replace(self, group=group)

    def as_dict(self) -> dict[str, Any]:
        """Return the flat table of the stated entries: keys of dataset.toml, those of `other` among them."""
        own = {key: getattr(self, _attribute(key)) for key in _CHECKS}
        if self.origin is not None:
            own["origin"] = self.origin._asdict()
        stated = {key: value for key, value in own.items() if value is not None} | dict(self.other)
        added = [key for key in stated if key in _CHECKS and key not in self._order]
        return {key: stated[key] for key in (*added, *self._order, *stated) if key in stated}


def _attribute(key: str) -> str:
    """Name of the field of a key: `from` is a word of Python."""
    return "from_" if key == "from" else key


def _group(value: object, key: str) -> str | int:
    return int(value) if isinstance(value, Integral) and not isinstance(value, bool) else check_run(value, key)


def _split(value: object, key: str) -> object:
    if value in SPLITS:
        return value
    raise InputError(
        f"{key} = {shown(repr(value))[:80]}; accepted: 'train' or 'test'. Leave it out for a run that is in neither."
    )


def _time(value: object, key: str) -> object:
    if isinstance(value, date):  # a datetime is one
        return value
    if isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value):
        return int(value) if isinstance(value, Integral) else float(value)
    try:
        datetime.fromisoformat(check_label(value, key))
    except (InputError, ValueError):
        raise InputError(
            f"{key} = {shown(repr(value))[:80]}; accepted: an ISO 8601 date and time such as '2026-05-04T10:30:00Z', "
            "or the seconds of the log."
        ) from None
    return value


def _file(value: object, key: str) -> str:
    return check_label(value, key, _FILES)


def _origin(value: object, key: str) -> Origin:
    given = value._asdict() if isinstance(value, Origin) else value
    if isinstance(given, Mapping) and set(given) == {"lat", "lon"}:
        lat, lon = given["lat"], given["lon"]
        if all(isinstance(x, Real) and not isinstance(x, bool) for x in (lat, lon)) and (
            abs(lat) <= 90.0 and abs(lon) <= 360.0
        ):
            return Origin(lat, lon)
    raise InputError(
        f"{key} = {shown(given)[:80]}; accepted: lat from -90 to 90 and lon from -360 to 360, both in degrees, such as "
        "{lat = 53.5, lon = 8.6}."
    )


def _other(value: Mapping[str, Any]) -> dict[str, Any]:
    """Copy, so that nobody writes into the caller's; each key is a label and no field."""
    if not isinstance(value, Mapping):
        raise InputError(f"other = {shown(value)[:80]}; accepted: a table of what else is known of the run.")
    for key in value:
        check_label(key, "key of meta")
        if key in _CHECKS:
            raise InputError(f"other holds '{key}', which is a field; accepted: other keys. Give {_attribute(key)}=.")
    return dict(value)


_CHECKS = {
    "manoeuvre": check_run, "group": _group, "parent": check_run, "split": _split, "from": _time, "to": _time,
    "file": _file, "origin": _origin,
}  # fmt: skip
"""Check of each key of the settled ones, in the order of the fields."""
