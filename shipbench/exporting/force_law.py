"""JSON: the force law in words and numbers, for readers and programs that write the equations themselves."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, fields, is_dataclass
from pathlib import Path
from typing import Any

from ..physics.actuators import Gear
from ..predictors.physics import PARAMETERS
from ..signals import ACTUATORS, STATES, UNITS
from ..storage import write_json
from .step import STATE_CHANNELS, Channel, Step

_GEAR = {
    "T": ("time constant", "s"), "rate": ("rate limit", "/s"), "delay": ("delay of the command", "s"),
    "deadband": ("deadband of the controller", ""), "backlash": ("play of the transmission", ""),
    "T2": ("time constant of the second lag", "s"),
}  # fmt: skip
"""Fields of `Gear`: meaning, and unit; "/s" and "" stand behind that of the actuator."""


def write(step: Step, name: str, path: Path) -> None:
    """Write the force law to a JSON file."""
    write_json(path, document(step, name))


def document(step: Step, name: str) -> dict[str, Any]:
    """Force law as JSON: ship, states, inputs, parameters with value, unit and meaning, equations, sample time and
    training data."""
    model = step.model
    origin = model.origin
    return {
        "schema": 1,
        "name": name,
        "model": model.name,
        "ship": model.ship.model_dump(exclude_none=True, mode="json"),
        "particulars": model.particulars.model_dump(mode="json"),
        "dt": model.dt,
        "integrator": {"method": "Runge-Kutta of order 4", "steps_per_dt": model.substeps},
        "actuators": "commanded" if model.commanded else "measured",
        "states": _channels(STATE_CHANNELS),
        "inputs": _channels(step.inputs),
        "memory": _channels(step.memory),
        "parameters": [*_eq2(step), *_left_side(step), *_effects(step), *_dynamics(step)],
        "equations": model.describe().splitlines(),
        "training": None if origin is None else asdict(origin),
    }


def _channels(channels: Sequence[Channel]) -> list[dict[str, Any]]:
    return [asdict(channel) for channel in channels]


def _row(name: str, value: Any, unit: str, meaning: str) -> dict[str, Any]:
    number = float(value)
    return {"name": name, "value": number if math.isfinite(number) else None, "unit": unit, "meaning": meaning}


def _eq2(step: Step) -> list[dict[str, Any]]:
    """Fitted p0..p10."""
    values, _ = step.model.forces()
    return [_row(name, value, unit, text) for (name, text, unit), value in zip(PARAMETERS, values, strict=True)]


def _left_side(step: Step) -> list[dict[str, Any]]:
    """Masses, hull derivatives and geometry from the regressions."""
    meaning = "left side of eq. (2) and geometry, from the particulars"
    return [
        _row(name, value, "SI", meaning)
        for f in fields(step.model.c)
        for name, value in _numbers(f.name, getattr(step.model.c, f.name))
    ]


def _numbers(name: str, value: Any) -> list[tuple[str, float]]:
    """Names and numbers of a value that may hold several."""
    if is_dataclass(value):
        return [row for f in fields(value) for row in _numbers(f"{name}.{f.name}", getattr(value, f.name))]
    if isinstance(value, tuple):
        return [row for i, item in enumerate(value) for row in _numbers(f"{name}.{i}", item)]
    return [(name, value)]


def _effects(step: Step) -> list[dict[str, Any]]:
    """Values of the effects that act as forces, with the changes of hull and structure of a calibrated ship, and of
    those of gears and sensors."""
    extension = step.model.extension
    others = [] if extension is None else [*extension.active("gear"), *extension.active("sensor")]
    return [
        _row(f"{a.effect.name}.{p.name}", value, p.unit, f"{a.effect.summary}: {p.title or p.name}")
        for a in [*step.model.forces()[1], *others]
        for p, value in zip(a.effect.parameters, a.q, strict=False)
    ]


def _dynamics(step: Step) -> list[dict[str, Any]]:
    """Dynamics between commands and actuators."""
    found = []
    for name, gear in zip(STATES[ACTUATORS], step.model.dynamics(), strict=True):
        for f in fields(Gear) if gear is not None else ():
            text, unit = _GEAR[f.name]
            whole = unit if unit == "s" else f"{UNITS[name]}{unit}"
            found.append(_row(f"{name}.{f.name}", getattr(gear, f.name), whole, f"{text}, actuator {name}"))
    return found
