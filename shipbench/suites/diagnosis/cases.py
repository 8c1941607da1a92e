"""Hidden sets of the diagnosis suite: effect, size, sign, ship and seed are drawn; any case is rebuilt from (seed,
kind, index).

Data come from the MMG simulator or from ships of the literature in their own equations (kinds with `published`), never
from the fitted model; `none-same` alone is made by the fitted model, to count false alarms on it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...diagnosis.actuators.kinds import least_rate
from ...effects.base import EFFECTS, Effect, Parameter
from ...errors import unknown_name
from ...physics.mmg import MMGShip
from ...records import Dataset
from ...ship import complete
from ...signals import DELTA, PSI, N, R, U, V
from ...simulate.fitted_ship import fitted_trials
from ...simulate.hidden import Hidden
from ...simulate.manoeuvres import self_propulsion_rpm
from ...simulate.published import PUBLISHED, Published, published_trials
from ...simulate.simulator import Simulator
from ...simulate.trials import CRUISE, Trials, sea_trials
from .ships import WHICH, draw_ship
from .unmodelled import OUTSIDE, Outside

KINDS = ("single", "pair", "none-same", "none-other", "outside", "change", "unit", "published", "none-published")
SIZES = (1.0, 0.3)
OWN_KINDS = frozenset({"change_point", "going_astern", "unit_or_sign_error", "wind_coefficients", "wind_drift"})
ONE_SIDED = frozenset(
    {
        "added_resistance", "bank_suction", "cross_flow_drag", "position_delay", "rudder_delay", "shallow_water",
        "thruster_speed_loss",
        "velocity_delay",
    }
)  # fmt: skip
"""Effects of one sign only, beyond those whose lower bound is zero."""

_NOT_CHANGING = frozenset({"hull_derivatives", "bank_suction", "propeller_walk_astern"})
"""Effects without a change, as are actuator dynamics, thrusters and per-run effects: they act in few runs, and the
first changed one might not show them."""

ON_PUBLISHED = (
    "current", "wind", "rudder_offset", "propeller_walk", "thrust_gain", "rudder_rate_limit", "rudder_delay",
    "shaft_lag", "antenna_offset",
    "heading_bias", "speed_scale", "yaw_rate_bias", "position_delay", "velocity_delay", "current_per_run",
    "wind_per_run",
)  # fmt: skip
"""Causes that are hidden in published ships: those that are defined for any ship's equations."""

_RATES = {"rudder_rate_limit": ("delta", "rate_delta", 1.0), "shaft_rate_limit": ("n", "rate_n", 60.0)}
_LIMITED = 0.65
"""Share of the least default rate of an actuator: a limit above it is none (SOLAS requires no faster rudder of a short
ship, whatever Froude's law gives)."""

UNITS: tuple[tuple[str, tuple[int, ...], float], ...] = (
    ("speeds in knots", (U, V), 1.0 / 0.514444), ("sway velocity to port", (V,), -1.0),
    ("yaw rate to port", (R,), -1.0),
    ("yaw rate in deg/s", (R,), 180.0 / np.pi), ("rudder to port", (DELTA,), -1.0),
    ("revolutions in rev/s", (N,), 1.0 / 60.0),
    ("heading anticlockwise", (PSI,), -1.0), ("revolutions astern", (N,), -1.0),
)  # fmt: skip
"""Errors of unit or sign: name, channels of the state (commands of the same actuator follow), factor."""


@dataclass(frozen=True)
class Case:
    """Hidden set.

    effects: hidden effects, with values. truth: names that the diagnosis should give, in any order. size: of typical,
    per effect. variables: that count as right (outside). detail: further draws (run of a change, channel of a unit
    error).
    """

    kind: str
    index: int
    seed: int
    which: str
    ship: MMGShip | Published
    effects: tuple[Hidden, ...] = ()
    truth: tuple[str, ...] = ()
    size: tuple[float, ...] = ()
    variables: frozenset[str] = frozenset()
    detail: dict[str, Any] = field(default_factory=dict)
    plan: Trials = field(default_factory=Trials)

    @property
    def key(self) -> str:
        """Name of the case in file names."""
        return f"{self.which}-{self.kind}-{self.seed}-{self.index:04d}"

    @cached_property
    def data_seed(self) -> int:
        """Seed of the trials."""
        return int(_generator(self.seed, self.kind, self.index, self.which, 1).integers(2**31))

    def dataset(self) -> Dataset:
        """Sail and record the set; nothing in it states the hidden causes."""
        if isinstance(self.ship, Published):
            data = published_trials(self.ship, self.data_seed, self.effects, self.plan)
        elif self.kind == "none-same":
            data = fitted_trials(self.ship, self.data_seed, self.plan)
        else:
            data = sea_trials(self.ship, self.data_seed, self.effects, self.plan)
        if self.kind == "unit":
            data = misread(data, *UNITS[self.detail["error"]][1:])
        return replace(data, source="hidden set of the suite")

    def values(self) -> list[dict[str, float]]:
        """Sizes under their reported names, per effect; of per-run effects the root mean square over runs, of a change
        the values after it."""
        found = []
        for item in self.effects:
            if self.kind == "change":
                found.append(item.effect.public([float(v[-1]) for v in item.q]))
            elif isinstance(item.effect, Outside):
                found.append({"amplitude": float(item.q[0])})
            elif item.effect.per_run and item.effect.vector is not None:
                found.append({item.effect.vector[0]: float(np.sqrt(np.mean(sum(np.square(v) for v in item.q))))})
            else:
                found.append(item.effect.public([float(v) for v in item.q]))
        return found


def singles() -> list[str]:
    """Effects that are hidden one at a time."""
    return [name for name in EFFECTS.built_in() if name not in OWN_KINDS]


def count(kind: str, per_effect: int) -> int:
    """Number of cases of a kind in a suite with `per_effect` draws of each effect and size."""
    each = {
        "single": len(SIZES) * len(singles()),
        "pair": 12,
        "none-same": 24,
        "none-other": 24,
        "outside": len(OUTSIDE),
        "change": 6,
        "unit": len(UNITS),
        "published": len(PUBLISHED) * len(ON_PUBLISHED),
        "none-published": 8 * len(PUBLISHED),
    }
    return per_effect * each[kind]


def draw_case(kind: str, index: int, seed: int, which: str = "test", plan: Trials | None = None) -> Case:
    """Case number `index` of its kind.

    Raises:
        InputError: the kind or `which` is unknown.
    """
    if kind not in KINDS:
        raise unknown_name("kind of case", kind, KINDS)
    if which not in WHICH:
        raise unknown_name("set of ships", which, WHICH)
    rng, plan = _generator(seed, kind, index, which, 0), plan or Trials()
    names, sizes = _names(kind, index, rng)
    thrusters = any(EFFECTS.get(name).family == "thruster" for name in names)
    ship: MMGShip | Published = (
        list(PUBLISHED.values())[index % len(PUBLISHED)] if "published" in kind else draw_ship(rng, which, thrusters)
    )
    case = Case(kind, index, seed, which, ship, plan=plan)
    if kind == "outside":
        return _outside(case, rng)
    if kind == "unit":
        error = index % len(UNITS)
        return replace(
            case, truth=("unit_or_sign_error",), size=(1.0,), detail={"error": error, "name": UNITS[error][0]}
        )
    hidden = tuple(
        draw_hidden(rng, EFFECTS.get(name), ship, size, case) for name, size in zip(names, sizes, strict=True)
    )
    if kind == "change":
        first = int(rng.integers(round(0.3 * plan.runs), round(0.7 * plan.runs) + 1))
        after = np.arange(plan.runs) >= first
        hidden = tuple(Hidden(h.effect, tuple(np.where(after, v, 0.0) for v in h.q)) for h in hidden)
        return replace(
            case,
            effects=hidden,
            truth=("change_point",),
            size=tuple(sizes),
            detail={"changed": names[0], "from_run": first},
        )
    return replace(case, effects=hidden, truth=tuple(names), size=tuple(sizes))


def draw_hidden(rng: np.random.Generator, effect: Effect, ship: MMGShip | Published, size: float, case: Case) -> Hidden:
    """Values of an effect at `size` times its typical size: random sign where both have a meaning, random direction,
    per run N(0, typical)."""
    parameters, runs = effect.sized(ship.L), case.plan.runs
    if effect.per_run:
        return Hidden(effect, tuple(size * abs(p.typical) * rng.standard_normal(runs) for p in parameters))
    if effect.vector is not None:
        towards = rng.uniform(0.0, 2.0 * np.pi)
        return Hidden(
            effect,
            tuple(
                size * abs(p.typical) * part
                for p, part in zip(parameters, (np.cos(towards), np.sin(towards)), strict=True)
            ),
        )
    if effect.name == "hull_derivatives":
        return Hidden(
            effect, tuple(float(np.clip(size * p.typical * rng.standard_normal(), -0.6, 1.0)) for p in parameters)
        )
    if effect.name in _RATES:
        actuator, field, unit = _RATES[effect.name]
        own = getattr(ship.actuators, field) * unit
        typical = min(parameters[0].typical, _LIMITED * least_rate(actuator, (ship.L / 130.0) ** 0.5))
        return Hidden(effect, (1.0 / (1.0 / own + size * max(1.0 / typical - 1.0 / own, 0.5 / own)),))
    if effect.name == "bank_suction":
        assert isinstance(ship, MMGShip)
        return _bank(rng, effect, ship, size, case)
    q = []
    for p in parameters:
        if p.other:
            q.append(0.0)
        elif p.shape:
            q.append(float(np.clip(p.typical * rng.uniform(0.7, 1.4), p.low, p.high)))
        else:
            q.append(_sign(rng, effect, p) * size * abs(p.typical))
    return Hidden(effect, tuple(q))


def misread(data: Dataset, channels: Sequence[int], factor: float) -> Dataset:
    """Data set some of whose states (and the commands of the same actuators) were read in another unit or sign."""
    runs = []
    for run in data.runs:
        states, inputs = run.states.copy(), run.inputs.copy()
        for channel in channels:
            states[:, channel] *= factor
            if channel >= N:
                inputs[:, channel - N] *= factor
        runs.append(replace(run, states=states, inputs=inputs))
    return data.with_runs(runs)


def _generator(seed: int, kind: str, index: int, which: str, use: int) -> np.random.Generator:
    return np.random.default_rng(
        np.random.SeedSequence(seed, spawn_key=(WHICH.index(which), KINDS.index(kind), index, use))
    )


def _names(kind: str, index: int, rng: np.random.Generator) -> tuple[list[str], list[float]]:
    """Names and sizes of the library's effects that a case hides."""
    names = singles()
    if kind == "single":
        return [names[index % len(names)]], [SIZES[index // len(names) % len(SIZES)]]
    if kind == "published":
        return [ON_PUBLISHED[index // len(PUBLISHED) % len(ON_PUBLISHED)]], [1.0]
    if kind == "pair":
        able = [name for name in names if name != "hull_derivatives"]  # another hull is in every set already
        first = str(rng.choice(able))
        second = str(rng.choice([name for name in able if EFFECTS.get(name).family != EFFECTS.get(first).family]))
        return [first, second], [float(s) for s in rng.uniform(0.5, 1.0, 2)]
    if kind == "change":
        able = [
            n
            for n in names
            if EFFECTS.get(n).enters != "gear" and not EFFECTS.get(n).per_run and n not in _NOT_CHANGING
        ]
        able = [n for n in able if EFFECTS.get(n).family != "thruster"]
        return [str(rng.choice(able))], [1.0]
    return [], []


def _sign(rng: np.random.Generator, effect: Effect, parameter: Parameter) -> float:
    both = parameter.low <= -0.5 * abs(parameter.typical) and effect.name not in ONE_SIDED
    return float(rng.choice([-1.0, 1.0])) if both else float(np.sign(parameter.typical))


def _bank(rng: np.random.Generator, effect: Effect, ship: MMGShip, size: float, case: Case) -> Hidden:
    """Bank on one side, one to three breadths beyond the outermost position that the same trials reach without it."""
    calm = sea_trials(ship, case.data_seed, (), case.plan)
    places = np.concatenate([run.states[:, :2] for run in calm.runs])
    bearing = rng.uniform(0.0, 2.0 * np.pi)
    line = (
        float(np.max(places @ np.array([np.cos(bearing), np.sin(bearing)])))
        + rng.uniform(1.0, 3.0) * complete(ship.particulars).B
    )
    return Hidden(effect, (size * effect.sized(ship.L)[0].typical, 0.0, float(bearing), line, 0.0))


def _outside(case: Case, rng: np.random.Generator) -> Case:
    assert isinstance(case.ship, MMGShip)
    cause = OUTSIDE[case.index % len(OUTSIDE)]
    scale = (case.ship.L / 130.0) ** 0.5
    products = len(cause.variables) == 2
    second = (
        self_propulsion_rpm(Simulator(case.ship), CRUISE * scale) if products else float(rng.uniform(0.0, 2.0 * np.pi))
    )
    amplitude = float(rng.uniform(0.7, 1.3)) * (1.0 if products else float(rng.choice([-1.0, 1.0])))
    return replace(
        case,
        effects=(Hidden(cause, (amplitude, second)),),
        size=(abs(amplitude),),
        variables=cause.variables,
        detail={"name": cause.name},
    )
