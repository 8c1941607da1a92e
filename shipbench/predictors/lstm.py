"""A recurrent network that rolls itself out: increments of y from a long short-term memory fed with its own
predictions.

Trained free-running on windows that grow in length, on y and on the pose that follows from it. Without history the
memory starts from a network of y at s0; with history the cell first runs over the measured y.

Source: Hochreiter and Schmidhuber (1997), Long short-term memory, Neural Computation 9.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor, nn

from ..records import Dataset
from ..signals import COMMANDS, PSI
from ._features import CHANNELS, InputFeatures
from ._numbers import RATE, ROUNDS, WEIGHT, WIDTH, check_numbers
from ._saved import check_shapes, sample_time
from .base import History, PredictorBase
from .device import check_device
from .networks.stacked import (
    Scaler,
    StackedLinear,
    StackedMLP,
    StackedRuns,
    generators,
    hold_error,
    load_members,
    padded,
    position_score,
    random_windows,
    shares_of,
    trapezoid_pose,
    with_valid,
)
from .networks.training import Chunk, Recipe, StackedTask, train

_Y = 7
_MOST_STEPS = 150


class _Network(nn.Module):
    """Cell, head and initial memory of all members, with their scalers."""

    def __init__(
        self,
        features: InputFeatures,
        hidden: int,
        scalers: tuple[Scaler, Scaler, Scaler],
        draw: Sequence[torch.Generator],
        commanded: bool,
    ) -> None:
        super().__init__()
        self.features, self.commanded = features, commanded
        self.scale_y, self.scale_u, self.scale_dy = scalers
        width = _Y + features.count
        self.initial = StackedMLP([_Y, hidden, 2 * hidden], draw, torch.tanh)
        self.cell = StackedLinear(width + hidden, 4 * hidden, draw)
        self.head = StackedMLP([width + hidden, hidden, _Y], draw, torch.tanh, zero_last=True)

    def memory(self, y: Tensor) -> tuple[Tensor, Tensor]:
        """Hidden and cell state (members, batch, hidden) for a start at y (members, batch, 7)."""
        h, c = self.initial(self.scale_y(y)).chunk(2, dim=-1)
        return torch.tanh(h), c

    def step(
        self, y: Tensor, held: Tensor, psi: Tensor, memory: tuple[Tensor, Tensor]
    ) -> tuple[Tensor, tuple[Tensor, Tensor]]:
        """y at the end of the step and the memory; held (members, batch, inputs), psi (members, batch) [rad]."""
        h, c = memory
        x = torch.cat([self.scale_y(y), self.scale_u(self.features(held, psi))], dim=-1)
        gates = self.cell(torch.cat([x, h], dim=-1))
        keep, write, show, new = gates.chunk(4, dim=-1)
        c = torch.sigmoid(keep + 1.0) * c + torch.sigmoid(write) * torch.tanh(new)  # + 1: remembers to begin with
        h = torch.sigmoid(show) * torch.tanh(c)
        after = y + self.scale_dy.inverse(self.head(torch.cat([x, h], dim=-1)))
        if self.commanded:  # what stands for the actuators then is the command, which is known
            after = torch.cat([after[..., :3], held[..., : len(COMMANDS)]], dim=-1)
        return after, (h, c)

    def rollout(self, past: tuple[Tensor, Tensor], start: Tensor, held: Tensor, dt: float) -> Tensor:
        """y (members, batch, steps, 7) from states start (members, batch, 10).

        Args:
            past: states (members, batch, H, 10) and inputs (members, batch, H, inputs) before the start, H >= 0.
            held: (members, batch, steps, inputs).
            dt: model step [s].
        """
        states, inputs = past
        first = states[:, :, 0] if states.shape[2] else start
        memory = self.memory(first[..., CHANNELS])
        for k in range(states.shape[2]):
            _, memory = self.step(states[:, :, k, CHANNELS], inputs[:, :, k], states[:, :, k, PSI], memory)
        y, psi, path = start[..., CHANNELS], start[..., PSI], []
        for k in range(held.shape[2]):
            before = y
            y, memory = self.step(y, held[:, :, k], psi, memory)
            psi = psi + 0.5 * dt * (before[..., 2] + y[..., 2])
            path.append(y)
        return torch.stack(path, dim=2)


class Stage(NamedTuple):
    """Part of the training: rollout length [model steps], windows per minibatch, number of epochs, longest history
    [steps]."""

    steps: int
    batch: int
    epochs: int
    history: int


class _Rollouts(StackedTask):
    """Free-running rollouts from random starts of random runs; the score is the mean position error of whole validation
    windows [m]."""

    MINIBATCHES = 10
    """Number per epoch."""

    def __init__(self, net: _Network, training: StackedRuns, validation: StackedRuns, stages: Sequence[Stage],
        draw: Sequence[torch.Generator],
                 dt: float, pose_weight: float) -> None:  # fmt: skip
        super().__init__()
        self.net, self.training_runs, self.validation, self.stages, self.draw = net, training, validation, stages, draw
        self.dt, self.pose_weight = dt, pose_weight
        self.members = len(training.counts)
        self.pose_scale = {s.steps: hold_error(training.S, training.counts, dt, s.steps)[:, 3:] for s in stages}

    @property
    def num_chunks(self) -> int:
        """Number of validations."""
        return sum(s.epochs for s in self.stages)

    def _windows(self, stage: Stage, history: int) -> tuple[Tensor, Tensor]:
        """Runs (members, batch) and their samples (members, batch, history + steps + 1): one random window per random
        run."""
        length = history + stage.steps
        runs, starts = random_windows(
            self.training_runs.counts, self.training_runs.steps + 1 - length, stage.batch, self.draw
        )
        return runs, starts[..., None] + torch.arange(length + 1)

    def chunks(self) -> Iterator[Chunk]:
        everyone = torch.ones(self.members, dtype=torch.bool)
        for stage in self.stages:
            for epoch in range(stage.epochs):
                numbers = range(epoch * self.MINIBATCHES, (epoch + 1) * self.MINIBATCHES)
                # Every other minibatch has a history, of a length that goes through its range: the same for all
                # members.
                lengths = [0 if i % 2 == 0 or not stage.history else 1 + (i * 7) % stage.history for i in numbers]
                yield Chunk([(self._windows(stage, length), length, stage.steps) for length in lengths], everyone)

    def losses(self, minibatch: tuple[tuple[Tensor, Tensor], int, int]) -> Tensor:
        rows, history, steps = minibatch
        device = self.device
        run, sample = rows
        S = self.training_runs.S[run[..., None], sample].to(device)
        held = self.training_runs.U[run[..., None], sample[..., :-1]].to(device)
        start, truth = S[:, :, history], S[:, :, history + 1 :]
        y = self.net.rollout((S[:, :, :history], held[:, :, :history]), start, held[:, :, history:], self.dt)
        error = (y - truth[..., CHANNELS]) / self.net.scale_y.std[:, None]
        pose = trapezoid_pose(start, y, self.dt) - truth[..., :3]
        scale = self.pose_scale[steps].to(device)[:, None, None]
        far = (pose[..., :2].square().sum(-1) / scale[..., 0].square()) + pose[..., 2].square() / scale[..., 1].square()
        return error.square().mean((1, 2, 3)) + self.pose_weight * far.mean((1, 2))

    def scores(self) -> Tensor:
        device = self.device
        index, weight = padded(self.validation.counts)
        S, held = self.validation.S[index].to(device), self.validation.U[index].to(device)
        start = S[:, :, 0]
        y = self.net.rollout((S[:, :, :0], held[:, :, :0]), start, held, self.dt)
        return position_score(trapezoid_pose(start, y, self.dt), S[:, :, 1:], weight.to(device))


def thinned(runs: StackedRuns, stride: int) -> StackedRuns:
    """Runs with every `stride`-th sample; inputs as they stand at the beginning of each longer step."""
    steps = runs.steps // stride
    return StackedRuns(runs.S[:, : steps * stride + 1 : stride], runs.U[:, : steps * stride : stride], runs.counts)


@dataclass
class LSTM(PredictorBase):
    """Recurrent network.

    Args:
        hidden: width of the memory and of the head.
        lr: Adam's first step size; a cosine reduces it to a hundredth.
        epochs: number of validations, each after 10 minibatches.
        pose_weight: weight of the pose error (in units of the error of constant velocities) against the error of
            standardised y.
        device: where to train and to predict: "cpu", "cuda" or "cuda:1".
    """

    name: ClassVar[str] = "lstm"
    needs: ClassVar[tuple[str, ...]] = ("torch", "lightning")
    hidden: int = 48
    lr: float = 4e-3
    epochs: int = 140
    pose_weight: float = 1.0
    device: str = "cpu"

    def __post_init__(self) -> None:
        check_device(self.device)
        check_numbers(self, {"hidden": WIDTH, "epochs": ROUNDS, "lr": RATE, "pose_weight": WEIGHT})
        self._weights: dict[str, np.ndarray] = {}
        self._dt, self._stride, self._commanded = 0.0, 1, False
        self.warm_start = False

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return bool(self._weights)

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Train on windows of `train`; `valid` chooses the weights that are kept."""
        type(self).fit_group([self], [train], [valid], [seed])
        return self

    def _stages(self, steps: int) -> list[Stage]:
        """Stages of training, short windows first: they take less time, and their gradients stay small."""
        plan = ((10, 24, 0.5), (30, 24, 0.25), (80, 24, 0.25))
        epochs = shares_of(self.epochs, [share for _, _, share in plan])
        stages = []
        for (length, batch, _), number in zip(plan, epochs, strict=True):
            length = min(length, steps)
            stages.append(Stage(length, batch, number, history=min(max(10, length // 2), steps - length)))
        return [s for s in stages if s.epochs]

    @classmethod
    def fit_group(
        cls, models: Sequence[LSTM], trains: Sequence[Dataset], valids: Sequence[Dataset | None], seeds: Sequence[int]
    ) -> None:
        """Train several (folds, seeds) of the same parameters as one stacked batch, each with the result of a separate
        fit."""
        lead, dt, names = models[0], trains[0].dt, trains[0].inputs
        pairs = [with_valid(t, v, s) for t, v, s in zip(trains, valids, seeds, strict=True)]
        training, validation = StackedRuns.of([t for t, _ in pairs]), StackedRuns.of([v for _, v in pairs])
        stride = -(-training.steps // _MOST_STEPS)
        training, validation = thinned(training, stride), thinned(validation, stride)
        features, draw = InputFeatures(names), generators(seeds)
        parts = training.members()
        scalers = (
            Scaler.fit(S[..., CHANNELS] for S, _ in parts),
            Scaler.fit(features(held, S[:, :-1, PSI]) for S, held in parts),
            Scaler.fit((S[:, 1:, CHANNELS] - S[:, :-1, CHANNELS] for S, _ in parts), centred=False),
        )
        commanded = trains[0].actuators == "commanded"
        net = _Network(features, lead.hidden, scalers, draw, commanded)
        if lead.warm_start:  # with the scales of the first fit, in which its weights are
            load_members(net, [m._weights for m in models])
        task = _Rollouts(net, training, validation, lead._stages(training.steps), draw, dt * stride, lead.pose_weight)
        # one thread: in hundreds of small dependent steps threads mostly wait for each other
        train(task, Recipe(lr=lead.lr, lr_end=0.01, chunks=task.num_chunks, clip=1.0, device=lead.device, threads=1))
        state = {k: v.detach().cpu().numpy() for k, v in net.state_dict().items()}
        for m, model in enumerate(models):
            model.inputs, model._dt, model._stride, model._commanded = names, dt, stride, commanded
            model._weights = {k: v[m : m + 1].copy() for k, v in state.items()}

    def _network(self) -> _Network:
        """Fitted network of this one member in float64."""
        w = {k: torch.as_tensor(v, dtype=torch.float64) for k, v in self._weights.items()}
        y, u, dy = (Scaler(w[f"scale_{k}.mean"], w[f"scale_{k}.std"]) for k in ("y", "u", "dy"))
        net = _Network(InputFeatures(self.inputs), self.hidden, (y, u, dy), generators([0]), self._commanded).double()
        net.load_state_dict(w)
        return net.to(self.device)

    @torch.no_grad()
    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        net, d, K = self._network(), self._stride, U.shape[1]
        start, held = (torch.as_tensor(known, device=self.device)[None] for known in (s0, U[:, ::d]))
        past = (start[:, :, None][:, :, :0], held[:, :, :0])
        if history is not None and len(history[0][0]) >= d:
            first = len(history[0][0]) % d  # the samples d, 2 d, .. steps before s0
            states, inputs = (
                torch.as_tensor(known[:, first::d], dtype=torch.float64, device=self.device)[None] for known in history
            )
            past = (states, inputs)
        y = net.rollout(past, start, held, d * self._dt)[0]
        if d > 1:
            y = _between(start[0, :, CHANNELS], y, d)[:, :K]
        return torch.cat([trapezoid_pose(start[0], y, self._dt), y], dim=-1).cpu().numpy()

    def _arrays(self) -> dict[str, np.ndarray]:
        return self._weights

    def _meta(self) -> dict[str, Any]:
        return {"dt": self._dt, "stride": self._stride, "commanded": self._commanded}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        sizes = (("y", _Y), ("u", InputFeatures(self.inputs).count), ("dy", _Y))
        check_shapes(arrays, {f"scale_{k}.{what}": (1, 1, size) for k, size in sizes for what in ("mean", "std")})
        check_shapes(
            arrays, {"initial.layers.0.weight": (1, _Y, self.hidden)}
        )  # before a network of that width is made
        self._weights, self._dt = arrays, sample_time(meta)
        self._stride, self._commanded = int(meta["stride"]), bool(meta["commanded"])
        if self._stride < 1:
            raise ValueError(f"stride = {self._stride}; accepted: 1 or more")
        self._network()


def _between(y0: Tensor, y: Tensor, stride: int) -> Tensor:
    """Linear interpolation to `stride` samples per model step: y (batch, steps, 7) at the ends of steps -> (batch,
    steps * stride, 7)."""
    before = torch.cat([y0[:, None], y[:, :-1]], dim=1)
    share = torch.arange(1, stride + 1, dtype=y.dtype, device=y.device)[:, None] / stride
    return (before[:, :, None] + share * (y - before)[:, :, None]).flatten(1, 2)


PREDICTOR = LSTM
