"""A fitted physics plus a learned residual acceleration, trained through the solver of torchdiffeq on windows that
grow in length.

The residual is a small network of (u, v, r, n, delta, F_b, F_s), and of the velocity through the air where wind is
measured, whose output starts at exactly zero: training starts at the fitted physics and the weights of the best
validation rollout are kept, the untouched physics among them. On `calibrated` the residual acts only where its
gain exceeds its standard error over the validation runs.

Source: Chen et al. (2018), Neural ordinary differential equations, NeurIPS 31.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor

from ..effects.base import EFFECTS
from ..errors import InputError
from ..integrate import motion_rhs, rk4_step
from ..records import Dataset
from ..signals import ACTUATORS, MOTION, R, U
from ..specs import EffectSpec
from ._numbers import RATE, ROUNDS, WEIGHT, WIDTH, check_numbers
from ._saved import check_shapes
from .base import History, PredictorBase
from .calibrated import Calibrated
from .device import check_device
from .networks.residual import Drive, Grid, Residual, features, solve, typical_accelerations
from .networks.stacked import (
    Scaler,
    generators,
    hold_error,
    padded,
    position_errors,
    position_score,
    random_windows,
    shares_of,
    trapezoid_pose,
    with_valid,
)
from .networks.training import Chunk, Recipe, StackedTask, train
from .physics import Physics
from .physics_model.fit_report import FitReport
from .physics_model.fitted_ship import FittedShip

BASES: dict[str, type[FittedShip]] = {"physics": Physics, "calibrated": Calibrated}
"""Fitted physics that a residual may be added to."""
MARGINS = {"physics": 0.0, "calibrated": 1.0}
"""Standard errors over the validation runs that the gain of a residual has to exceed, by the base. `physics` lacks
known forces; beside `calibrated` the rule is that of its own refinement."""


class Stage(NamedTuple):
    """Part of the training: window length [model steps], windows per minibatch, number of epochs."""

    steps: int
    batch: int
    epochs: int


class _Windows(StackedTask):
    """Windows from random starts; the score is the mean position error of the validation rollouts over their full
    length [m]."""

    MINIBATCHES = 20
    """Number per epoch."""

    def __init__(self, model: Residual, training: Drive, validation: Drive, grid: Grid, stages: Sequence[Stage],
        draw: Sequence[torch.Generator],
                 penalty: float) -> None:  # fmt: skip
        super().__init__()
        self.model, self.training_runs, self.validation, self.grid, self.stages = (
            model,
            training,
            validation,
            grid,
            stages,
        )
        self.draw, self.penalty, self.members = draw, penalty, len(training.counts)
        self.first: Tensor | None = None  # errors of the base on the validation runs
        self.dt = grid.step * grid.per_knot
        self.scale = {s.steps: hold_error(training.S, training.counts, self.dt, s.steps) for s in stages}

    @property
    def num_chunks(self) -> int:
        """Number of validations."""
        return 1 + sum(s.epochs for s in self.stages)

    def chunks(self) -> Iterator[Chunk]:
        everyone = torch.ones(self.members, dtype=torch.bool)
        yield Chunk([], everyone)  # the physics as it is: what any training has to beat
        knots = self.training_runs.S.shape[1] - 1
        for stage in self.stages:
            room = knots - stage.steps + 1
            for _ in range(stage.epochs):
                picks = (
                    random_windows(self.training_runs.counts, room, stage.batch, self.draw)
                    for _ in range(self.MINIBATCHES)
                )
                yield Chunk([(runs, starts, stage.steps) for runs, starts in picks], everyone)

    def _roll(
        self, drive: Drive, runs: Tensor, starts: Tensor, steps: int
    ) -> tuple[Tensor, Tensor, Tensor, Tensor | None]:
        """Predicted u, v, r (members, batch, steps, 3) and pose, measured states and wind at the end, of windows at
        `starts` [model steps]."""
        device, fine = self.model.p.device, self.grid.per_knot
        S = drive.S[runs[..., None], starts[..., None] + torch.arange(steps + 1)].to(device)
        at = (runs[..., None], starts[..., None] * fine + torch.arange(steps * fine))
        air = None if drive.air is None else drive.air[at].to(device)
        path = solve(self.model, S[:, :, 0], drive.path[at].to(device), air, self.grid.step)[:, :, fine - 1 :: fine]
        return path, trapezoid_pose(S[:, :, 0], path, self.dt), S[:, :, 1:], None if air is None else air[:, :, -1]

    def losses(self, minibatch: tuple[Tensor, Tensor, int]) -> Tensor:
        velocity, pose, truth, air = self._roll(self.training_runs, *minibatch)
        scale = self.scale[minibatch[2]].to(truth.device)[:, None, None]
        error = ((velocity - truth[..., U : R + 1]) / scale[..., :3]).square().sum(-1)
        error = error + ((pose[..., :2] - truth[..., :2]) / scale[..., 3:4]).square().sum(-1)
        error = error + ((pose[..., 2] - truth[..., 2]) / scale[..., 4]).square()
        small = self.model.learned(features(truth[:, :, -1], air)).square().sum(-1)
        return error.mean((1, 2)) + self.penalty * small.mean(1)

    def scores(self) -> Tensor:
        pose, truth, weight = self._validated()
        if self.first is None:
            self.first = position_errors(pose, truth).detach().cpu()
        return position_score(pose, truth, weight)

    def _validated(self) -> tuple[Tensor, Tensor, Tensor]:
        """Predicted and measured pose of the validation runs, and the runs' weights."""
        runs, weight = padded(self.validation.counts)
        _, pose, truth, _ = self._roll(self.validation, runs, torch.zeros_like(runs), self.validation.S.shape[1] - 1)
        return pose, truth, weight.to(pose.device)

    @torch.no_grad()
    def pays(self, margin: float) -> list[bool]:
        """Whether the gain of each member over its base exceeds `margin` standard errors over the validation runs; any
        gain counts where there is a single run."""
        if self.first is None:
            return [False] * self.members
        pose, truth, _ = self._validated()
        gains = self.first - position_errors(pose, truth).cpu()
        found = []
        for gain, count in zip(gains, self.validation.counts, strict=True):
            error = float(gain[:count].std()) / count**0.5 if count > 1 else 0.0
            found.append(float(gain[:count].mean()) > margin * error)
        return found


@dataclass
class NeuralODE(PredictorBase):
    """Physics plus learned residual accelerations.

    Args:
        base: the fitted physics, "physics" or "calibrated"; its coefficients stay fixed while the residual is trained.
        hidden: width of the two hidden layers.
        lr: Adam's first step size (a cosine reduces it to a fiftieth).
        epochs: number of validations, each after 20 minibatches.
        penalty: weight of the squared residual, in units of the typical accelerations.
        weight_decay: of AdamW.
        device: where to train and to predict: "cpu", "cuda" or "cuda:1".
    """

    name: ClassVar[str] = "neural_ode"
    needs: ClassVar[tuple[str, ...]] = ("torch", "lightning", "torchdiffeq")
    base: str = "physics"
    hidden: int = 32
    lr: float = 5e-3
    epochs: int = 40
    penalty: float = 1e-4
    weight_decay: float = 1e-3
    device: str = "cpu"

    def __post_init__(self) -> None:
        check_device(self.device)
        if self.base not in tuple(BASES):
            raise ValueError(f"base = {self.base!r}; accepted: {', '.join(BASES)}")
        check_numbers(self, {"hidden": WIDTH, "epochs": ROUNDS, "lr": RATE, "penalty": WEIGHT, "weight_decay": WEIGHT})
        self.physics: FittedShip = BASES[self.base]()
        self.effects: tuple[EffectSpec, ...] = ()
        self._weights: dict[str, np.ndarray] = {}
        self.improved = False
        """Whether the trained residual pays on validation runs (`MARGINS`); otherwise the predictions are those of the
        physics alone."""

    def extend(self, effects: Sequence[EffectSpec]) -> Self:
        """Add effects to the physics (`neural_ode+race_gain`), as in `Physics.extend`.

        Raises:
            InputError: an effect is unknown, acts on the sensors, or depends on place or time, which the training
                windows do not know.
        """
        self.physics = BASES[self.base]().extend(effects)
        for effect in effects:
            part = EFFECTS.get(effect.name)
            if part.traits.local or part.enters == "sensor":
                raise InputError(
                    f"effect '{effect.name}' cannot extend neural_ode: it acts on the sensors, or at a place or time. "
                    f"Accepted: effects that act as forces or on actuators. Write {self.base}+{effect.name}, or "
                    "correct the data."
                )
        self.effects = tuple(effects)
        return self

    @property
    def report(self) -> FitReport | None:
        """Report of the physics' fit on its own runs."""
        return self.physics.report

    def skip(self, dataset: Dataset) -> str | None:
        """Reason why the physics, and so this model, cannot take `dataset`; or None."""
        return self.physics.skip(dataset)

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return bool(self._weights)

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Fit the physics on `train` and `valid`, train the residual on `train`; `valid` selects the weights."""
        type(self).fit_group([self], [train], [valid], [seed])
        return self

    def _stages(self, knots: int) -> list[Stage]:
        """Stages of training: short windows first, in large batches, which take less time and keep gradients small;
        then long ones."""
        plan = ((1, 1024, 0.4), (10, 384, 0.25), (30, 192, 0.3), (100, 64, 0.05))
        epochs = shares_of(self.epochs, [share for _, _, share in plan])
        return [Stage(min(steps, knots), batch, n) for (steps, batch, _), n in zip(plan, epochs, strict=True) if n]

    @classmethod
    def fit_group(
        cls,
        models: Sequence[NeuralODE],
        trains: Sequence[Dataset],
        valids: Sequence[Dataset | None],
        seeds: Sequence[int],
    ) -> None:
        """Fit the physics of each, then train all residuals as one stacked batch, each with the result of a separate
        fit."""
        lead = models[0]
        pairs = [with_valid(t, v, s) for t, v, s in zip(trains, valids, seeds, strict=True)]
        for model, (training, validation), seed in zip(models, pairs, seeds, strict=True):
            model.inputs = training.inputs
            model.physics = BASES[model.base]()
            if model.effects:
                model.physics.extend(model.effects)
            model.physics.fit(training, validation, seed=seed)
            if model.physics.shallow:
                raise InputError(
                    f"neural_ode[base={model.base}] cannot be trained on '{training.name}': its base depends on the "
                    f"measured water depth, which the residual does not know. Accepted: data in deep water, or "
                    f"without the channel depth. Write {model.base}, or neural_ode."
                )
        physics = [m.physics for m in models]
        grid = Grid.of(physics[0])
        learn, check = (Drive.of(physics, part, grid) for part in zip(*pairs, strict=True))
        draw = generators(seeds)
        seen = (
            features(learn.S, None) if learn.air is None else features(learn.S[:, :-1], learn.air[:, :: grid.per_knot])
        )
        scale_in = Scaler.fit(seen.split(learn.counts))
        residual = Residual(physics, lead.hidden, scale_in, typical_accelerations(physics, learn), draw)
        task = _Windows(residual, learn, check, grid, lead._stages(learn.S.shape[1] - 1), draw, lead.penalty)
        # one thread: in small elementwise operations threads mostly wait for each other
        recipe = Recipe(
            lead.lr,
            clip=1.0,
            weight_decay=lead.weight_decay,
            chunks=task.num_chunks,
            lr_end=0.02,
            device=lead.device,
            threads=1,
        )
        train(task, recipe)
        pays = task.pays(MARGINS[lead.base])
        state = {k: v.detach().cpu().numpy() for k, v in residual.state_dict().items()}
        for m, model in enumerate(models):
            model._weights = {
                k: v[:, m : m + 1].copy() if k in ("p", "q") else v[m : m + 1].copy() for k, v in state.items()
            }
            model.improved = pays[m]

    def _residual(self) -> Residual:
        """Fitted accelerations of this one member in float64."""
        w = {k: torch.as_tensor(v, dtype=torch.float64) for k, v in self._weights.items()}
        scale_in = Scaler(w["scale_in.mean"], w["scale_in.std"])
        model = Residual([self.physics], self.hidden, scale_in, w["scale_out"], generators([0])).double()
        model.load_state_dict({**w, "p": model.p, "q": model.q})
        return model.to(self.device)

    @torch.no_grad()
    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        base = self.physics
        if not self.improved:
            return base._rollout(s0, U, history)
        model, air = self._residual(), base._wind(U)
        path = torch.as_tensor(base.actuator_path(s0, U), device=self.device).permute(1, 2, 3, 0)[:, :, :, None]
        wind = None if air is None else torch.as_tensor(air, device=self.device).permute(1, 2, 0)[:, :, None]
        motion = tuple(torch.as_tensor(s0[:, MOTION], device=self.device).T[:, None])
        S = np.empty((len(s0), U.shape[1], s0.shape[1]))
        for j in range(path.shape[0]):
            k = j // base.substeps

            def acc(psi, u, v, r, stage, j=j, k=k):
                return model(psi, u, v, r, path[j, stage].unbind(0), None if wind is None else (wind[k, 0], wind[k, 1]))

            motion = rk4_step(motion_rhs(acc), motion, base.dt / base.substeps)
            S[:, k, MOTION] = torch.cat(motion).T.cpu().numpy()
        S[:, :, ACTUATORS] = path[base.substeps - 1 :: base.substeps, 2, :, 0].permute(2, 0, 1).cpu().numpy()
        return S

    def _arrays(self) -> dict[str, np.ndarray]:
        return {**{f"physics.{k}": v for k, v in self.physics._arrays().items()}, **self._weights}

    def _meta(self) -> dict[str, Any]:
        return {"physics": self.physics._meta(), "improved": self.improved}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        self.physics.inputs = self.inputs
        self.physics._restore({k[8:]: v for k, v in arrays.items() if k.startswith("physics.")}, meta["physics"])
        self.effects = tuple(EffectSpec(e["name"], e["params"]) for e in meta["physics"].get("effects", []))
        self._weights = {k: v for k, v in arrays.items() if not k.startswith("physics.")}
        self.improved = bool(meta["improved"])
        size = 7 + 2 * bool(self.physics._wind_columns())
        check_shapes(arrays, {"scale_in.mean": (1, 1, size), "scale_in.std": (1, 1, size), "scale_out": (1, 1, 3)})
        check_shapes(arrays, {"net.layers.0.weight": (1, size, self.hidden)})  # before a network of that width is made
        self._residual()


PREDICTOR = NeuralODE
