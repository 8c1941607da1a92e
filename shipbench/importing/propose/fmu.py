"""Draft of an FMU's mapping: its variables by their names, descriptions and units, and which of them can be set."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from pathlib import Path

from ...errors import InputError, option
from ...predictors.fmu_model.description import Description, Variable, read_description
from ...predictors.fmu_model.mapping import INPUT_CHANNELS, SPEEDS, conversion, mapping_of
from ...regular_files import check_output
from ...signals import STATES, UNITS
from ...storage import write_text
from .assign import counts_to_port
from .heads import QUANTITIES, read_head, units_of
from .text import one_line, value

_START = re.compile(r"(?i)^(?:start|init|initial)[_.]?|[_.]?(?:start|init|initial|0)$")
"""Words by which a parameter is the start value of a state."""
_BY_UNIT = {"shaft": "n", "angle": "delta"}
"""Actuator that a variable without a telling name may be, by the quantity of its unit."""
_HEAD = """# Draft by `shipbench models {path} --propose`. Every entry is a GUESS from names and units: check each one.
# Signs: psi clockwise from north, r bow to starboard, v to starboard; a positive rudder angle turns the ship to
# starboard. Where the FMU counts the other way: sign = "port" (r, v, delta, thrusters), "counterclockwise" (psi),
# "west", "south", "astern". Another unit than the model description's: unit = "kn".
"""


def write_fmu_proposal(fmu: Path, path: Path, force: bool = False) -> list[str]:
    """Write a draft mapping of an FMU to `path`; return lines on what is missing, and last the next command.

    Raises:
        InputError: the FMU cannot be read, or `path` is there already and `force` is not set, or is the FMU.
    """
    if path.exists() and not force:
        raise InputError(
            f"{path} is there already. Give another name with {option('--propose', 'path')}, or "
            f"{option('--force', 'force=True')} to replace it."
        )
    check_output(path, [fmu], option("--propose", "path"))
    description = read_description(fmu)
    text, remarks = draft(description)
    try:
        write_text(path, text)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}. Give another name with --propose.") from None
    try:
        mapping_of(description, str(path))
    except InputError as error:
        remarks.append(f"To complete: {error}")
    own = path.resolve() == fmu.with_name(f"{fmu.name}.toml").resolve()
    return [*remarks, f"shipbench check {fmu}" if own else f"shipbench check '{fmu}[mapping={path}]'"]


def draft(description: Description) -> tuple[str, list[str]]:
    """Text of a draft mapping, and remarks on what is missing."""
    inputs = _assigned(description.of("input"), INPUT_CHANNELS, command=True)
    outputs = _assigned(description.of("output") or description.of("local"), STATES)
    start = _starts(description, outputs)
    remarks = [f"MISSING: no output for {s}" for s in SPEEDS if s not in outputs]
    remarks += [] if {"n_c", "delta_c"} & inputs.keys() else ["MISSING: no input for n_c or delta_c"]
    remarks += [f"The start value of {s} cannot be set." for s in SPEEDS if s in outputs and s not in start]
    lines = [_HEAD.format(path=description.path.name)]
    for table, found in (("inputs", inputs), ("outputs", outputs), ("start", start)):
        lines += [f"[{table}]", *(_entry(description, channel, *how) for channel, how in found.items())]
        if table == "outputs":
            lines += [f'# {s} = "?"  # MISSING: a variable, or a number' for s in SPEEDS if s not in outputs]
        lines.append("")
    used = {v.name for v, _ in inputs.values()}
    left = [v for v in description.of("input") if v.name not in used]
    lines += [
        "[constants]",
        *(f"{_key(v)} = {_number(v)}  # GUESS: an input without a channel{_words(v)}" for v in left),
    ]
    lines += [
        "",
        "[bounds]",
        "# Bounds of open parameters, as in 'ship.fmu[fit=[Xuu]]', where others shall hold:",
    ]
    taken = {v.name for v, _ in start.values()}
    lines += [
        f"# {_key(v)} = [{_bound(v.low)}, {_bound(v.high)}]  # value {_number(v)}{_words(v)}"
        for v in description.of("parameter") if v.name not in taken
    ]  # fmt: skip
    return "\n".join(lines) + "\n", remarks


_Found = dict[str, tuple[Variable, str]]
"""Variable and reason of each channel."""


def _assigned(variables: Iterable[Variable], channels: tuple[str, ...], command: bool = False) -> _Found:
    """Variables of the channels: by name, else by description, else (actuators) by the unit of the only one left."""
    found: _Found = {}
    named = [(v, _channel(v.name, command), "by its name") for v in variables]
    for v, channel, why in [
        *named,
        *((v, _channel(v.description, command), "by its description") for v, _, _ in named),
    ]:
        taken = {other.name for other, _ in found.values()}
        if channel in channels and channel not in found and v.name not in taken:
            found[channel] = v, why
    for quantity, actuator in _BY_UNIT.items():
        channel = f"{actuator}_c" if command else actuator
        taken = {other.name for other, _ in found.values()}
        left = [v for v, _, _ in named if v.name not in taken and quantity in units_of(v.unit)]
        if channel not in found and len(left) == 1:
            found[channel] = left[0], "by its unit"
    return {c: found[c] for c in channels if c in found}


def _channel(text: str, command: bool) -> str | None:
    """Channel that a text names; of an input the command."""
    if text in STATES or text in INPUT_CHANNELS:
        channel: str | None = text
    else:
        channel = read_head(text[:200]).channel
    return f"{channel}_c" if command and f"{channel}_c" in INPUT_CHANNELS else channel


def _starts(description: Description, outputs: _Found) -> _Found:
    """Variables that set the start of the states: the state itself, or a parameter that is named after it."""
    found: _Found = {c: (v, "can be set before the simulation") for c, (v, _) in outputs.items() if v.settable}
    by_name = {v.name: c for c, (v, _) in outputs.items()}
    for v in description.of("parameter"):
        stem = _START.sub("", v.name)
        if stem != v.name:
            channel = by_name.get(stem) or _channel(stem, command=False)
            if channel in STATES and channel not in found:
                found[channel] = v, "by its name"
    return {c: found[c] for c in STATES if c in found}


def _entry(description: Description, channel: str, variable: Variable, why: str) -> str:
    """Line of a channel: the unit stands in it where the model description does not settle it."""
    spec: dict[str, str] = {"variable": variable.name}
    note = f"[{variable.unit}] in the model description" if variable.unit else "no unit in the model description"
    try:
        conversion(description, variable, channel, str(description.path))
        if not variable.unit:
            ours = UNITS[channel]
            named = read_head(variable.name).units.get(QUANTITIES[ours])
            spec["unit"], note = (named, f"{note}, [{named}] by its name") if named else (ours, note)
    except InputError:
        spec["unit"], note = "?", f"MISSING: its unit [{variable.unit}] is not one of {channel} [{UNITS[channel]}]"
    if counts_to_port(channel, f"{variable.name} {variable.description}"):
        spec["sign"] = "port"
    return f"{channel} = {value(spec)}  # GUESS: {why}; {one_line(note)}{_words(variable)}"


def _key(variable: Variable) -> str:
    return variable.name if re.fullmatch(r"[\w-]+", variable.name, re.ASCII) else value(variable.name)


def _bound(number: float) -> str:
    return "?" if math.isnan(number) else f"{number:g}"


def _number(variable: Variable) -> str:
    return value(0.0 if math.isnan(variable.start) else variable.start)


def _words(variable: Variable) -> str:
    return f"; {one_line(variable.description[:120])}" if variable.description else ""
