"""Unit of each channel: from its head or the row of units, else from the size of its numbers."""

from __future__ import annotations

import re

import numpy as np

from ..entries import unit_of
from ..thresholds import THRESHOLDS
from .assign import Assigned, Entry, quantity, sign_of
from .columns import Column

ACCEPTED = {
    "m": "m, km, ft, nmi", "m/s": "m/s, kn, km/h, ft/s", "rad": "rad, deg, cdeg", "rad/s": "rad/s, deg/s, deg/min",
    "rpm": "rpm, rev/s, rad/s",
    "N": "N, kN, MN, tf",
}  # fmt: skip


def set_units(found: Assigned) -> None:
    """Write unit, sign and further keys of a unit into the entries that have none."""
    for channel in ("lat", "lon"):
        if channel in found.entries and "unit" not in found.entries[channel].spec:
            _of_position(found.entries[channel], found)
    _same_position_unit(found)
    for entry in found.entries.values():
        if "unit" not in entry.spec and "quaternion" not in entry.spec and "atan2" not in entry.spec:
            _set_unit(entry, found)
        if "as given" not in entry.why:
            sign_of(entry)
    found.entries = {entry.channel: entry for entry in found.entries.values()}


def _set_unit(entry: Entry, found: Assigned) -> None:
    column = entry.columns[0]
    named = column.head.units.get(quantity(entry.channel))
    kind = quantity(entry.channel)
    if "percent" in column.head.units or named == "pwm" or (kind == "shaft" and "pwm" in column.head.base):
        _of_full(entry, "%" if "percent" in column.head.units else "pwm", found)
        return
    if named is not None:
        entry.spec["unit"] = named
        entry.why.append(f"unit from the head, [{column.head.unit}]")
        return
    unit, sure = _by_size(entry.channel, column)
    entry.spec["unit"] = unit
    entry.why.append(f"unit {'from the values' if sure else 'NOT SURE'} (accepted {ACCEPTED[unit_of(entry.channel)]})")
    if not sure:
        found.notes.append(
            f"NOT SURE: the head of '{column.name}' names no unit; {entry.channel} is taken in {unit} "
            f"({column.evidence()})."
        )


def _of_full(entry: Entry, unit: str, found: Assigned) -> None:
    """Set a percentage or the pulse width of a motor controller: the value at 100 % is not in the log."""
    name = entry.columns[0].name
    entry.spec["unit"] = unit
    if entry.channel.removesuffix("_c") == "delta":
        entry.spec |= {"full": 35.0, "full_unit": "deg"}
        entry.why.append("NOT SURE: 100 % is taken as 35 deg")
        found.notes.append(
            f"NOT SURE: '{name}' is in {unit} of the full rudder angle, which the log does not say; 35 deg is "
            "taken. Correct `full`."
        )
        return
    at = "100 %" if unit == "%" else "2000 us (1500 us is neutral)"
    entry.spec |= {"full": None, "full_unit": unit_of(entry.channel)}
    entry.missing = f"the value of {entry.channel} at {at}; write it as `full`"
    if unit == "pwm" and entry.channel == "n":
        entry.channel = "n_c"
        entry.why.append("a pulse width is a command")


def _by_size(channel: str, column: Column) -> tuple[str, bool]:
    """Unit from the size of the numbers, and whether it is sure."""
    known = column.known
    size = float(np.max(np.abs(known))) if len(known) else 0.0
    whole = bool(len(known)) and bool((known == np.round(known)).all())
    ours = unit_of(channel)
    if ours == "rad":
        rudder, heading = THRESHOLDS.value("largest_rudder"), THRESHOLDS.value("heading_in_radians")
        limit = rudder if channel in ("delta", "delta_c") else heading
        if size > THRESHOLDS.value("angle_in_degrees") and whole:
            return "cdeg", True
        return ("deg" if size > limit else "rad"), size > limit
    if ours == "rad/s":
        deg, rad = THRESHOLDS.value("yaw_rate_in_degrees"), THRESHOLDS.value("yaw_rate_in_radians")
        return ("deg/min" if size > deg else "deg/s" if size > rad else "rad/s"), False
    if ours == "rpm":
        return "rpm", "rpm" in column.head.base or size > THRESHOLDS.value("shaft_in_revolutions")
    return {"sog": "kn"}.get(channel, ours), ours == "m" and channel in ("x", "y", "depth")


def _of_position(entry: Entry, found: Assigned) -> None:
    """Set the unit of a latitude or longitude, with the column or the letters of its hemisphere."""
    column, limit = entry.columns[0], 90.0 if entry.channel == "lat" else 180.0
    named, cells = column.head.units.get("angle"), column.texts()
    lettered = [t for t in cells if re.search(r"[NSEWOnsewo]\s*$|^\s*[NSEWO]", t)]
    size = float(np.max(np.abs(column.known))) if len(column.known) else 0.0
    side = found.candidates.get(f"{entry.channel} side")
    if side is not None:
        entry.spec["hemisphere"] = side.name
        entry.why.append(f"hemisphere from '{side.name}'")
        found.helpers.add(side.name)
    digits = [re.sub(r"[^\d.].*$", "", t.strip(" +-NSEWO")) for t in cells[:200]]
    padded = (
        bool(digits) and all(re.fullmatch(r"\d{4,5}(\.\d+)?", d) for d in digits) and any(d[0] == "0" for d in digits)
    )
    numbers = np.array([float(d) for d in digits if re.fullmatch(r"\d+(\.\d+)?", d)])
    size = max(size, float(numbers.max()) if len(numbers) else 0.0)
    minutes = len(numbers) > 0 and bool((np.mod(numbers, 100.0) < 60.0).all())
    if size <= limit and named is not None and not padded:
        entry.spec["unit"] = named
        entry.why.append(f"unit from the head, [{column.head.unit}]")
    elif size > THRESHOLDS.value("counted_position") and not lettered:
        entry.spec["unit"] = "1e-7 deg"
        entry.why.append("whole numbers of 1e-7 deg, from their size")
    elif padded or (size > (limit if entry.channel == "lat" else 360.0) and size < 18_000 and minutes):
        entry.spec["unit"] = "ddmm.mmmmN" if lettered else "ddmm.mmmm"
        entry.why.append(f"degrees and minutes in one number: {cells[0]}")
    else:
        entry.spec["unit"] = named or "deg"
        entry.why.append(
            f"unit from the head, [{column.head.unit}]"
            if named
            else f"unit as usual for {entry.channel} (accepted deg, rad, 1e-7 deg, ddmm.mmmm)"
        )


def _same_position_unit(found: Assigned) -> None:
    """Give a longitude the unit of its latitude: near Greenwich it is small in any unit."""
    pair = [found.entries[c] for c in ("lat", "lon") if c in found.entries]
    if len(pair) == 2 and all("as given" not in e.why for e in pair) and not any(e.columns[0].head.units for e in pair):
        units = [e.spec["unit"] for e in pair]
        odd = [u for u in units if u != "deg"]
        for entry in pair if odd else []:
            if entry.spec["unit"] == "deg":
                entry.spec["unit"] = odd[0]
                entry.why.append(f"unit as the other coordinate, {odd[0]}")
