"""Effect: one formula, used to hide a cause in simulated data, to test for it in measured data, and to extend a model.

A part is one file of this folder whose instance is bound to `EFFECT`; the file's name is the effect's name. It
overrides one of three methods, which say where the cause enters: `force` (anything that acts on the hull), `gear`
(between command and actuator) or `measure` (the sensors). Its values `q` are zero when nothing is missing, and may be
numbers, one per run, or symbols (force only).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from typing import ClassVar, Protocol, TypeVar

import numpy as np

from ..errors import InputError, unknown_parameter
from ..ops import Array, cos, sin
from ..physics.actuators import Gear
from ..physics.modifiers import Flow, Modifiers
from ..registry import Registry
from ..ship import Particulars
from .traits import SEARCHES, Traits

EFFECTS = Registry("effect", "effects", "EFFECT", helpers=frozenset({"base", "traits"}))

FAMILIES = ("environment", "rudder", "propulsion", "thruster", "hull", "sensor", "time")
"""Families of effects, in the order in which they are listed."""
_FROUDE = {"1": 0.0, "speed": 0.5, "time": 0.5, "rate": -0.5, "length": 1.0, "area": 2.0, "rpm rate": -1.0}
_REFERENCE_LENGTH = 130.0
_ACTS_THROUGH = {"rudder": ("delta",), "propulsion": ("n",), "thruster": ("F_b", "F_s")}


@dataclass(frozen=True)
class Parameter:
    """One value of an effect.

    typical, low, high are for a ship of 130 m; `scaling` says how they go with the length (Froude's law): a key of
    `_FROUDE`. A fit is held between low and high; a size beyond them is not named (`Effect.plausible`).
    A `shape` parameter is not an amplitude: it is chosen from `Effect.settings`, and means nothing while the amplitudes
    are zero. An `other` one is the amplitude, or chooses, another form of the same cause, which a ship may have in its
    place: fitted, but not drawn for the suite. `title` is the name in words, such as "sway damping"; a `relative` one
    is a change of a coefficient as a share, reported in percent; one with `share_of` is a share of that quantity,
    reported in percent too.
    """

    name: str
    unit: str
    typical: float
    low: float
    high: float
    scaling: str = "1"
    shape: bool = False
    other: bool = False
    title: str = ""
    relative: bool = False
    share_of: str = ""

    def for_length(self, L: float) -> Parameter:
        """Parameter scaled to a ship of length L [m]."""
        factor = (L / _REFERENCE_LENGTH) ** _FROUDE[self.scaling]
        return replace(self, typical=self.typical * factor, low=self.low * factor, high=self.high * factor)


class Effect:
    """Base of all effects; see the module's docstring.

    Class attributes: `family` (environment, rudder, propulsion, thruster, hull, sensor, time), `summary`, `phrase` (a
    noun phrase for the verdict with the names of values in braces, such as "a current of {speed} towards {to}"),
    `source`, `parameters`, `per_run` (every run has its own values), `vector` (names of size and direction that two
    earth-fixed components are reported as), `separate` (the manoeuvre that tells it from its look-alikes), `channels`
    (measured inputs without which it means nothing), `known_with` (measured inputs with which the model has it
    already), `scales` (channels that it records (1 + q) times too large), `breaks_symmetry` (a force that knows port
    from starboard, or directions or places of the earth: what no hull, propeller or rudder does by coefficients that
    are wrong), `moves_flow` (it sets water or air in motion: it writes `Modifiers.u_c`, `v_c`, `drift`, `air_u` or
    `air_v`, and acts before the forces that follow the flow), `late` (tells of another time, and as much of the motion
    as a sensor in time, but where a record begins or ends), `unrecorded` (of a gear's: it may also act behind the
    record of the actuator, where the motion alone shows it), `traits` (facts about ships and about its look-alikes).
    `way`: how one of those that `fitted` gives acts, where the user should be told.
    """

    name: str = ""
    family: ClassVar[str]
    summary: ClassVar[str]
    phrase: ClassVar[str] = ""
    source: ClassVar[str]
    parameters: ClassVar[tuple[Parameter, ...]]
    per_run: ClassVar[bool] = False
    vector: ClassVar[tuple[str, str] | None] = None
    separate: ClassVar[str] = ""
    channels: ClassVar[tuple[str, ...]] = ()
    known_with: ClassVar[tuple[str, ...]] = ()
    scales: ClassVar[tuple[str, ...]] = ()
    breaks_symmetry: ClassVar[bool] = False
    moves_flow: ClassVar[bool] = False
    late: ClassVar[bool] = False
    unrecorded: ClassVar[bool] = False
    traits: ClassVar[Traits] = Traits()
    way: str = ""

    def __init_subclass__(cls) -> None:
        cls.name = cls.__module__.rsplit(".", 1)[-1]

    @property
    def enters(self) -> str:
        """Place where it enters: "force", "gear" or "sensor"."""
        cls = type(self)
        return "gear" if cls.gear is not Effect.gear else "sensor" if cls.measure is not Effect.measure else "force"

    @property
    def acts_through(self) -> tuple[str, ...]:
        """Actuators of which one at least must work for it to act; none where it needs no actuator."""
        return _ACTS_THROUGH.get(self.family, ())

    def least_size(self, setting: Sequence[float]) -> float:
        """Size in typical ones from which it is practically significant, with these shape parameters."""
        return self.traits.least_size

    def normal(self, setting: Sequence[float]) -> float | None:
        """Direction [rad] along which its force acts, fixed to the earth; None for most."""
        return None

    def form_spread(self, setting: Sequence[float], L: float) -> tuple[float, ...]:
        """Standard deviation of its amplitudes, in their units, that the form of a hull of length L [m] adds to any
        estimate."""
        return tuple(0.0 for p in self.parameters if not p.shape)

    def known(self, inputs: Mapping[str, np.ndarray], ship: Particulars) -> tuple[np.ndarray, ...]:
        """Values `q` by the measured `inputs` of `known_with`.

        Raises:
            NotImplementedError: the model takes these inputs in itself (wind).
        """
        raise NotImplementedError

    def plausible(self, q: Sequence[float], ship: Particulars) -> bool:
        """Whether all sizes `q` lie within the bounds of their parameters, shapes left out or not."""
        return all(p.shape or p.low <= value <= p.high for p, value in zip(self.sized(ship.L), q, strict=False))

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        """Write the effect of size `q` into `e`, at the instant `s`."""

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        """Change the dynamics of `n`, `delta` and `F` (both thrusters); `q` holds numbers or one value per run."""

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        """Measurement of the true states S (runs, samples, 10); `q` holds numbers or one value per run."""
        return S

    def settings(self, positions: np.ndarray, ship: Particulars) -> list[tuple[float, ...]]:
        """Values of the shape parameters to try, given the places (.., 2) that the ship visited."""
        return [()]

    def fitted(self, L: float) -> tuple[Effect, ...]:
        """Effect in variables in which it acts about linearly on a ship of length L [m] (`public` converts them back),
        once for each form in which it may act."""
        return (self,)

    def sized(self, L: float) -> tuple[Parameter, ...]:
        """Parameters for a ship of length L [m]."""
        return tuple(p.for_length(L) for p in self.parameters)

    def public(self, q: Sequence[float]) -> dict[str, float]:
        """Values under the names that are reported; two earth-fixed components become a size and a direction [rad]."""
        if self.vector is None:
            return {p.name: float(v) for p, v in zip(self.parameters, q, strict=True)}
        north, east = (float(v) for v in q)
        return {self.vector[0]: math.hypot(north, east), self.vector[1]: math.atan2(east, north) % (2.0 * math.pi)}

    def correction(self, values: Mapping[str, float]) -> str:
        """Line of dataset.toml that corrects the record for it, from values under the reported names; empty where there
        is none."""
        return ""

    def units(self) -> dict[str, str]:
        """Units under the names of `public`."""
        if self.vector is None:
            return {p.name: p.unit for p in self.parameters}
        return {self.vector[0]: self.parameters[0].unit, self.vector[1]: "rad"}

    def internal(self, values: Mapping[str, float]) -> tuple[float, ...]:
        """Values `q` from those under the reported names; values not given are zero, shape parameters typical, a
        vector's direction north.

        Raises:
            InputError: a name is unknown, or a vector's size is missing.
        """
        known = list(self.units())
        for key in values:
            if key not in known:
                raise unknown_parameter(f"effect '{self.name}'", key, known)
        if self.vector is not None:
            size, towards = values.get(self.vector[0]), values.get(self.vector[1], 0.0)
            if size is None:
                raise InputError(f"effect '{self.name}': {self.vector[0]} is missing; accepted: {', '.join(known)}.")
            return size * math.cos(towards), size * math.sin(towards)
        return tuple(float(values.get(p.name, p.typical if p.shape else 0.0)) for p in self.parameters)


def searched_by(search: str) -> tuple[Effect, ...]:
    """Effects that a diagnosis looks for in one way, a key of `SEARCHES`."""
    assert search in SEARCHES
    return tuple(effect for effect in map(EFFECTS.get, EFFECTS.names()) if effect.traits.search == search)


def having(trait: str) -> tuple[Effect, ...]:
    """Effects for which a trait is set, by family and name."""
    found = [effect for effect in map(EFFECTS.get, EFFECTS.names()) if getattr(effect.traits, trait)]
    return tuple(sorted(found, key=lambda effect: FAMILIES.index(effect.family)))


def aliases_of(name: str) -> tuple[str, ...]:
    """Names of the effects with which an effect is reported as confounded, sorted: those of its own trait `aliases`,
    and those whose trait has it."""
    return _aliases(tuple(EFFECTS.names())).get(name, ())


@cache
def _aliases(names: tuple[str, ...]) -> dict[str, tuple[str, ...]]:
    """Aliases by name, both ways, of these effects of the registry."""
    pairs = [(name, other) for name in names for other in EFFECTS.get(name).traits.aliases if other in names]
    mutual = sorted({*pairs, *((other, name) for name, other in pairs)})
    return {name: tuple(other for own, other in mutual if own == name) for name, _ in mutual}


class Holder(Protocol):
    """Object that carries an effect with its values, in a simulator or in a fitted model."""

    @property
    def effect(self) -> Effect: ...


H = TypeVar("H", bound=Holder)


def flow_first(items: Iterable[H]) -> list[H]:
    """Effects that set water or air in motion (`Effect.moves_flow`) before those whose forces follow the flow."""
    return sorted(items, key=lambda item: not item.effect.moves_flow)


def body_axes(north: Array, east: Array, psi: Array) -> tuple[Array, Array]:
    """Forward and starboard components of an earth-fixed vector."""
    return north * cos(psi) + east * sin(psi), east * cos(psi) - north * sin(psi)


def per_run(value: Array) -> Array:
    """Number, or one value per run as a column that broadcasts over samples."""
    return np.asarray(value)[:, None] if np.ndim(value) == 1 else value


def delayed(S: np.ndarray, channels: Sequence[int], delay: Array, dt: float) -> np.ndarray:
    """States (runs, samples, 10) whose `channels` are read `delay` seconds late (a number or one per run); before the
    run they continue as they began.

    Between samples a cubic with central slopes (Catmull & Rom) interpolates: a fit would not converge where the slope
    against the delay jumps, as it does at whole samples of linear interpolation.
    """
    runs, samples = S.shape[:2]
    shift = np.broadcast_to(np.asarray(delay, dtype=float) / dt, (runs,))
    at = np.arange(samples)[None, :] - shift[:, None]
    low = np.clip(np.floor(at).astype(int), 0, samples - 2)
    part = (at - low)[..., None]
    p = np.clip(part, 0.0, 1.0)
    weights = (
        0.5 * p * (p * (2.0 - p) - 1.0),
        0.5 * (p * p * (3.0 * p - 5.0) + 2.0),
        0.5 * p * (p * (4.0 - 3.0 * p) + 1.0),
        0.5 * p * p * (p - 1.0),
    )
    columns = S[:, :, list(channels)]
    first, last = columns[:, 1:2] - columns[:, :1], columns[:, -1:] - columns[:, -2:-1]
    padded = np.concatenate([columns[:, :1] - first, columns, columns[:, -1:] + last], axis=1)
    rows = np.arange(runs)[:, None]
    out = S.copy()
    out[:, :, list(channels)] = sum(w * padded[rows, low + i] for i, w in enumerate(weights)) + np.where(
        part < 0.0, first, last
    ) * (part - p)
    return out
