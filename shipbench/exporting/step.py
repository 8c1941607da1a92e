"""Discrete step of a fitted model as CasADi functions: the one formula from which every format is written.

The model's own formulas are traced with symbols, with its own integrator, so that a sequence of steps gives the numbers
of `predict`. What a model carries from one step to the next beside the ten states (the ship's true motion behind a
sensor error, a motor behind its play, delayed commands) is its memory.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from ..errors import InputError, WorkError
from ..estimation.extension import Active, measured, true_start
from ..estimation.forward import known_effects
from ..integrate import kinematics, rk4_step
from ..ops import Array
from ..physics.actuators import Gear, gear_step
from ..physics.modifiers import Flow
from ..predictors.physics_model.fitted_ship import FittedShip
from ..signals import ACTUATORS, COMMANDS, MOTION, STATES, UNITS

TOLERANCE = 1e-9
"""Largest difference from `predict` of an exported number, relative to max(1, its size)."""
_SAMPLES = 60
"""Steps of the reference trajectory."""
_MOST_SUBSTEPS, _MOST_DELAYED = 50, 1000
"""Most integration steps a sample, and most samples of a delay: they bound the size of what is written."""


@dataclass(frozen=True)
class Channel:
    """Name, unit and meaning of one number."""

    name: str
    unit: str
    meaning: str


@dataclass(frozen=True)
class Reference:
    """Trajectory that an export is checked against: s0 (10,), U (K, inputs) and `predict`'s S (K, 10)."""

    s0: np.ndarray
    U: np.ndarray
    S: np.ndarray


@dataclass(frozen=True)
class Step:
    """One model as a discrete system.

    Args:
        model: the fitted model.
        inputs: channels of U.
        memory: channels of z.
        start: z of the state s0 (10,) and the first inputs u: (s0, u) -> z.
        step: memory after h seconds of the inputs u, and the ten states as the model's sensors read them:
            (z, u, h) -> (z_next, s).
        any_step: whether h may be any time up to dt; else it is dt.
    """

    model: FittedShip
    inputs: tuple[Channel, ...]
    memory: tuple[Channel, ...]
    start: ca.Function
    step: ca.Function
    any_step: bool

    def rollout(self, s0: np.ndarray, U: np.ndarray) -> np.ndarray:
        """States (K, 10) at t_1..t_K from s0 (10,) under U (K, inputs)."""
        z, found = self.start(s0, U[0]), []
        for u in U:
            z, s = self.step(z, u, self.model.dt)
            found.append(np.asarray(s).ravel())
        return np.array(found)

    @cached_property
    def reference(self) -> Reference:
        """Trajectory of a manoeuvre with all actuators and inputs, computed by `predict`."""
        s0, U = _manoeuvre(self.model)
        with np.errstate(all="ignore"):
            S = self.model.predict(s0, U)
        return Reference(s0, U, S)


def step_of(model: FittedShip) -> Step:
    """Discrete step of a fitted model, checked against its own `predict`.

    Raises:
        InputError: the model has an effect that no step can hold.
        WorkError: the model diverges, or its step does not give the numbers of `predict`.
    """
    _check_size(model)
    made = _traced(model)
    reference = made.reference
    if not np.isfinite(reference.S).all():
        raise WorkError(
            f"the model of ship '{model.ship.name}' diverges within {_SAMPLES * model.dt:g} s of a zigzag at "
            f"{reference.s0[3]:.3g} m/s, so that nothing was exported. Fit it on more runs, or look at its equations."
        )
    size = np.maximum(1.0, np.abs(reference.S))
    found = float(np.max(np.abs(made.rollout(reference.s0, reference.U) - reference.S) / size))
    if not found <= TOLERANCE:
        raise WorkError(
            f"the exported step of ship '{model.ship.name}' differs from predict by {found:.3g} (relative; accepted: "
            f"{TOLERANCE:g}), so that nothing was exported. Please report this model."
        )
    return made


def _check_size(model: FittedShip) -> None:
    """Refuse a model whose inputs or sample time no step can hold."""
    if model.inputs[: len(COMMANDS)] != COMMANDS:
        raise InputError(
            f"the model's inputs are {', '.join(model.inputs)}; accepted: {', '.join(COMMANDS)}, then measured "
            "channels. Fit it on a data set in shipbench's format."
        )
    if model.substeps > _MOST_SUBSTEPS:
        raise InputError(
            f"the model's sample time {model.dt:g} s is {model.substeps} integration steps of a ship of "
            f"{model.c.L:.3g} m; accepted: up to {_MOST_SUBSTEPS}. Fit it on data with a shorter sample time."
        )


def _traced(model: FittedShip) -> Step:
    """Step of the model from its formulas."""
    sensors, gears = _sensors(model), model.dynamics()
    lines = [
        _Line(name, UNITS[name], gear, model.dt, 2 * model.substeps)
        for name, gear in zip(STATES[ACTUATORS], gears, strict=True)
    ]
    motion = [Channel(name, UNITS[name], f"true {_MEANING[name]}") for name in STATES[MOTION]]
    memory = (*motion, *(c for line in lines for c in line.memory), Channel("k", "1", "samples since the start"))
    z, u, h = ca.SX.sym("z", len(memory)), ca.SX.sym("u", len(model.inputs)), ca.SX.sym("h")
    given, commands = iter(ca.vertsplit(z)), ca.vertsplit(u)
    x = tuple(next(given) for _ in motion)
    paths, kept = [], []
    for line, command in zip(lines, commands, strict=False):
        path, after = line.after([next(given) for _ in line.memory], command, h)
        paths.append(path)
        kept += after
    k = next(given)
    try:
        x = _moved(model, x, paths, k, u, h)
        s = _reading(
            [*x, *(c if model.commanded else path[-1] for c, path in zip(commands, paths, strict=False))],
            sensors,
            model.dt,
        )
        s0 = ca.SX.sym("s0", len(STATES))
        begin = true_start(_row(ca.vertsplit(s0)), sensors, model.dt)[0, : len(motion)]
    except (AttributeError, RuntimeError, TypeError, ValueError) as error:
        raise InputError(
            f"the model has an effect whose formula takes no symbols ({str(error).splitlines()[0][:120]}), so that it "
            "cannot be exported. Accepted: formulas of shipbench.ops."
        ) from error
    places = [line.start(s0[6 + i], commands[i]) for i, line in enumerate(lines)]
    after, first = [*x, *kept, k + h / model.dt], [*begin, *(v for place in places for v in place), 0.0]
    if not ca.depends_on(ca.vertcat(*after[:-1], *s), k):
        memory, after, first = memory[:-1], after[:-1], first[:-1]
    options = {"cse": True}
    whole = z[: len(memory)]
    start = ca.Function("start", [s0, u], [ca.densify(ca.vertcat(*first))], ["s0", "u"], ["z"], options)
    step = ca.Function(
        "step",
        [whole, u, h],
        [ca.densify(ca.vertcat(*after)), ca.densify(ca.vertcat(*s))],
        ["z", "u", "h"],
        ["z_next", "s"],
        options,
    )
    inputs = tuple(Channel(name, UNITS.get(name, "1"), _MEANING.get(name, "not used")) for name in model.inputs)
    return Step(model, inputs, memory, start, step, not any(line.held for line in lines))


def _sensors(model: FittedShip) -> list[Active]:
    """Effects of the model's sensors.

    Raises:
        InputError: one reads another time: `predict` interpolates between samples of which one is still to come.
    """
    sensors = [] if model.extension is None else model.extension.active("sensor")
    for active in sensors:
        if active.effect.late:
            raise InputError(
                f"effect '{active.effect.name}' cannot be exported: a delayed reading is interpolated with the sample "
                "that follows, which a step does not know. Accepted: sensor effects without delay. Fit the model "
                "without it, or correct the delay in dataset.toml ([delay])."
            )
    return list(sensors)


class _Line:
    """One actuator: its memory, and its path through the stages of a sample."""

    def __init__(self, name: str, unit: str, gear: Gear | None, dt: float, parts: int) -> None:
        self.name, self.parts, self.gear, self.held, self.late = name, parts, gear, 0, (0, 0.0)
        channels = []
        if gear is not None:
            if not 0.0 <= gear.delay <= _MOST_DELAYED * dt:
                raise InputError(
                    f"the model cannot be exported: its {name} follows commands with a delay of {gear.delay:.3g} s. A "
                    f"step knows no command before it is given; accepted: delays from 0 to {_MOST_DELAYED * dt:g} s. "
                    "Fit the model without the delay."
                )
            part = dt / parts
            whole = math.floor(gear.delay / part)
            self.late, self.part = (whole, gear.delay / part - whole), part
            first = -whole - (self.late[1] > 0.0)
            self.held = -(first // parts)
            neutral = {key: 0.0 for key in ("deadband", "backlash", "T2") if not getattr(gear, key)}
            self.gear = replace(gear, **neutral)
            channels.append(Channel(name, unit, f"true {_MEANING[name]}"))
            self.motor = bool(gear.backlash or gear.T2)
            if self.motor:
                channels.append(Channel(f"{name}_motor", unit, f"motor of the {_MEANING[name]}, before play or filter"))
            channels += [
                Channel(f"{name}_c_{i}", unit, f"command of {name} {i} samples ago") for i in range(1, self.held + 1)
            ]
        self.memory = tuple(channels)

    def start(self, position: Array, command: Array) -> list[Array]:
        """Memory at the start: the play is centred, and the first command was held before."""
        if self.gear is None:
            return []
        return [position, *([position] if self.motor else []), *[command] * self.held]

    def after(self, memory: Sequence[Array], command: Array, h: Array) -> tuple[list[Array], list[Array]]:
        """Positions (2 substeps + 1) over the sample, and the memory after it."""
        if self.gear is None:
            return [command] * (self.parts + 1), []
        left = list(memory)
        position = left.pop(0)
        motor = left.pop(0) if self.motor else position
        commands, path = [command, *left], [position]
        for j in range(self.parts):
            motor, position = gear_step(motor, position, list(self._wanted(j, commands, h)), self.gear)
            path.append(position)
        return path, [position, *([motor] if self.motor else []), *commands[: self.held]]

    def _wanted(self, j: int, commands: Sequence[Array], h: Array) -> Iterator[tuple[Array, Array]]:
        """Commands that reach the controller within the j-th part, each with its duration [s]."""
        whole, part = self.late
        length = self.part if self.held else h / self.parts
        if part > 0.0:
            yield commands[-((j - whole - 1) // self.parts)], part * length
        yield commands[-((j - whole) // self.parts)], (1.0 - part) * length


def _moved(
    model: FittedShip, x: tuple[Array, ...], paths: Sequence[Sequence[Array]], k: Array, u: Any, h: Array
) -> tuple[Array, ...]:
    """Motion after one sample, by the model's own integrator."""
    p, forces = model.forces()
    values = [_number(value) for value in p]
    active = [Active(a.effect, tuple(_number(v) for v in a.q)) for a in forces]
    air = tuple(u[i] for i in model._wind_columns()) or None
    if model.shallow:
        known = known_effects({"depth": u[model.inputs.index("depth")]}, model.particulars)
        active += [Active(a.effect, a.q) for a in known]
    S = model.substeps
    for j in range(S):

        def rhs(state: tuple[Array, ...], stage: int, j: int = j) -> tuple[Array, ...]:
            px, py, psi, u, v, r = state
            t = (k + (j + 0.5 * stage) / S * (h / model.dt)) * model.dt
            flow = Flow(px, py, t, psi, u, v, r, *(path[2 * j + stage] for path in paths))
            return (*kinematics(psi, u, v, r), *model.accelerations(flow, air, values, active))

        x = rk4_step(rhs, x, h / S)
    return x


def _number(value: Array) -> Array:
    """A fitted value for a formula in symbols; an array stays one for `is_neutral`, as it is in a rollout."""
    return value if isinstance(value, float) else ca.SX(float(value))


def _row(values: Sequence[Array]) -> np.ndarray:
    """Symbols as an array (1, n), for formulas on arrays."""
    row = np.empty((1, len(values)), dtype=object)
    row[0] = list(values)
    return row


def _reading(state: Sequence[Array], sensors: Sequence[Active], dt: float) -> list[Array]:
    """Readings of the sensors in one state."""
    return list(measured(_row(state)[:, None], sensors, dt)[0, 0])


_MEANING = {
    "x": "position north", "y": "position east", "psi": "heading, clockwise from north",
    "u": "surge velocity over ground", "v": "sway velocity over ground, to starboard",
    "r": "yaw rate, bow to starboard", "n": "shaft speed", "delta": "rudder angle, positive turns to starboard",
    "F_b": "bow thruster force, to starboard", "F_s": "stern thruster force, to starboard",
    "n_c": "command of the shaft speed", "delta_c": "command of the rudder angle",
    "F_b_c": "command of the bow thruster", "F_s_c": "command of the stern thruster",
    "wind_speed": "true wind speed", "wind_from": "direction that the true wind comes from, clockwise from north",
    "depth": "water depth from the surface",
}  # fmt: skip
STATE_CHANNELS = tuple(Channel(name, UNITS[name], _MEANING[name]) for name in STATES)
"""The ten states that an export returns."""


def _manoeuvre(model: FittedShip) -> tuple[np.ndarray, np.ndarray]:
    """Start state (10,) and inputs (K, inputs): a zigzag at moderate speed with a push of each thruster and a wind that
    rises and turns. It begins straight ahead in calm air: an FMU starts with these values."""
    L, D = model.c.L, model.c.D_P
    speed = float(f"{0.12 * math.sqrt(9.81 * L):.3g}")
    n = float(f"{60.0 * speed / (0.7 * D):.3g}")
    push = float(f"{2e-4 * 9.81 * model.particulars.mass:.2g}")
    s0 = np.array([0.0, 0.0, 0.0, speed, 0.0, 0.0, n, 0.0, 0.0, 0.0])
    part = np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
    zigzag = np.where(part < 0.15, 0.0, np.where(part < 0.4, 0.2, np.where(part < 0.7, -0.3, 0.1)))
    columns = {
        "n_c": n * np.where(part < 0.6, 1.0, 0.6), "delta_c": zigzag,
        "F_b_c": push * (part > 0.5), "F_s_c": 0.0 - 0.5 * push * (part > 0.8),
        "wind_speed": 3.0 * speed * part, "wind_from": 2.0 * part,
        "depth": np.full(_SAMPLES, round(10.0 * model.c.T, 1)),
    }  # fmt: skip
    return s0, np.stack([columns.get(name, np.zeros(_SAMPLES)) for name in model.inputs], axis=1)
