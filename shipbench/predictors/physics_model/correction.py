"""Correction of a simulation by fitted physics: what the ship's own coefficients and further causes add to it.

The accelerations of a simulation are those of the physics nearest to it and a rest, which one-step predictions from
measured states show. Beside that rest the physics is calibrated anew, with the prior between ships about the nearest
physics: its changes and causes are then those that the simulation lacks. The correction is that difference.

Source: docs/theory.md#a-simulation-of-your-own.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...errors import InputError
from ...estimation.beside import PUSHES, BesideSimulation, centre_of
from ...estimation.coefficients import NUM_BASE, parameters
from ...estimation.extension import extension_of, measured, true_start
from ...estimation.forward import Plant, cut
from ...estimation.linearisation import Scales
from ...estimation.rollout import Vessel, accelerations
from ...records import Dataset, Run
from ...regular_files import read_json
from ...ship import complete
from ...signals import MOTION, PSI, STATES, R, U, V, X, Y
from ...specs import EffectSpec, parse_spec
from ...storage import write_text
from ..base import make_predictor
from ..calibrated import Calibrated
from ..context import Context, predicted

_SPEEDS = [U, V, R]
_REFERENCE, _MOST_JSON = "reference.json", 10_000
"""File of the reference, and its most bytes."""
_ITERATIONS, _STEP = 12, 1e-3
"""Gauss-Newton steps of the physics nearest to a simulation, and the difference of a coefficient for its slope."""
_LEAST_ERROR = np.array([1e-5, 1e-5, 1e-7])
"""Accelerations [m/s^2, m/s^2, rad/s^2] below which the nearest physics is as good as equal."""
_ROWS = 20_000
"""Most states from which a simulation steps in one call."""


def beside_simulation(dataset: Dataset, model: Any) -> BesideSimulation:
    """Data set with the coefficients of the physics nearest to a simulation, and what the simulation does beyond it.

    The simulation steps once from every measured state, with the inputs of that sample. The physics nearest to it is
    the maximum of the posterior under the prior between ships, with the differences of the accelerations as errors.
    What these coefficients do not explain becomes the channels `PUSHES`.

    Args:
        model: a fitted model with `predict`.

    Raises:
        InputError: the simulation returns no finite state from a measured one.
    """
    plant = Plant(complete(dataset.ship), cut(dataset, max(map(len, dataset.runs))))
    goal = np.zeros((*plant.seg.mask[:, 1:].shape, 3))
    for i, run in enumerate(dataset.runs):
        goal[i, : len(run) - 1] = _one_step(dataset, run.id, model)[:, _SPEEDS]
    base, rest = _nearest(plant, goal)
    runs = []
    for run, push in zip(dataset.runs, rest, strict=True):
        push = push[: len(run) - 1]
        inputs = np.column_stack([run.inputs, np.concatenate([push, push[-1:]])])
        runs.append(replace(run, inputs=inputs, inputs_names=(*run.inputs_names, *PUSHES)))
    whole = {f.name: getattr(dataset, f.name) for f in fields(Dataset)} | {"runs": tuple(runs)}
    return BesideSimulation(**whole, centre=base)


def _nearest(plant: Plant, goal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Coefficients (NUM_BASE,) with which the physics steps nearest to the speeds `goal` (B, K, 3), and the
    accelerations (B, K, 3) that remain; Gauss-Newton with the size of each axis's error found meanwhile.

    Errors last as long as the latent force does between its knots, and count once in that time.
    """
    scales, seg = Scales(plant), plant.seg
    states, calm = np.swapaxes(seg.states[:, :-1, MOTION], 0, 1)[None], np.zeros((*seg.mask.shape, 3))
    push = plant.pushes(calm)

    def rest(base: np.ndarray) -> np.ndarray:
        """Remaining accelerations (D, B, K, 3) for coefficients (D, NUM_BASE)."""
        p, ship = parameters(scales, base[:, None, None, :])
        ends = np.swapaxes(plant.steps_from(states, p, ship, push), 1, 2)
        return np.where(seg.mask[:, 1:, None], (goal - ends[..., 3:]) / seg.dt, 0.0)

    base, samples = np.zeros(NUM_BASE), float(seg.mask[:, 1:].sum())
    for _ in range(_ITERATIONS):
        found = rest(np.concatenate([base[None], base + _STEP * np.eye(NUM_BASE)]))
        e, J = found[0].reshape(-1, 3), np.moveaxis((found[0] - found[1:]) / _STEP, 0, -1).reshape(-1, 3, NUM_BASE)
        weight = seg.dt / plant.knot_time * samples / np.maximum((e**2).sum(axis=0), samples * _LEAST_ERROR**2)
        H = np.einsum("nai,naj,a->ij", J, J, weight) + np.eye(NUM_BASE)
        base = base + np.linalg.solve(H, np.einsum("nai,na,a->i", J, e, weight) - base)
    return base, rest(base[None])[0]


def _one_step(dataset: Dataset, name: str, model: Any) -> np.ndarray:
    """States (samples - 1, 10) one sample after every measured state of a run but the last."""
    run = dataset[name]
    found = []
    for first in range(0, len(run) - 1, _ROWS):
        at = slice(first, min(first + _ROWS, len(run) - 1))
        start, inputs = run.states[at], run.inputs[at, None]
        context = Context(
            dataset.ship, dataset.dt, dataset.inputs, (run.parent,) * len(start), run.t[at], (run.began,) * len(start)
        )
        S = np.asarray(predicted(model, start.copy(), inputs.copy(), None, context), dtype=float)
        if S.shape != (len(start), 1, start.shape[1]):
            raise InputError(
                f"the simulation returned the shape {S.shape} for one step from {len(start)} states; accepted: "
                f"{(len(start), 1, start.shape[1])}."
            )
        if not (fine := np.isfinite(S).all(axis=(1, 2))).all():
            k = first + int(np.argmin(fine))
            raise InputError(
                f"the simulation returns no finite state one step after the measured one of run '{name}' at t = "
                f"{run.t[k]:g} s ({int((~fine).sum())} such states). Correct it, or cut these samples."
            )
        found.append(S[:, 0])
    return np.concatenate(found)


def correctable(causes: Sequence[str]) -> tuple[str, ...]:
    """Those causes that a correction can hold: forces and errors of sensors that are the same in every run."""
    found = []
    for name in causes:
        try:
            (term,) = extension_of([EffectSpec(name)]).terms
        except InputError:
            continue
        if term.effect.enters != "gear" and term.effect.traits.search != "hull":
            found.append(name)
    return tuple(found)


@dataclass(frozen=True, eq=False)
class Correction:
    """Fitted physics whose difference to that nearest to a simulation corrects the simulation.

    Args:
        physics: the model `calibrated`, with the causes.
        reference: (NUM_BASE,) coefficients of the physics nearest to the simulation.
    """

    physics: Calibrated
    reference: np.ndarray

    @classmethod
    def fit(cls, train: Dataset, causes: Sequence[str] = ()) -> Self:
        """Correction with the ship's own coefficients and the causes, fitted to runs of `beside_simulation`."""
        physics = Calibrated(refine=False)
        physics = physics.extend([EffectSpec(name) for name in causes]) if causes else physics
        physics.fit(train)
        physics.inputs = tuple(name for name in train.inputs if name not in PUSHES)
        centre = centre_of(train)
        reference = np.zeros(NUM_BASE) if centre is None else centre
        physics.calibration = replace(physics.calibration, base=physics.calibration.base + reference)
        return cls(physics, reference)

    @classmethod
    def load(cls, folder: str | Path) -> Self:
        """Read a correction that `save` wrote.

        Raises:
            InputError: the folder holds none.
        """
        reference = np.array(read_json(Path(folder) / _REFERENCE, most=_MOST_JSON), dtype=float)
        if reference.shape != (NUM_BASE,) or not np.isfinite(reference).all():
            raise InputError(f"{folder}/{_REFERENCE} does not hold {NUM_BASE} numbers; diagnose the simulation again.")
        return cls(Calibrated.load(folder), reference)

    def save(self, folder: str | Path) -> None:
        """Write it as the saved model `calibrated` of its physics, and the reference."""
        self.physics.save(folder)
        write_text(Path(folder) / _REFERENCE, json.dumps(self.reference.tolist()) + "\n")

    def predict(
        self, model: Any, s0: np.ndarray, U: np.ndarray, dt: float, context: Context | None = None
    ) -> np.ndarray:
        """Rollout S (batch, K, 10) of the corrected simulation from s0 (batch, 10) under U (batch, K, inputs).

        The simulation steps one sample at a time. The correction is added to its speeds, as the mean of the values at
        the beginning and the end of the step.
        """
        sensors = self.physics._active("sensor")
        S = np.empty((len(s0), U.shape[1] + 1, s0.shape[1]))
        S[:, 0] = true_start(s0, sensors, dt)
        wind = self.physics._wind(U)
        with np.errstate(all="ignore"):
            for k in range(U.shape[1]):
                now = None if context is None else replace(context, start=context.start + k * dt)
                after = np.asarray(predicted(model, S[:, k].copy(), U[:, k : k + 1].copy(), None, now))[:, 0]
                air = None if wind is None else (wind[:, k, 0], wind[:, k, 1])
                first = self.missing(S[:, k], k * dt, air)
                last = self.missing(_pushed(after, S[:, k, PSI], first, dt), (k + 1) * dt, air)
                S[:, k + 1] = _pushed(after, S[:, k, PSI], 0.5 * (first + last), dt)
        return np.asarray(measured(S, sensors, dt)[:, 1:])

    def missing(self, s: np.ndarray, t: float, wind: tuple[np.ndarray, np.ndarray] | None) -> np.ndarray:
        """Accelerations (batch, 3) that the simulation lacks in states s (batch, 10)."""
        x, y, psi, u, v, r, n, delta, F_b, F_s = s.T
        both = []
        for base, forces in ((self.physics.calibration.base, self.physics._active("force")), (self.reference, ())):
            p, active = self.physics._formula(base, forces)
            vessel = Vessel(self.physics.particulars, self.physics.c)
            found = accelerations((x, y, psi, u, v, r), np.stack([n, delta, F_b, F_s]), t, wind, p, active, vessel)
            both.append(np.stack(np.broadcast_arrays(*found), axis=-1))
        return both[0] - both[1]


def corrected_simulation(spec: str, folder: Path, fitted_to: str = "") -> Callable[..., np.ndarray]:
    """Function `simulate(s0, U, dt, *, context)` of a simulation with the correction in `folder`/correction.

    Args:
        spec: of the simulation, its path relative to `folder`.
        fitted_to: fingerprint of the data set whose runs the correction knows; a study of these says so.

    Raises:
        InputError: the simulation or the correction cannot be read.
    """
    asked, correction = parse_spec(spec), Correction.load(folder / "correction")
    path = None if asked.path is None else (folder / asked.path).resolve()
    models: dict[float, Any] = {}

    def corrected(s0: np.ndarray, U: np.ndarray, dt: float, *, context: Context) -> np.ndarray:
        """Corrected simulation."""
        if dt not in models:
            model = make_predictor(replace(asked, path=path))
            models[dt] = model if asked.saved else model.fit(_in_name(context))
        return correction.predict(models[dt], s0, U, dt, context)

    vars(corrected)["fitted_to"] = fitted_to
    return corrected


def _in_name(context: Context) -> Dataset:
    """Data set of one sample, from which a simulation takes sample time, inputs and ship."""
    names = context.inputs
    run = Run("start", np.zeros(1), np.zeros((1, len(STATES))), np.zeros((1, len(names))), names)
    return Dataset("start", context.ship, context.dt, (run,))


def _pushed(s: np.ndarray, psi: np.ndarray, push: np.ndarray, dt: float) -> np.ndarray:
    """States (batch, 10) after a step in which the accelerations `push` (batch, 3) acted besides; psi at its
    beginning."""
    s = s.copy()
    s[:, _SPEEDS] += dt * push
    way = 0.5 * dt**2 * push
    s[:, X] += way[:, 0] * np.cos(psi) - way[:, 1] * np.sin(psi)
    s[:, Y] += way[:, 0] * np.sin(psi) + way[:, 1] * np.cos(psi)
    s[:, PSI] += way[:, 2]
    return s
