"""The whole ship calibrated: eq. (2) to (8) with every coefficient free about its prior between ships.

Hull, rudder, propeller in four quadrants, thrusters and wind take part. Published regressions are the prior means, the
differences between ordinary ships the prior standard deviations. The fit is the maximum of the posterior with a latent
force integrated out. Open-loop rollouts refine it where that pays on validation runs.

Source: docs/theory.md#calibration; priors: docs/calibration.md#ordinary-differences-between-ships.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any, ClassVar, Self

import numpy as np

from ..effects.base import flow_first
from ..errors import InputError, WorkError
from ..estimation.actuator_fit import fit_actuators
from ..estimation.calibration import (
    Calibration,
    Pushes,
    calibrated,
    calibration_of,
    calibration_without,
    estimated,
    some_of,
)
from ..estimation.coefficients import FREE, NUM_BASE, NUM_HULL, ShipScales, hull_changes, parameters
from ..estimation.extension import ACTUATOR_OF, Extension, measured, true_start
from ..estimation.extension import Active as Acting
from ..estimation.forward import Plant, known_effects
from ..estimation.gears import fit_gears, gears_of
from ..estimation.laplace import Fit
from ..estimation.priors import PRIORS
from ..estimation.refinement import refined_on, refinement_length
from ..estimation.rollout import Active, Course, Slopes, Vessel, accelerations
from ..estimation.term import Given, Term
from ..ops import Array
from ..physics.actuators import Gear, gear_path
from ..physics.modifiers import Flow
from ..records import Dataset
from ..signals import ACTUATORS, COMMANDS, MOTION
from ..specs import EffectSpec
from ._saved import check_shapes
from .base import History
from .physics_model.fitted_ship import ACTUATOR_PARAMETERS, FittedShip

_UNKNOWN = 0.9
"""Posterior over prior standard deviation above which runs hold next to no information about a coefficient."""


@dataclass
class Calibrated(FittedShip):
    """Fitted physics with all coefficients of the ship calibrated.

    Args:
        refine: whether open-loop rollouts refine the estimate where that pays on validation runs.
    """

    refine: bool = True
    name: ClassVar[str] = "calibrated"

    def __post_init__(self) -> None:
        if not isinstance(self.refine, bool):
            raise ValueError(f"refine = {self.refine}; accepted: true or false")

    def extend(self, effects: Sequence[EffectSpec]) -> Self:
        """Add effects to what is fitted (`calibrated+current`), as with `physics`.

        Raises:
            InputError: an effect or a parameter is unknown, cannot be part of a predictor, or is fitted already.
        """
        super().extend(effects)
        for term in self.extension.terms if self.extension is not None else ():
            if term.effect.traits.search == "hull":
                raise InputError(
                    f"effect '{term.name}': '{self.name}' fits the hull's coefficients already; leave it out."
                )
        return self

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return hasattr(self, "calibration")

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Calibrate the ship to `train`; `valid` decides whether rollouts refine the estimate, then joins the runs.

        Raises:
            InputError: the spec gives an effect a value that no such ship has.
            WorkError: the fit found no finite estimate.
        """
        self._set_ship(train.ship, train.inputs, train.dt, train.actuators == "commanded")
        if self.extension is not None:
            self.extension = Extension(self.extension.terms)  # a second fit starts afresh
            self.extension.check(self.particulars.L)
        data = train.merged(valid)
        plant = Plant.of(data)
        self.shallow = bool(plant.water)
        self.gears = self._fit_gears(data, plant)
        first = self._first(some_of(Plant.of(train)))
        found, seconds = calibrated(plant, first, first.model.terms), None
        if self.refine and valid is not None:
            start = calibration_without(found, range(len(train), len(data)))
            seconds = refinement_length(train, valid, self.gears, start)
        model = refined_on(data, self.gears, seconds, calibration_of(found))
        if not np.isfinite(model.base).all():
            raise WorkError(
                f"the calibration of '{train.name}' found no finite estimate; check units and signs with `shipbench "
                "data check`."
            )
        self._take(model)
        return self

    def _fit_gears(self, data: Dataset, plant: Plant) -> dict[str, Gear]:
        """Dynamics between commands and actuators: found from the records, or ordinary ones where there are none."""
        if self.commanded:
            return dict(plant.ordinary)
        batch = data.windows(min(len(r) for r in data.runs) - 1).batch()
        self.actuator_params = fit_actuators(batch, self.dt)
        if self.extension is not None:
            self.actuator_params, self.extension = fit_gears(
                batch, self.dt, self.substeps, self.extension, self.actuator_params, self.particulars
            )
        gears = gears_of(self.actuator_params)
        for active in self.extension.active("gear") if self.extension is not None else []:
            active.effect.gear(gears, active.q)
        return gears

    def _first(self, plant: Plant) -> Fit:
        """First estimate; beside effects whose shape parameters are open, that with the most evidence."""
        found = estimated(plant)
        choices = self._choices(plant)
        if choices == [()]:
            return found
        return max((calibrated(plant, found, terms) for terms in choices), key=lambda fit: fit.evidence)

    def _choices(self, plant: Plant) -> list[tuple[Term, ...]]:
        """Terms of the effects that the motion shows, once for every setting of open shape parameters."""
        found = []
        for t in self._shown():
            effect = t.effect if not any(v is not None for v in t.given) else Given(t.effect, t.given)
            open_shapes = [i for i, p in enumerate(t.effect.parameters) if p.shape and t.given[i] is None]
            shapes = [i for i, p in enumerate(t.effect.parameters) if p.shape]
            positions = plant.seg.states[..., :2]
            settings = {
                tuple(value for i, value in zip(shapes, setting, strict=True) if i in open_shapes)
                for setting in t.effect.settings(positions, self.particulars)
            }
            found.append([Term(effect, setting) for setting in sorted(settings)])
        return list(product(*found))

    def _shown(self) -> list[Any]:
        """Effects of the spec that are found from the motion; gears are where the record has the commands alone."""
        terms = () if self.extension is None else self.extension.terms
        return [t for t in terms if self.commanded or t.effect.enters != "gear"]

    def _take(self, model: Calibration) -> None:
        """Keep a calibration, and put the amplitudes of its terms into the extension."""
        self.calibration = model
        if self.extension is None:
            return
        values, row = [list(q) for q in self.extension.values], np.cumsum([0, *map(len, self.extension.values)])
        terms = [i for i, t in enumerate(self.extension.terms) if any(t is shown for shown in self._shown())]
        for i, term, value, spread in zip(terms, model.terms, model.values, model.value_spreads, strict=True):
            size = np.array([abs(p.typical) for p in term.effect.sized(self.particulars.L) if not p.shape])
            t = self.extension.terms[i]
            free = [j for j, p in enumerate(t.effect.parameters) if t.given[j] is None and not p.shape]
            open_shapes = [j for j, p in enumerate(t.effect.parameters) if t.given[j] is None and p.shape]
            for j, amplitude, half in zip(free, size * value, 1.96 * size * spread, strict=True):
                values[i][j] = float(amplitude)
                self.extension.ci95[row[i] + j] = amplitude - half, amplitude + half
            for j, shape in zip(open_shapes, term.setting, strict=True):
                values[i][j] = shape
        self.extension = replace(self.extension, values=[tuple(q) for q in values])

    def actuator_path(self, s0: np.ndarray, U: np.ndarray) -> np.ndarray:
        """n, delta, F_b, F_s at the beginning, middle and end of every substep, (batch, K * substeps, 3, 4)."""
        steps = U.shape[1] * self.substeps
        path = np.empty((len(s0), steps, 3, 4))
        for i, gear in enumerate(self.dynamics()):
            fine = gear_path(s0[:, 6 + i], U[:, :, i], self.dt, gear, 2 * self.substeps)
            path[:, :, :, i] = np.stack([fine[:, stage : stage + 2 * steps - 1 : 2] for stage in range(3)], axis=-1)
        return path

    def dynamics(self) -> tuple[Gear, ...]:
        """Dynamics of n, delta, F_b, F_s, with the effects that change them."""
        gears = dict(self.gears)
        if self.commanded and self.extension is not None:
            for active in self.extension.active("gear"):
                active.effect.gear(gears, active.q)
        return tuple(gears[key] for key in ACTUATOR_OF)

    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        forces, sensors = self._active("force"), self._active("sensor")
        start, path = true_start(s0, sensors, self.dt), self.actuator_path(s0, U)
        S = np.empty((len(s0), U.shape[1] + 1, s0.shape[1]))
        S[:, 0] = start
        S[..., MOTION] = self._motion(start, U, path, self.calibration.base, forces)
        S[:, 1:, ACTUATORS] = (
            U[..., : len(COMMANDS)] if self.commanded else path[:, self.substeps - 1 :: self.substeps, 2]
        )
        return measured(S, sensors, self.dt)[:, 1:]

    def _active(self, enters: str) -> list[Acting]:
        return [] if self.extension is None else self.extension.active(enters)

    def _formula(self, base: np.ndarray, forces: Sequence[Acting]) -> tuple[list[Array], list[Active]]:
        """Values of p0..p10, the effects `forces`, and the changes of hull and structure, for coefficients `base`."""
        p, ship = parameters(self._scales(), base)
        return p, [*(Active(a.effect, a.q) for a in flow_first(forces)), *ship]

    def forces(self) -> tuple[Sequence[Array], list[Acting]]:
        """Calibrated p0..p10, the effects of the spec that act as forces, and the changes of hull and structure."""
        p, active = self._formula(self.calibration.base, self._active("force"))
        return p, [Acting(a.effect, a.q) for a in active]

    def accelerations(
        self, flow: Flow, wind: tuple[Array, Array] | None, p: Sequence[Array], active: Sequence[Acting]
    ) -> tuple[Array, ...]:
        """Accelerations of eq. (2) with all that is calibrated, in deep water; without measured wind the air is
        still."""
        return accelerations(
            (flow.x, flow.y, flow.psi, flow.u, flow.v, flow.r),
            (flow.n, flow.delta, flow.F_b, flow.F_s),
            flow.t,
            wind,
            p,
            [Active(a.effect, a.q) for a in active],
            Vessel(self.particulars, self.c),
        )

    def slopes(self) -> Slopes | None:
        """Machine code of `accelerations` and of their derivatives; None where there is no compiler."""
        active = self._formula(self.calibration.base, self._active("force"))[1]
        return Slopes.of(active, Vessel(self.particulars, self.c), bool(self._wind_columns()))

    def _motion(
        self, start: np.ndarray, U: np.ndarray, path: np.ndarray, base: np.ndarray, forces: Sequence[Acting],
        w: np.ndarray | None = None,
    ) -> np.ndarray:  # fmt: skip
        """Motion (batch, K + 1, 6) with coefficients `base`, one set or one of each rollout, and a latent acceleration
        w (batch, K + 1, 3) at the samples."""
        B, K = U.shape[:2]
        part = (np.arange(self.substeps)[:, None] + 0.5 * np.arange(3)) / self.substeps
        t = np.broadcast_to((np.arange(K)[:, None, None, None] + part) * self.dt, (K, B, self.substeps, 3))
        wind = self._wind(U)
        air = None if wind is None else np.swapaxes(wind, 0, 1)
        course = Course(Vessel(self.particulars, self.c), self.dt / self.substeps, np.ascontiguousarray(t), air)
        p, active = self._formula(base, forces)
        depth = {"depth": U[..., self.inputs.index("depth")].mean(axis=1)} if self.shallow else {}
        act = np.moveaxis(path.reshape(B, K, self.substeps, 3, 4), 1, 0)
        push = np.zeros((K, B, self.substeps, 3, 3))
        if w is not None:
            ends = np.swapaxes(w, 0, 1)[:, :, None, None]
            push = (1.0 - part[..., None]) * ends[:-1] + part[..., None] * ends[1:]
        return course.rolled(start[:, MOTION], p, [*active, *known_effects(depth, self.particulars)], act, push)

    def predict_samples(self, s0: np.ndarray, U: np.ndarray, samples: int = 100, *, seed: int = 0) -> np.ndarray:
        """Random records of the motion that is to come; quantiles over samples are bands of what will be measured.

        The coefficients are drawn from the posterior, the latent force from its process, the errors of s0 and of the
        record from the sensors' noise. Effects keep their estimates.

        Args:
            s0: (batch, 10), as in `predict`.
            U: (batch, K, inputs), as in `predict`.
            samples: number of records of each rollout.
            seed: of the draws.

        Returns:
            Motion (samples, batch, K, 6): x, y, psi, u, v, r; not finite where a rollout diverges.

        Raises:
            InputError: the model is not fitted, or an argument does not suit `predict`.
        """
        s0, U = np.atleast_2d(s0), U if np.ndim(U) == 3 else np.asarray(U)[None]
        self.predict(s0, U)  # refuses what is wrong
        rng, (B, K), model = np.random.default_rng(seed), U.shape[:2], self.calibration
        lanes, sensors = samples * B, self._active("sensor")
        values, vectors = np.linalg.eigh(model.cov[:NUM_BASE, :NUM_BASE])
        drawn = rng.standard_normal((samples, NUM_BASE)) * np.sqrt(np.maximum(values, 0.0)) @ vectors.T
        start = np.tile(true_start(s0, sensors, self.dt), (samples, 1))
        noise = rng.standard_normal((lanes, K + 1, 6)) * model.pushes.noise
        start[:, MOTION] += noise[:, 0]
        path, whole = np.tile(self.actuator_path(s0, U), (samples, 1, 1, 1)), np.tile(U, (samples, 1, 1))
        base = np.repeat(model.base + drawn, B, axis=0)
        X = self._motion(start, whole, path, base, self._active("force"), self._latent(rng, lanes, K))
        if sensors:
            S = np.concatenate([X, np.zeros((*X.shape[:2], 4))], axis=-1)
            X = measured(S, sensors, self.dt)[..., MOTION]
        return (X + noise)[:, 1:].reshape(samples, B, K, 6)

    def _latent(self, rng: np.random.Generator, lanes: int, K: int) -> np.ndarray:
        """Latent accelerations (lanes, K + 1, 3): an Ornstein-Uhlenbeck process, exact at the samples."""
        pushes = self.calibration.pushes
        keep = np.exp(-self.dt / pushes.tau)
        w = rng.standard_normal((lanes, K + 1, 3))
        for k in range(1, K + 1):
            w[:, k] = keep * w[:, k - 1] + np.sqrt(1.0 - keep**2) * w[:, k]
        return w * pushes.force

    def _scales(self) -> ShipScales:
        return ShipScales.of(self.particulars, self.c, bool(self._wind_columns()))

    def describe(self) -> str:
        """Every coefficient with its prior and its posterior (mean +- standard deviation), how many prior standard
        deviations it moved, and what these runs do not determine."""
        lines = [
            f"calibrated physics of {self.ship.name}: eq. (2) to (8) with {NUM_BASE} coefficients, prior and posterior "
            "(mean +- standard deviation)",
            f"  {'coefficient':24s} {'prior':>17s} {'posterior':>17s} {'moved':>6s}  unit; meaning",
        ]
        unknown = []
        widths, base, spread = self.calibration.widths, self.calibration.base, self.calibration.spread
        changes = hull_changes(base[len(FREE) : len(FREE) + NUM_HULL])
        structure = self._scales().structure
        for i, prior in enumerate(PRIORS):
            unit = structure[i - len(FREE) - NUM_HULL] if i >= len(FREE) + NUM_HULL else prior.spread
            if unit == 0.0:
                continue  # the ship file or a missing input leaves no room
            hull = len(FREE) <= i < len(FREE) + NUM_HULL
            value = prior.centre + (changes[i - len(FREE)] if hull else unit * base[i])
            if spread[i] > _UNKNOWN * widths[i]:
                unknown.append(prior.name)
            lines.append(
                f"  {prior.name:24s} {prior.centre:8.3g} +-{unit:7.2g} {value:8.3g} +-{unit * spread[i]:7.2g} "
                f"{base[i]:+6.1f}  {prior.unit}; {prior.title}"
            )
        if unknown:
            lines.append(f"  not determined by these runs (the prior stands): {', '.join(unknown)}")
        if self.commanded:
            lines.append("  actuators: the data record commands only; ordinary dynamics between command and actuator")
        else:
            lines += [
                f"  {symbol:10s} = {value:10.4g} {unit:6s} {meaning}"
                for (symbol, meaning, unit), value in zip(ACTUATOR_PARAMETERS, self.actuator_params, strict=True)
            ]
        lines += self.extension.describe() if self.extension is not None else []
        return "\n".join(lines + [f"  note: {n}" for n in self.particulars.notes])

    def _arrays(self) -> dict[str, np.ndarray]:
        model = self.calibration
        return {
            "base": model.base, "cov": model.cov, "widths": model.widths, "force": model.pushes.force,
            "noise": model.pushes.noise, **self._ship_arrays(),
        }  # fmt: skip

    def _meta(self) -> dict[str, Any]:
        gears = {name: asdict(gear) for name, gear in self.gears.items()}
        return self._ship_meta() | {"gears": gears, "shallow": self.shallow, "tau": float(self.calibration.pushes.tau)}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        check_shapes(arrays, {"base": (NUM_BASE,), "widths": (NUM_BASE,), "force": (3,), "noise": (6,)})
        size = max(NUM_BASE, len(arrays["cov"]))
        check_shapes(arrays, {"cov": (size, size)})
        self._restore_ship(arrays, meta)
        pushes = Pushes(arrays["force"], float(meta["tau"]), arrays["noise"])
        self.calibration = Calibration(arrays["base"], arrays["cov"], arrays["widths"], pushes)
        self.gears = {
            name: Gear(**{k: float(v) for k, v in meta["gears"][name].items()}) for name in ("n", "delta", "F")
        }
        self.shallow = bool(meta["shallow"])


PREDICTOR = Calibrated
