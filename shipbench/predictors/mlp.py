"""The paper's multilayer perceptron: y and the commands at k -> y at k + 1, pose by eq. (10) to (14).

y = [u, v, r, n, delta, F_b, F_s]; three hidden layers of 100, ReLU, mean squared error on standardised data, Adam 1e-3,
batch 32, at most 200 epochs, stop when validation does not improve by 1e-4 for 10 epochs.

Source: the source paper, eq. (10) to (14).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, Self

import numpy as np
import torch
from torch import Tensor

from ..records import Dataset
from ._features import InputFeatures
from ._numbers import LAYERS, RATE, ROUNDS, WEIGHT, WIDTH, check_numbers
from ._one_step import NUM_CHANNELS, check_target, one_step_rollout, transitions
from ._saved import check_shapes, sample_time
from .base import History, PredictorBase
from .device import check_device
from .networks.stacked import Scaler, StackedMLP, StackedRuns, generators, load_members, padded, with_valid
from .networks.training import Chunk, Recipe, StackedTask, epochs_of_samples, train

_GATHERED, _SCORED = 256, 16384
"""Minibatches that are gathered, and samples of a member that are scored, at a time."""


class _OneStep(StackedTask):
    """Standardised one-step regression of all members."""

    def __init__(self, models: Sequence[MLP], training: list[Any], validation: list[Any], seeds: Sequence[int]) -> None:
        super().__init__()
        model = models[0]
        self.members, self.epochs, self.batch = len(seeds), model.epochs, model.batch
        self.increment = model.target == "increment"
        self.draw = generators(seeds)
        self.scale_x = Scaler.fit(torch.cat([y, inputs], dim=-1) for y, inputs, _ in training)
        self.scale_z = Scaler.fit(self._target(y, after) for y, _, after in training)
        sizes = [NUM_CHANNELS + training[0][1].shape[-1], *[model.hidden] * model.layers, NUM_CHANNELS]
        self.net = StackedMLP(sizes, self.draw)
        if model.warm_start:  # with the scales of the first fit, in which its weights are
            load_members(self, [m._weights for m in models])
        self.counts = [len(y) for y, _, _ in training]
        self.data = self._standardised(training)
        self.valid = self._standardised(validation)
        self.valid_rows = padded([len(y) for y, _, _ in validation])

    def _target(self, y: Tensor, after: Tensor) -> Tensor:
        return after - y if self.increment else after

    def _standardised(self, parts: list[Any]) -> tuple[Tensor, Tensor]:
        """Standardised x and z of all members, one member after another."""
        counts = [len(y) for y, _, _ in parts]
        x, z = (torch.empty(sum(counts), scale.mean.shape[-1]) for scale in (self.scale_x, self.scale_z))
        for m, ((y, inputs, after), x_m, z_m) in enumerate(zip(parts, x.split(counts), z.split(counts), strict=True)):
            x_m.copy_((torch.cat([y, inputs], dim=-1) - self.scale_x.mean[m]) / self.scale_x.std[m])
            z_m.copy_((self._target(y, after) - self.scale_z.mean[m]) / self.scale_z.std[m])
        return x, z

    def chunks(self) -> Iterator[Chunk]:
        device = self.device
        x, z = (part.to(device) for part in self.data)
        first = torch.tensor([0, *np.cumsum(self.counts)[:-1].tolist()])
        for index, ended in epochs_of_samples(self.counts, self.batch, self.epochs, self.draw):
            yield Chunk(self._gathered(x, z, (index + first[:, None]).to(device)), ended)

    @staticmethod
    def _gathered(x: Tensor, z: Tensor, rows: Tensor) -> Iterator[tuple[Tensor, Tensor]]:
        """Minibatches of `rows` (steps, members, batch), gathered many at a time. A step then needs no indexing, an
        epoch no second copy."""
        for some in rows.split(_GATHERED):
            flat, shape = some.flatten(), (*some.shape, -1)
            yield from zip(x[flat].view(shape).unbind(0), z[flat].view(shape).unbind(0), strict=True)

    def losses(self, minibatch: tuple[Tensor, Tensor]) -> Tensor:
        x, z = minibatch
        return (self.net(x) - z).square().mean((1, 2))

    def scores(self) -> Tensor:
        device = self.device
        x, z = (part.to(device) for part in self.valid)
        rows, weight = (part.to(device) for part in self.valid_rows)
        errors = [(self.net(x[some]) - z[some]).square().mean(2) for some in rows.split(_SCORED, dim=1)]
        return (torch.cat(errors, dim=1) * weight).sum(1)


@dataclass
class MLP(PredictorBase):
    """Multilayer perceptron of the source paper.

    Args:
        hidden, layers: width and number of the hidden layers.
        epochs, batch, lr, patience, min_delta: training, as in the paper.
        target: "state" predicts y at k + 1 as the paper does; "increment" predicts y_k+1 - y_k, a stronger variant.
        device: where to train and to predict: "cpu", "cuda" or "cuda:1".
    """

    name: ClassVar[str] = "mlp"
    needs: ClassVar[tuple[str, ...]] = ("torch", "lightning")
    hidden: int = 100
    layers: int = 3
    epochs: int = 200
    batch: int = 32
    lr: float = 1e-3
    patience: int = 10
    min_delta: float = 1e-4
    target: str = "state"
    device: str = "cpu"

    def __post_init__(self) -> None:
        check_device(self.device)
        check_target(self.target)
        check_numbers(
            self,
            {
                "hidden": WIDTH,
                "layers": LAYERS,
                "epochs": ROUNDS,
                "batch": ROUNDS,
                "patience": ROUNDS,
                "lr": RATE,
                "min_delta": WEIGHT,
            },
        )
        self._weights: dict[str, np.ndarray] = {}
        self._dt = 0.0
        self._epochs_run = 0
        self.warm_start = False

    @property
    def fitted(self) -> bool:
        """Whether it can predict."""
        return bool(self._weights)

    def fit(self, train: Dataset, valid: Dataset | None = None, *, seed: int = 0) -> Self:
        """Train on the transitions of `train`; `valid` stops it."""
        type(self).fit_group([self], [train], [valid], [seed])
        return self

    @classmethod
    def fit_group(
        cls, models: Sequence[MLP], trains: Sequence[Dataset], valids: Sequence[Dataset | None], seeds: Sequence[int]
    ) -> None:
        """Train several (folds, seeds) of the same parameters as one stacked batch, each with the result of a separate
        fit."""
        lead = models[0]
        pairs = [with_valid(t, v, s) for t, v, s in zip(trains, valids, seeds, strict=True)]
        names = trains[0].inputs
        features = InputFeatures(names)
        # Not bound to names: the samples as they are would otherwise be kept beside the standardised ones.
        trained, stopped = zip(*pairs, strict=True)
        task = _OneStep(models, _samples(trained, features), _samples(stopped, features), seeds)
        # one thread: with matrices this small threads mostly wait for each other
        watch = train(
            task,
            Recipe(
                lr=lead.lr,
                patience=lead.patience,
                min_delta=lead.min_delta,
                device=lead.device,
                threads=1,
                epochs=lead.epochs,
            ),
        )
        state = {k: v.detach().cpu().numpy() for k, v in task.state_dict().items()}
        for m, model in enumerate(models):
            model.inputs, model._dt = names, trains[m].dt
            model._weights = {k: v[m : m + 1].copy() for k, v in state.items()}
            model._epochs_run = int(watch.validations[m])

    @torch.no_grad()
    def _rollout(self, s0: np.ndarray, U: np.ndarray, history: History | None) -> np.ndarray:
        w = {k: torch.as_tensor(v, dtype=torch.float64, device=self.device) for k, v in self._weights.items()}
        layers = [(w[f"net.layers.{i}.weight"][0], w[f"net.layers.{i}.bias"][0]) for i in range(self.layers + 1)]

        def step(x: Tensor) -> Tensor:
            h = (x - w["scale_x.mean"][0]) / w["scale_x.std"][0]
            for weight, bias in layers[:-1]:
                h = torch.relu(torch.addmm(bias, h, weight))
            return torch.addmm(layers[-1][1], h, layers[-1][0]) * w["scale_z.std"][0] + w["scale_z.mean"][0]

        start, held = (torch.as_tensor(known, device=self.device) for known in (s0, U))
        S = one_step_rollout(
            step, start, held, InputFeatures(self.inputs), self._dt, increment=self.target == "increment"
        )
        return S.cpu().numpy()

    def _arrays(self) -> dict[str, np.ndarray]:
        return self._weights

    def _meta(self) -> dict[str, Any]:
        return {"dt": self._dt, "epochs_run": self._epochs_run}

    def _restore(self, arrays: dict[str, np.ndarray], meta: dict[str, Any]) -> None:
        sizes = [NUM_CHANNELS + InputFeatures(self.inputs).count, *[self.hidden] * self.layers, NUM_CHANNELS]
        shapes = {f"net.layers.{i}.weight": (1, *pair) for i, pair in enumerate(pairwise(sizes))}
        shapes |= {f"net.layers.{i}.bias": (1, 1, size) for i, size in enumerate(sizes[1:])}
        shapes |= {
            f"scale_{k}.{what}": (1, 1, size)
            for k, size in (("x", sizes[0]), ("z", sizes[-1]))
            for what in ("mean", "std")
        }
        check_shapes(arrays, shapes)
        self._weights, self._dt, self._epochs_run = arrays, sample_time(meta), int(meta["epochs_run"])


def _samples(datasets: Sequence[Dataset], features: InputFeatures) -> list[tuple[Tensor, Tensor, Tensor]]:
    """Transitions of every member, by `transitions`."""
    return [transitions(S, U, features) for S, U in StackedRuns.of(datasets).members()]


PREDICTOR = MLP
