"""Errors of a simulation of the user's own, alone and corrected, in open-loop rollouts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...effects.base import EFFECTS
from ...errors import InputError, ShipbenchError
from ...estimation.beside import PUSHES, BesideSimulation
from ...estimation.forward import Segments, cut
from ...estimation.resampling import averaged
from ...predictors.base import learns, make_predictor
from ...predictors.context import Context, predicted
from ...predictors.physics_model.correction import Correction, beside_simulation, correctable
from ...records import Dataset
from ...registry import reason
from ...replay.frame import prediction_notes, turns_against
from ...ship import Ship
from ...signals import MOTION, STATES, R, U, V
from ...specs import Spec
from ..result import Calibrated
from .held_out_gain import FoldErrors, horizon, of_runs

_SPEEDS = (U, V, R)
_LOST = 1e6
"""Error [m] of a position that is not finite."""
_ASKED = 20
"""States of a run from which a simulation steps before it is judged."""


@dataclass(frozen=True, eq=False)
class OwnSimulation:
    """Simulation that a diagnosis judges in place of the ship file's physics.

    Args:
        spec: of the model, as `shipbench run` takes it.
        known: the runs by which a model that learns is fitted.
    """

    spec: Spec
    known: Dataset

    @cached_property
    def model(self) -> Any:
        """The model, fitted where it learns."""
        with _faults_of(self.spec):
            model = make_predictor(self.spec)
            return model if self.spec.saved else model.fit(self.known)

    def __getstate__(self) -> dict[str, Any]:
        """State without the model, whose code another process loads anew."""
        return {"spec": self.spec, "known": self.known}

    def beside(self, dataset: Dataset) -> BesideSimulation:
        """Runs with what the simulation adds to the ship file's physics (`beside_simulation`)."""
        model = self.model
        self._check(dataset)
        with _faults_of(self.spec):
            return beside_simulation(without_pushes(dataset), model)

    def _check(self, dataset: Dataset) -> None:
        """Refuse a simulation whose step from a measured state is in another frame or unit, or does not begin there.

        Raises:
            InputError: with the line that corrects it.
        """
        plain = without_pushes(dataset)
        seen = [(run, k) for run in plain.runs for k in range(0, len(run) - 1, max(1, len(run) // _ASKED))]
        if not seen:
            return
        s0 = np.stack([run.states[k] for run, k in seen])
        held = np.stack([run.inputs[k : k + 1] for run, k in seen])
        context = Context(
            plain.ship, plain.dt, plain.inputs, tuple(run.parent for run, _ in seen),
            np.array([run.t[k] for run, k in seen]), tuple(run.began for run, _ in seen),
        )  # fmt: skip

        def stepped(start: np.ndarray) -> np.ndarray:
            with _faults_of(self.spec):
                return np.asarray(predicted(self.model, start.copy(), held.copy(), None, context), dtype=float)

        S = stepped(s0)
        if S.shape != (len(s0), 1, s0.shape[1]):
            return  # `beside_simulation` says so
        fixed = []
        for column in _SPEEDS:
            other = s0.copy()
            other[:, column] += s0[:, column].std()
            if (other != s0).any() and np.array_equal(stepped(other)[..., column], S[..., column]):
                fixed.append(STATES[column])
        if fixed:
            raise InputError(
                f"the simulation '{self.spec.text}' does not begin at the measured {', '.join(fixed)}: it steps to the "
                "same value from any. A diagnosis steps it from measured states. Accepted: a function that begins at "
                "s0, an FMU with start values in [start] of its mapping, or trajectories: shipbench diagnose "
                f"{plain.name} --predictions FILE"
            )
        runs = [run.slice(k, k + 2) for run, k in seen]
        if notes := prediction_notes(S, runs, plain.ship, plain.dt):
            raise InputError(f"the simulation '{self.spec.text}' does not step from measured states: {notes[0]}")

    def of_training(self, dataset: Dataset, train: Dataset) -> tuple[OwnSimulation, Dataset]:
        """Simulation and `train` as they are where only the runs of `train` are known; `dataset` has all of them."""
        if not learns(self.spec, self.model):
            return self, train
        other = OwnSimulation(self.spec, without_pushes(train))
        return other, other.beside(train)

    def alone(self, dataset: Dataset) -> Rollouts:
        """Rollouts of the simulation as it is."""
        return Rollouts.of(dataset, self, None)

    def corrected(self, dataset: Dataset, correction: Correction) -> Rollouts:
        """Rollouts of the corrected simulation."""
        return Rollouts.of(dataset, self, correction)


@contextmanager
def _faults_of(spec: Spec) -> Iterator[None]:
    """Turn what a stranger's code raises into one message; Ctrl-C passes."""
    try:
        yield
    except ShipbenchError:
        raise
    except (Exception, SystemExit) as error:
        raise InputError(f"the simulation '{spec.text}' fails: {reason(error)}. Correct it.") from error


def its_own() -> tuple[str, ...]:
    """Effects that are not searched: a simulation has actuators of its own, and steps from the measured positions."""
    return tuple(name for name in EFFECTS.names() if EFFECTS.get(name).traits.gear_field)


def without_pushes(dataset: Dataset) -> Dataset:
    """Runs as they were recorded, without the channels of `beside_simulation`."""
    if PUSHES[0] not in dataset.inputs:
        return dataset
    keep = [i for i, name in enumerate(dataset.inputs) if name not in PUSHES]
    names = tuple(dataset.inputs[i] for i in keep)
    runs = tuple(replace(r, inputs=r.inputs[:, keep], inputs_names=names) for r in dataset.runs)
    whole = {f.name: getattr(dataset, f.name) for f in fields(Dataset)}
    return Dataset(**whole | {"runs": runs})


@dataclass(frozen=True, eq=False)
class Rollouts:
    """Open-loop rollouts along the segments `seg` of the averaged record: motion (B, K + 1, 6)."""

    seg: Segments
    motion: np.ndarray

    @classmethod
    def of(cls, dataset: Dataset, simulation: OwnSimulation, correction: Correction | None) -> Rollouts:
        """Rollouts of at most `horizon` seconds from measured states, at the sample time of the record."""
        plain = without_pushes(dataset)
        slow = averaged(plain)
        seg = cut(slow, max(20, round(horizon(dataset.ship.L) / slow.dt)))
        num = round(slow.dt / plain.dt)
        first = num // 2 + num * np.round(seg.start / slow.dt).astype(int)
        steps = num * (seg.states.shape[1] - 1)
        runs = [plain.runs[i] for i in seg.run]
        U = np.stack(
            [r.inputs[np.minimum(np.arange(k, k + steps), len(r) - 1)] for r, k in zip(runs, first, strict=True)]
        )
        context = Context(
            plain.ship, plain.dt, plain.inputs, tuple(r.parent for r in runs),
            np.array([r.t[k] for r, k in zip(runs, first, strict=True)]), tuple(r.began for r in runs),
        )  # fmt: skip
        s0, model = seg.states[:, 0], simulation.model
        with _faults_of(simulation.spec):
            if correction is None:
                S = np.asarray(predicted(model, s0.copy(), U.copy(), None, context), dtype=float)
            else:
                S = correction.predict(model, s0, U, plain.dt, context)
        motion = np.concatenate([s0[:, None, MOTION], S[:, num - 1 :: num, MOTION]], axis=1)
        return cls(seg, motion)

    def said(self, ship: Ship) -> list[str]:
        """Warnings on rollouts in which a simulation has no finite position, or turns to the other side."""
        rates = [
            (mine[m, R], true[m, R]) for mine, true, m in zip(self.motion, self.seg.states, self.seg.mask, strict=True)
        ]
        return [*self._lost(), *turns_against(rates, ship, self.seg.dt)]

    def _lost(self) -> list[str]:
        lost = self.seg.mask & ~np.isfinite(self.motion[..., :2]).all(axis=2)
        rows = lost.any(axis=1)
        if not rows.any():
            return []
        first = self.seg.dt * float(np.min(np.argmax(lost[rows], axis=1)))
        return [
            f"your simulation has no finite position in {int(rows.sum())} of {len(rows)} open-loop rollouts, the "
            f"earliest after {first:g} s. Its error counts as {_LOST / 1e3:g} km there, so its mean error says "
            "nothing. Correct it."
        ]

    @property
    def errors(self) -> np.ndarray:
        """Mean ED [m] of every run (N,), without the initial sample."""
        seg = self.seg
        with np.errstate(all="ignore"):
            ed = np.hypot(*np.moveaxis(self.motion[..., :2] - seg.states[..., :2], -1, 0))
        scored = seg.mask.copy()
        scored[:, 0] = False
        ed = np.where(scored, np.nan_to_num(ed, nan=_LOST, posinf=_LOST), 0.0)
        total, count = (np.bincount(seg.run, v.sum(axis=1), seg.runs) for v in (ed, scored))
        return np.asarray(total / np.maximum(count, 1))


def simulation_fold_errors(
    dataset: Dataset, test: np.ndarray, simulation: OwnSimulation, train: Dataset, causes: Sequence[str]
) -> FoldErrors:
    """Errors of the held-out runs: of the simulation, with the ship's own coefficients, and with the causes besides.

    Args:
        test: indices of the held-out runs of `dataset`.
        train: the other runs, of `beside_simulation`.
        causes: of the training runs.
    """
    held = dataset.subset([int(i) for i in test])
    alone = simulation.alone(held).errors
    own = simulation.corrected(held, Correction.fit(train)).errors
    after = simulation.corrected(held, Correction.fit(train, causes)).errors if causes else own
    return FoldErrors(test, alone, own, after, alone, own)


@dataclass(frozen=True, eq=False)
class Judged:
    """Simulation on the runs that were fitted: its correction, with the causes, and rollouts without and with it."""

    correction: Correction
    alone: Rollouts
    corrected: Rollouts

    @classmethod
    def of(cls, dataset: Dataset, simulation: OwnSimulation, causes: Sequence[str]) -> Judged:
        """Correction fitted to all runs, of `beside_simulation`, with those causes that it can hold."""
        correction = Correction.fit(dataset, correctable(causes))
        return cls(correction, simulation.alone(dataset), simulation.corrected(dataset, correction))

    def calibrated(self, dataset: Dataset, simulation: OwnSimulation, seed: int) -> Calibrated:
        """Errors of the simulation, alone and with the ship's own coefficients."""
        own = self.corrected
        if self.correction.physics.extension is not None:
            own = simulation.corrected(dataset, Correction.fit(dataset))
        return of_runs(dataset, self.alone.errors, own.errors, seed, held_out=False)
