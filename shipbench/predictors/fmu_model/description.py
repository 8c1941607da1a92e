"""Description of an FMU, read from its modelDescription.xml (FMI 2.0 and 3.0), without loading its code.

Source: Functional Mock-up Interface Specification 2.0.4 and 3.0.1, section "FMI description schema".
"""

from __future__ import annotations

import math
import re
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from pathlib import Path

from ...errors import InputError
from . import archive

CO_SIMULATION, MODEL_EXCHANGE = "co-simulation", "model-exchange"
_KINDS = {"CoSimulation": CO_SIMULATION, "ModelExchange": MODEL_EXCHANGE}
_BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
_REALS = {"Real", "Float64"}
_MOST_VARIABLES = 200_000


@dataclass(frozen=True)
class Unit:
    """Unit of a model description: SI value = factor x value + offset, with the exponents of its base units."""

    factor: float
    offset: float
    exponents: tuple[tuple[str, int], ...]


@dataclass(frozen=True)
class Variable:
    """Real variable of an FMU; `start`, `low` and `high` are NaN where the description has none."""

    name: str
    reference: int
    causality: str
    initial: str
    unit: str
    start: float
    low: float
    high: float
    description: str

    @property
    def settable(self) -> bool:
        """Whether a start value can be set before the initialisation."""
        return self.causality in ("parameter", "input") or self.initial in ("exact", "approx")


@dataclass(frozen=True)
class Description:
    """Description of an FMU.

    Args:
        version: 2 or 3, of FMI.
        token: GUID or instantiation token.
        identifiers: name of the library for each kind, "co-simulation" and "model-exchange".
        variables: real variables by name, scalars only.
        others: names of the other inputs (integers, texts, arrays), which keep their start value.
        units: units by name.
        step: step size of the default experiment [s], or NaN.
        states, events: counts of continuous states and of event indicators.
        completes: whether model exchange needs `CompletedIntegratorStep`.
        platforms: those for which a library is there.
        sources: whether C source is there.
    """

    path: Path
    name: str
    version: int
    token: str
    identifiers: dict[str, str]
    variables: dict[str, Variable]
    others: tuple[str, ...] = ()
    units: dict[str, Unit] = field(default_factory=dict)
    step: float = math.nan
    states: int = 0
    events: int = 0
    completes: bool = True
    platforms: tuple[str, ...] = ()
    sources: bool = False

    def of(self, *causalities: str) -> list[Variable]:
        """Variables of these causalities, in the order of the file."""
        return [v for v in self.variables.values() if v.causality in causalities]


def read_description(path: Path) -> Description:
    """Read the description of the FMU at `path`.

    Raises:
        InputError: no FMU, a damaged or hostile one, another version of FMI, or neither co-simulation nor model
            exchange.
    """
    with archive.opened(path) as packed:
        if archive.MODEL_DESCRIPTION not in packed.namelist():
            raise InputError(f"{path} is no FMU: it holds no {archive.MODEL_DESCRIPTION}. Export the FMU again.")
        if packed.getinfo(archive.MODEL_DESCRIPTION).file_size > archive.MOST_DESCRIPTION:
            raise InputError(
                f"{path}: {archive.MODEL_DESCRIPTION} has more than {archive.MOST_DESCRIPTION / 1e6:.0f} MB unpacked, "
                "which is not read. Export the FMU with fewer variables."
            )
        content = packed.read(archive.MODEL_DESCRIPTION)
        libraries, sources = archive.libraries(packed), archive.has_sources(packed)
    return _described(path, _root(path, content), tuple(sorted(libraries)), sources)


def _root(path: Path, content: bytes) -> ET.Element:
    """Root of the XML document. A document type is refused: entities can expand without bound or read other files."""
    try:
        text = content.decode("utf-8-sig")
        if "<!DOCTYPE" in text or "<!ENTITY" in text:
            raise InputError(
                f"{path}: {archive.MODEL_DESCRIPTION} holds a document type, which FMI does not use; it is not read. "
                "Export the FMU again."
            )
        return ET.fromstring(text)
    except (ET.ParseError, UnicodeDecodeError, ValueError, RecursionError) as error:
        raise InputError(f"{path}: {archive.MODEL_DESCRIPTION} is not valid: {error}. Export the FMU again.") from None


def _described(path: Path, root: ET.Element, platforms: tuple[str, ...], sources: bool) -> Description:
    said = root.get("fmiVersion", "")
    version = int(said[0]) if re.match(r"[23]\.", said) else 0
    if root.tag != "fmiModelDescription" or not version:
        raise InputError(f"{path} is of FMI version '{said[:20]}'; accepted: 2.0 and 3.0. Export it in one of these.")
    offered = ((kind, root.find(tag)) for tag, kind in _KINDS.items())
    identifiers = {kind: element.get("modelIdentifier", "") for kind, element in offered if element is not None}
    if not identifiers:
        raise InputError(
            f"{path} offers neither co-simulation nor model exchange; accepted: one of them. Export it as such."
        )
    if bad := [i for i in identifiers.values() if not re.fullmatch(r"\w[\w.-]*", i)]:
        raise InputError(f"{path}: the model identifier '{bad[0][:60]}' is no name of a library. Export the FMU again.")
    try:
        types = _types(root, version)
        variables, others = _variables(root, version, types)
        units = _units(root)
        experiment, exchange = root.find("DefaultExperiment"), root.find("ModelExchange")
        step = _number(experiment, "stepSize") if experiment is not None else math.nan
        structure = root.find("ModelStructure")
        states, events = _counts(root, structure, version)
        skips = exchange is not None and (
            exchange.get("completedIntegratorStepNotNeeded") == "true" if version == 2
            else exchange.get("needsCompletedIntegratorStep") == "false"
        )  # fmt: skip
    except ValueError as error:
        raise InputError(f"{path}: {archive.MODEL_DESCRIPTION} is not valid: {error}. Export the FMU again.") from None
    name, token = root.get("modelName", path.stem), root.get("guid" if version == 2 else "instantiationToken", "")
    return Description(
        path,
        name,
        version,
        token,
        identifiers,
        variables,
        others,
        units,
        step,
        states,
        events,
        not skips,
        platforms,
        sources,
    )


def _counts(root: ET.Element, structure: ET.Element | None, version: int) -> tuple[int, int]:
    """Counts of continuous states and event indicators."""
    if structure is None:
        return 0, 0
    if version == 3:
        return len(structure.findall("ContinuousStateDerivative")), len(structure.findall("EventIndicator"))
    derivatives = structure.find("Derivatives")
    return 0 if derivatives is None else len(derivatives), int(root.get("numberOfEventIndicators", "0"))


def _number(element: ET.Element, key: str, fallback: ET.Element | None = None) -> float:
    """Attribute as a number, of the element or of its declared type; NaN where there is none."""
    text = element.get(key) or (None if fallback is None else fallback.get(key))
    if text is None:
        return math.nan
    try:
        return float(text.split()[0] if text.split() else text)
    except ValueError:
        raise ValueError(f"{key} = '{text[:40]}' of '{element.get('name', element.tag)}' is no number") from None


def _types(root: ET.Element, version: int) -> dict[str, ET.Element]:
    """Declared types of reals, by name."""
    holder = root.find("TypeDefinitions")
    if holder is None:
        return {}
    if version == 3:
        return {t.get("name", ""): t for t in holder if t.tag == "Float64Type"}
    return {t.get("name", ""): real for t in holder if (real := t.find("Real")) is not None}


def _variables(
    root: ET.Element, version: int, types: dict[str, ET.Element]
) -> tuple[dict[str, Variable], tuple[str, ...]]:
    """Real scalars by name, and the names of other inputs."""
    holder = root.find("ModelVariables")
    found: dict[str, Variable] = {}
    others: list[str] = []
    if holder is None:
        raise ValueError("it has no ModelVariables")
    if len(holder) > _MOST_VARIABLES:
        raise ValueError(f"it has {len(holder)} variables; accepted: up to {_MOST_VARIABLES}")
    for element in holder:
        real = next((child for child in element if child.tag in _REALS), None) if version == 2 else element
        name, causality = element.get("name", ""), element.get("causality", "local")
        if real is None or (version == 3 and (real.tag not in _REALS or real.find("Dimension") is not None)):
            others += [name] if causality == "input" else []
            continue
        declared = types.get(real.get("declaredType", ""))
        initial = element.get("initial", "exact" if causality == "parameter" else "")
        unit = real.get("unit") or ("" if declared is None else declared.get("unit", ""))
        start, low, high = (_number(real, k, declared if k != "start" else None) for k in ("start", "min", "max"))
        reference = int(element.get("valueReference", ""))
        found[name] = Variable(
            name,
            reference,
            causality,
            initial,
            unit or "",
            start,
            low,
            high,
            " ".join(element.get("description", "").split()),
        )
    return found, tuple(others)


def _units(root: ET.Element) -> dict[str, Unit]:
    """Units that are defined by base units."""
    found = {}
    for element in root.iterfind("UnitDefinitions/Unit"):
        base = element.find("BaseUnit")
        if base is not None:
            factor, offset = _number(base, "factor"), _number(base, "offset")
            exponents = tuple((b, int(base.get(b, "0"))) for b in _BASE if int(base.get(b, "0")))
            found[element.get("name", "")] = Unit(
                1.0 if math.isnan(factor) else factor, 0.0 if math.isnan(offset) else offset, exponents
            )
    return found
