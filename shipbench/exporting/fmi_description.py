"""Descriptions of an FMU: modelDescription.xml of FMI 2.0 and 3.0, buildDescription.xml of FMI 3.0."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from importlib.metadata import version
from xml.etree import ElementTree as ET

from .language import identifier
from .step import STATE_CHANNELS, Channel, Step

_UNITS: dict[str, dict[str, str]] = {
    "m": {"m": "1"}, "rad": {"rad": "1"}, "m/s": {"m": "1", "s": "-1"}, "rad/s": {"rad": "1", "s": "-1"},
    "rpm": {"rad": "1", "s": "-1", "factor": repr(math.pi / 30.0)}, "N": {"kg": "1", "m": "1", "s": "-2"}, "1": {},
}  # fmt: skip
"""Units by powers of base units."""
_STOP = 60
"""Steps of the default experiment."""


@dataclass(frozen=True)
class Variable:
    """Variable of an FMU: its value reference, causality, and start value (None: it is calculated)."""

    name: str
    reference: int
    causality: str
    unit: str
    meaning: str
    start: float | None


def variables(step: Step) -> Iterator[Variable]:
    """Inputs, states and start values of the states, in the order of `co_simulation.h`."""
    first, names = step.reference, _names(step.inputs)
    reference = 1
    for name, channel, value in zip(names, step.inputs, first.U[0], strict=True):
        yield Variable(name, reference, "input", channel.unit, channel.meaning, float(value))
        reference += 1
    for channel in STATE_CHANNELS:
        yield Variable(channel.name, reference, "output", channel.unit, channel.meaning, None)
        reference += 1
    for channel, value in zip(STATE_CHANNELS, first.s0, strict=True):
        meaning = f"{channel.meaning}, at the start"
        yield Variable(f"{channel.name}_start", reference, "parameter", channel.unit, meaning, float(value))
        reference += 1


def _names(inputs: Sequence[Channel]) -> list[str]:
    """Legal names of the inputs, each of its own."""
    taken = {c.name for c in STATE_CHANNELS} | {f"{c.name}_start" for c in STATE_CHANNELS} | {"time"}
    names: list[str] = []
    for channel in inputs:
        name = wanted = channel.name if identifier(channel.name) == channel.name else identifier(channel.name)
        number = 2
        while name in taken:
            name, number = f"{wanted}_{number}", number + 1
        taken.add(name)
        names.append(name)
    return names


def model_description(step: Step, name: str, token: str, fmi: int) -> bytes:
    """Text of modelDescription.xml."""
    steps = (
        f"Any communication step; the model steps {step.model.dt!r} s, and a rest of it."
        if step.any_step
        else f"Communication steps that are multiples of {step.model.dt!r} s."
    )
    description = f"Motion of the ship {_text(step.model.ship.name)}: {step.model.name}. {steps}"
    return (_two if fmi == 2 else _three)(step, name, token, description)


def _head(name: str, description: str) -> dict[str, str]:
    return {
        "modelName": name,
        "description": description,
        "generationTool": f"shipbench {version('shipbench')}",
        "variableNamingConvention": "flat",
    }


def _two(step: Step, name: str, token: str, description: str) -> bytes:
    root = ET.Element("fmiModelDescription", {"fmiVersion": "2.0", "guid": token, **_head(name, description)})
    simulation = ET.SubElement(
        root, "CoSimulation", {
            "modelIdentifier": name, "canHandleVariableCommunicationStepSize": str(step.any_step).lower(),
            "canNotUseMemoryManagementFunctions": "true", "canGetAndSetFMUstate": "true",
            "canSerializeFMUstate": "true",
        },
    )  # fmt: skip
    sources = ET.SubElement(simulation, "SourceFiles")
    for file in ("model.c", "fmi2.c"):
        ET.SubElement(sources, "File", {"name": file})
    found = list(variables(step))
    _units(root, found)
    _experiment(root, step)
    held = ET.SubElement(root, "ModelVariables")
    for v in found:
        start = {} if v.start is None else {"start": repr(v.start)}
        one = ET.SubElement(
            held, "ScalarVariable", {
                "name": v.name, "valueReference": str(v.reference), "description": v.meaning,
                "causality": v.causality, **_variability(v),
            },
        )  # fmt: skip
        ET.SubElement(one, "Real", {"unit": v.unit, **start})
    structure = ET.SubElement(root, "ModelStructure")
    for group in ("Outputs", "InitialUnknowns"):
        listed = ET.SubElement(structure, group)
        for index, v in enumerate(found, 1):
            if v.causality == "output":
                ET.SubElement(listed, "Unknown", {"index": str(index)})
    return _written(root)


def _three(step: Step, name: str, token: str, description: str) -> bytes:
    root = ET.Element(
        "fmiModelDescription", {"fmiVersion": "3.0", "instantiationToken": token, **_head(name, description)}
    )
    ET.SubElement(
        root, "CoSimulation", {
            "modelIdentifier": name, "canGetAndSetFMUState": "true", "canSerializeFMUState": "true",
            "canHandleVariableCommunicationStepSize": str(step.any_step).lower(),
            "fixedInternalStepSize": repr(step.model.dt),
        },
    )  # fmt: skip
    found = list(variables(step))
    _units(root, found)
    _experiment(root, step)
    held = ET.SubElement(root, "ModelVariables")
    time = {"name": "time", "valueReference": "0", "causality": "independent", "variability": "continuous"}
    ET.SubElement(held, "Float64", {**time, "description": "time [s]"})
    for v in found:
        start = {} if v.start is None else {"start": repr(v.start)}
        ET.SubElement(
            held, "Float64", {
                "name": v.name, "valueReference": str(v.reference), "description": v.meaning,
                "causality": v.causality, **_variability(v), "unit": v.unit, **start,
            },
        )  # fmt: skip
    structure = ET.SubElement(root, "ModelStructure")
    for kind in ("Output", "InitialUnknown"):
        for v in found:
            if v.causality == "output":
                ET.SubElement(structure, kind, {"valueReference": str(v.reference)})
    return _written(root)


def build_description(name: str, sources: Sequence[str]) -> bytes:
    """Text of buildDescription.xml: how the sources are compiled elsewhere."""
    root = ET.Element("fmiBuildDescription", {"fmiVersion": "3.0"})
    built = ET.SubElement(root, "BuildConfiguration", {"modelIdentifier": name})
    group = ET.SubElement(built, "SourceFileSet", {"language": "C99"})
    for file in sources:
        ET.SubElement(group, "SourceFile", {"name": file})
    return _written(root)


def _variability(v: Variable) -> dict[str, str]:
    if v.causality == "parameter":
        return {"variability": "fixed", "initial": "exact"}
    return {"variability": "continuous"} | ({"initial": "calculated"} if v.causality == "output" else {})


def _units(root: ET.Element, found: Sequence[Variable]) -> None:
    held = ET.SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(v.unit for v in found):
        ET.SubElement(ET.SubElement(held, "Unit", {"name": unit}), "BaseUnit", _UNITS[unit])


def _experiment(root: ET.Element, step: Step) -> None:
    dt = step.model.dt
    ET.SubElement(root, "DefaultExperiment", {"startTime": "0.0", "stopTime": repr(_STOP * dt), "stepSize": repr(dt)})


def _text(words: str) -> str:
    """Text of a user without characters that XML has not."""
    return "".join(c if c.isprintable() else " " for c in words)


def _written(root: ET.Element) -> bytes:
    ET.indent(root)
    return ET.tostring(root, encoding="UTF-8", xml_declaration=True) + b"\n"
