"""Mapping between an FMU's variables and ours: names, units, signs, start values, constants and bounds."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, BeforeValidator, ConfigDict, ValidationError

from ...errors import InputError, unknown_name, unknown_parameter
from ...signals import COMMANDS, ENVIRONMENT, STATES, UNITS
from ...toml_files import Number, fault, read_toml
from ...units import sign_factor, unit_factor
from .description import Description, Variable

INPUT_CHANNELS = (*COMMANDS, *ENVIRONMENT)
SPEEDS = ("u", "v", "r")
_START_NAMES = ("{}", "{}_start", "{}0", "{}_0", "{}_init", "start_{}", "init_{}")
_Exponents = tuple[tuple[str, int], ...]
_TURN: dict[_Exponents, float] = {(("s", -1), ("rad", 1)): 60.0 / (2.0 * math.pi), (("s", -1),): 60.0}
_SI: dict[str, dict[_Exponents, float]] = {
    "m": {(("m", 1),): 1.0},
    "rad": {(("rad", 1),): 1.0, (): 1.0},
    "m/s": {(("m", 1), ("s", -1)): 1.0},
    "rad/s": {(("s", -1), ("rad", 1)): 1.0, (("s", -1),): 1.0},
    "rpm": _TURN,
    "N": {(("kg", 1), ("m", 1), ("s", -2)): 1.0},
}
"""Factor from SI to our unit, by the exponents of the base units; 1/s of a shaft is rev/s."""
_ALIASES = {"1": "rad", "°": "deg", "degree": "deg", "deg.": "deg", "1/min": "rpm", "r/min": "rpm", "rev/min": "rpm",
            "1/s": "rev/s", "Hz": "rev/s", "m.s-1": "m/s", "rad.s-1": "rad/s", "knot": "kn"}  # fmt: skip


class _Entry(BaseModel):
    """Variable of the FMU for a channel: standard value = sign x unit x (variable + offset)."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    variable: str
    unit: str | None = None
    sign: str | None = None
    offset: Number = 0.0


def _named(value: Any) -> Any:
    return {"variable": value} if isinstance(value, str) else value


_Channel = Annotated[_Entry, BeforeValidator(_named)]


class _File(BaseModel):
    """Content of the mapping's file."""

    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
    inputs: dict[str, _Channel] = {}
    outputs: dict[str, _Channel | Number] = {}
    start: dict[str, _Channel] = {}
    constants: dict[str, Number] = {}
    bounds: dict[str, tuple[Number, Number]] = {}


@dataclass(frozen=True)
class Link:
    """Channel of ours and the variable that stands for it: ours = factor x theirs + offset."""

    channel: str
    variable: Variable
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Mapping:
    """Mapping of one FMU. `fixed` are outputs with a constant value, `constants` start values that are set."""

    inputs: tuple[Link, ...]
    outputs: tuple[Link, ...]
    start: tuple[Link, ...]
    fixed: dict[str, float] = field(default_factory=dict)
    constants: tuple[tuple[Variable, float], ...] = ()
    bounds: dict[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def own_start(self) -> tuple[str, ...]:
        """Speeds whose start value cannot be set: the FMU begins with its own."""
        return tuple(s for s in SPEEDS if s not in {link.channel for link in self.start} and s not in self.fixed)

    def lacking(self, inputs: tuple[str, ...]) -> list[str]:
        """Input channels that the FMU takes and `inputs` has not."""
        return [link.channel for link in self.inputs if link.channel not in inputs]


def mapping_of(description: Description, given: str = "") -> Mapping:
    """Mapping of an FMU: from the file `given`, else from NAME.fmu.toml beside it, else from equal names.

    Raises:
        InputError: the file cannot be read, names a channel, variable, unit or sign that is not there, or an input of
            the FMU stays without a value.
    """
    beside = description.path.with_name(f"{description.path.name}.toml")
    if given or beside.is_file():
        source = Path(given) if given else beside
        return _resolved(description, _read(source), str(source))
    return _resolved(description, _equal_names(description), str(description.path))


def _read(path: Path) -> _File:
    try:
        return _File.model_validate(read_toml(path))
    except ValidationError as error:
        place, kind, message = fault(error)
        if kind == "extra_forbidden":
            keys = _File.model_fields if len(place) == 1 else _Entry.model_fields
            raise unknown_parameter(f"{path}: {'.'.join(place[:-1]) or 'the mapping'}", place[-1], keys) from None
        raise InputError(
            f'{path}: {".".join(place)}: {message}. Accepted: a variable such as u = "hull.u", or '
            'u = { variable = "hull.u", unit = "kn" }.'
        ) from None


def _equal_names(description: Description) -> _File:
    """Mapping by names that are ours."""
    names = description.variables
    start = {}
    for state in STATES:
        found = (form.format(state) for form in _START_NAMES)
        if (name := next((n for n in found if n in names and _is_start(names[n])), None)) is not None:
            start[state] = _Entry(variable=name)
    return _File(
        inputs={v.name: _Entry(variable=v.name) for v in description.of("input") if v.name in INPUT_CHANNELS},
        outputs={s: _Entry(variable=s) for s in STATES if s in names and names[s].causality in ("output", "local")},
        start=start,
    )


def _is_start(variable: Variable) -> bool:
    return variable.settable and variable.causality != "input"


def draft_command(path: Path) -> str:
    """Command that writes a draft of the mapping."""
    return f"shipbench models {path} --propose {path}.toml"


def _resolved(description: Description, file: _File, source: str) -> Mapping:
    inputs = tuple(_link(description, c, e, source, "inputs", INPUT_CHANNELS) for c, e in file.inputs.items())
    named = {c: e for c, e in file.outputs.items() if isinstance(e, _Entry)}
    outputs = tuple(_link(description, c, e, source, "outputs", STATES) for c, e in named.items())
    start = tuple(_link(description, c, e, source, "start", STATES) for c, e in file.start.items())
    fixed = {c: float(e) for c, e in file.outputs.items() if not isinstance(e, _Entry)}
    constants = tuple((_variable(description, n, source, "constants"), v) for n, v in file.constants.items())
    for name, (low, high) in file.bounds.items():
        _variable(description, name, source, "bounds")
        if not low < high:
            raise InputError(f"{source}: [bounds] {name} = [{low:g}, {high:g}]; accepted: [lower, higher].")
    for variable in (*(link.variable for link in start), *(v for v, _ in constants)):
        if not variable.settable:
            raise InputError(
                f"{source}: '{variable.name}' cannot be set before the simulation (it is calculated); accepted: a "
                f'parameter, an input, or a variable with initial="exact". See: shipbench models {description.path}'
            )
    _check_complete(description, inputs, {*named, *fixed}, {v.name for v, _ in constants}, source)
    return Mapping(inputs, outputs, start, fixed, constants, dict(file.bounds))


def _check_complete(
    description: Description, inputs: tuple[Link, ...], outputs: set[str], constants: set[str], source: str
) -> None:
    """Refuse an input without a value, and motion that does not follow from the outputs."""
    told = f"Write a draft and correct it: {draft_command(description.path)}"
    known = {link.variable.name for link in inputs} | constants
    if free := [v.name for v in description.of("input") if v.name not in known]:
        raise InputError(
            f"{source}: the FMU's input '{free[0]}' has no channel{_more(free)}. Accepted: an entry in [inputs], or a "
            f"value in [constants]. {told}"
        )
    if not {"n_c", "delta_c"} & {link.channel for link in inputs}:
        raise InputError(f"{source}: the FMU has no input for n_c or delta_c; one of them is needed. {told}")
    if lacking := [s for s in SPEEDS if s not in outputs]:
        raise InputError(
            f"{source}: the FMU has no output for {', '.join(lacking)}; needed: {', '.join(SPEEDS)}, each a variable "
            f"or a number. {told}"
        )
    if len({"x", "y"} & outputs) == 1:
        raise InputError(f"{source}: x and y serve only together; map both outputs, or none of them. {told}")


def _more(names: list[str]) -> str:
    return f" (and {len(names) - 1} more: {', '.join(names[1:5])})" if len(names) > 1 else ""


def _variable(description: Description, name: str, source: str, table: str) -> Variable:
    if name not in description.variables:
        if name in description.others:
            raise InputError(f"{source}: [{table}] '{name}' is no real scalar, which alone can be mapped.")
        raise unknown_name(f"variable in [{table}] of {source}:", name, list(description.variables)[:60])
    return description.variables[name]


def _link(
    description: Description, channel: str, entry: _Entry, source: str, table: str, channels: tuple[str, ...]
) -> Link:
    if channel not in channels:
        raise unknown_name(f"channel in [{table}] of {source}:", channel, channels)
    variable = _variable(description, entry.variable, source, table)
    if table == "inputs" and variable.causality != "input":
        raise InputError(
            f"{source}: [inputs] {channel} = '{variable.name}' is of the causality {variable.causality}; accepted: "
            f"{', '.join(v.name for v in description.of('input')[:20]) or 'none: the FMU has no inputs'}."
        )
    factor, shift = conversion(description, variable, channel, source, entry.unit)
    sign = 1.0 if entry.sign is None else sign_factor(channel, entry.sign)
    return Link(channel, variable, sign * factor, sign * (factor * entry.offset + shift))


def conversion(
    description: Description, variable: Variable, channel: str, source: str, given: str | None = None
) -> tuple[float, float]:
    """Factor and offset from the unit of a variable to the standard unit of `channel`.

    The unit is `given`, else the one of the model description with its base units, else the name of that unit; a
    variable without any unit is in the standard one.

    Raises:
        InputError: the unit is of another quantity, or not known.
    """
    if given is not None:
        return unit_factor(channel, _ALIASES.get(given, given)), 0.0
    name, ours = variable.unit, UNITS[channel]
    if not name:
        return 1.0, 0.0
    if (unit := description.units.get(name)) is not None:
        factors = _SI[ours]
        if unit.exponents not in factors:
            raise InputError(
                f"{source}: {channel} [{ours}] is mapped to '{variable.name}' [{name}], which is of another quantity. "
                "Map another variable, or state its unit: unit = ..."
            )
        return factors[unit.exponents] * unit.factor, factors[unit.exponents] * unit.offset
    return unit_factor(channel, _ALIASES.get(name, name)), 0.0


def open_parameters(
    description: Description, mapping: Mapping, names: Iterable[str]
) -> tuple[tuple[Variable, float, float, float], ...]:
    """Parameters to calibrate as (variable, value, low, high).

    Bounds are those of the mapping, else those of the model description, else 0 and three times the value.

    Raises:
        InputError: an unknown name, a variable that cannot be set, or no bounds and a value of 0.
    """
    settable = [v.name for v in description.of("parameter")]
    constants = {v.name: value for v, value in mapping.constants}
    found = []
    for name in dict.fromkeys(names):
        if name not in description.variables or not description.variables[name].settable:
            raise unknown_name(f"parameter in fit of {description.path}:", str(name), settable)
        variable = description.variables[name]
        value = constants.get(name, variable.start)
        low, high = mapping.bounds.get(name, (variable.low, variable.high))
        wide = sorted((0.0, 3.0 * value)) if math.isfinite(value) and value else [math.nan, math.nan]
        low, high = (b if math.isfinite(b) else w for b, w in zip((low, high), wide, strict=True))
        if not (math.isfinite(low) and math.isfinite(high) and low < high):
            raise InputError(
                f"the open parameter '{name}' of {description.path} has the bounds {low:g} to {high:g}; accepted: a "
                f"lower and a higher number. Write them in its mapping: [bounds] {name} = [0.0, 1.0]"
            )
        inside = 0.5 * (low + high) if not math.isfinite(value) else min(max(value, low), high)
        found.append((variable, inside, low, high))
    return tuple(found)
