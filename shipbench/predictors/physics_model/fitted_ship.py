"""Parts that models with fitted physics share: the ship, its actuators, the measured wind, and effects."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Self

import numpy as np

from ...estimation.actuator_fit import DEFAULT_ACTUATORS
from ...estimation.eq2_rollout import actuators_after
from ...estimation.extension import ACTUATOR_OF, Active, Extension, extension_of, geared, no_gear
from ...estimation.gears import gears_of
from ...estimation.rollout import Slopes
from ...ops import Array
from ...physics import eq2
from ...physics.actuators import Gear
from ...physics.modifiers import Flow
from ...records import Dataset
from ...ship import Ship, complete
from ...signals import ACTUATORS, COMMANDS
from ...specs import EffectSpec
from .._saved import check_shapes, sample_time
from ..base import PredictorBase
from .fit_report import FitReport

ACTUATOR_PARAMETERS = (
    ("T_n", "shaft time constant", "s"), ("rate_n", "shaft rate limit", "rpm/s"),
    ("T_delta", "rudder time constant", "s"), ("rate_delta", "rudder rate limit", "rad/s"),
    ("T_F", "thruster time constant", "s"), ("rate_F", "thruster rate limit", "N/s"),
)  # fmt: skip


class FittedShip(PredictorBase):
    """Base of the models with fitted physics; `_set_ship` says which ship."""

    extension: Extension | None = None
    report: FitReport | None = None
    """Report of the fit on its own runs, where there is one."""
    shallow: bool = False
    """Whether the accelerations depend on a measured water depth."""

    @abstractmethod
    def forces(self) -> tuple[Sequence[Array], list[Active]]:
        """Fitted values of p0..p10, and the effects that act as forces with theirs."""

    @abstractmethod
    def describe(self) -> str:
        """Text of the fitted equations."""

    @abstractmethod
    def accelerations(
        self, flow: Flow, wind: tuple[Array, Array] | None, p: Sequence[Array], active: Sequence[Active]
    ) -> tuple[Array, ...]:
        """Accelerations (du, dv, dr) [m/s^2, m/s^2, rad/s^2] with the values that `forces` returns, or with values
        of several models.

        wind: true wind speed [m/s] and direction [rad], or None.
        """

    def slopes(self) -> Slopes | None:
        """Machine code of `accelerations` and of their derivatives, or None: then use the formula itself."""
        return None

    def extend(self, effects: Sequence[EffectSpec]) -> Self:
        """Add effects to the fitted model (`physics+current`): their formulas are those of `shipbench.effects`.

        Values that the spec sets are held. The others are fitted with p0..p10; those of actuator effects from commands
        and recorded positions, where both are recorded. p4 stays zero beside a fitted rudder offset or asymmetry, p0
        beside a fitted propeller walk (and beside a rudder offset where hull derivatives are fitted too): they are
        confounded. Runs begin at t = 0 s, the time of s0.

        Raises:
            InputError: an effect or a parameter is unknown, or cannot be part of a predictor.
        """
        self.extension = extension_of(effects)
        return self

    def skip(self, dataset: Dataset) -> str | None:
        """Reason why this model cannot take `dataset`: an effect needs a channel that was not measured; or None."""
        for term in self.extension.terms if self.extension is not None else ():
            if missing := [c for c in term.effect.channels if c not in dataset.inputs]:
                return f"effect '{term.name}' needs {' and '.join(missing)}, which data set '{dataset.name}' lacks"
        return None

    def _set_ship(self, ship: Ship, inputs: tuple[str, ...], dt: float, commanded: bool) -> None:
        self.ship, self.inputs, self.dt, self.commanded = ship, inputs, dt, commanded
        self.particulars = complete(ship)
        self.c = eq2.coefficients(self.particulars)
        self.actuator_params = DEFAULT_ACTUATORS.copy()
        # One step a second serves 100 m; the time scale of a ship goes with sqrt(L) (Froude).
        self.substeps = max(1, int(np.ceil(dt / (0.15 * np.sqrt(self.c.L)) - 1e-9)))

    def actuators_after(self, actuators: np.ndarray, commands: np.ndarray, dt: float) -> np.ndarray:
        """Actuator states (..., 4) after `dt` seconds of held commands (..., 4); the commands themselves where no
        actuators were measured."""
        if self.commanded:
            return commands.copy()
        now, wanted = (list(np.moveaxis(a, -1, 0)) for a in (actuators, commands))
        return np.stack(actuators_after(now, wanted, dt, list(self.actuator_params)), axis=-1)

    def actuator_path(self, s0: np.ndarray, U: np.ndarray) -> np.ndarray:
        """Actuators n, delta, F_b, F_s at the beginning, middle and end of every substep, (batch, K * substeps, 3,
        4)."""
        h = self.dt / self.substeps
        path = np.empty((len(s0), U.shape[1] * self.substeps, 3, 4))
        now = s0[:, ACTUATORS]
        for j in range(path.shape[1]):
            command = U[:, j // self.substeps, : len(COMMANDS)]
            path[:, j, 0] = command if self.commanded else now
            path[:, j, 1] = self.actuators_after(now, command, 0.5 * h)
            now = self.actuators_after(now, command, h)
            path[:, j, 2] = now
        gears = [] if self.extension is None else self.extension.active("gear")
        if not gears:
            return path
        return geared(path, s0, U, self._plain_gears(), gears, self.dt, self.substeps)

    def _plain_gears(self) -> dict[str, Gear]:
        """Dynamics of shaft, rudder and thrusters without effects."""
        if self.commanded:
            return dict.fromkeys(("n", "delta", "F"), no_gear(self.dt / self.substeps))
        return gears_of(self.actuator_params)

    def dynamics(self) -> tuple[Gear | None, ...]:
        """Dynamics of n, delta, F_b, F_s, with the effects that change them; None where the command is the actuator."""
        plain = self._plain_gears()
        gears = dict(plain)
        for effect, q in self.extension.active("gear") if self.extension is not None else []:
            effect.gear(gears, q)
        return tuple(None if self.commanded and gears[key] == plain[key] else gears[key] for key in ACTUATOR_OF)

    def _wind_columns(self) -> list[int]:
        """Columns of U with the measured wind's speed and direction; none where it was not measured."""
        names = ("wind_speed", "wind_from")
        return [self.inputs.index(name) for name in names] if set(names) <= set(self.inputs) else []

    def _wind(self, U: np.ndarray) -> np.ndarray | None:
        """Measured wind speed and direction (batch, K, 2), or None."""
        return U[..., columns] if (columns := self._wind_columns()) else None

    def _ship_arrays(self) -> dict[str, np.ndarray]:
        """Actuator dynamics and values of the effects, to save."""
        arrays = {"actuators": self.actuator_params}
        if self.extension is not None:
            arrays |= {
                "effect_values": np.concatenate([*map(np.array, self.extension.values)]),
                "effect_ci95": self.extension.ci95,
            }
        return arrays

    def _ship_meta(self) -> dict[str, Any]:
        """Ship, sample time and effects, to save."""
        meta = {"ship": self.ship.model_dump(exclude_none=True), "dt": self.dt, "commanded": self.commanded}
        if self.extension is not None:
            meta["effects"] = [{"name": t.spec.name, "params": t.spec.params} for t in self.extension.terms]
        return meta

    def _restore_ship(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        """Take back what `_ship_arrays` and `_ship_meta` returned."""
        check_shapes(arrays, {"actuators": (len(ACTUATOR_PARAMETERS),)})
        ship = Ship.from_dict(meta["ship"], "saved model")
        self._set_ship(ship, self.inputs, sample_time(meta), bool(meta["commanded"]))
        self.actuator_params = arrays["actuators"]
        if "effects" in meta:
            asked = extension_of([EffectSpec(e["name"], e["params"]) for e in meta["effects"]])
            at = np.cumsum([0, *(len(t.given) for t in asked.terms)])
            check_shapes(arrays, {"effect_values": (at[-1],), "effect_ci95": (at[-1], 2)})
            values = [tuple(float(v) for v in arrays["effect_values"][a:b]) for a, b in pairwise(at)]
            self.extension = Extension(asked.terms, values, arrays["effect_ci95"])
