"""Building blocks of stacked networks: data, scalers and layers with a leading member axis (folds and seeds of one
network).

Every layer is one batched matrix product: the run time of small networks on a CPU is mostly overhead.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from ...records import Dataset
from ...signals import PSI, R, U, X, Y


def generators(seeds: Sequence[int]) -> list[torch.Generator]:
    """Random generators, one per member: draws of a member do not depend on the others."""
    return [torch.Generator().manual_seed(int(seed)) for seed in seeds]


def with_valid(train: Dataset, valid: Dataset | None, seed: int) -> tuple[Dataset, Dataset]:
    """Training and validation data; without `valid`, a tenth of the training runs (at least one) is set aside, drawn
    from `seed`.

    A single training run serves as both, since nothing can be set aside.
    """
    if valid is not None:
        return train, valid
    if len(train) == 1:
        return train, train
    order = np.random.default_rng(seed).permutation(len(train))
    cut = max(1, round(0.1 * len(train)))
    return train.subset(sorted(order[cut:])), train.subset(sorted(order[:cut]))


@dataclass(frozen=True)
class StackedRuns:
    """Runs of all members, one member after another.

    Args:
        S: (runs, K + 1, 10) states; U: (runs, K, inputs) held inputs.
        counts: number of runs of each member.
    """

    S: Tensor
    U: Tensor
    counts: tuple[int, ...]

    @classmethod
    def of(cls, datasets: Sequence[Dataset], dtype: torch.dtype = torch.float32) -> StackedRuns:
        """Stack data sets whose runs are equally long."""
        states, held = [], []
        for data in datasets:  # one at a time: folds of a large data set in float64 would stand side by side
            batch = data.batch()
            states.append(torch.as_tensor(np.concatenate([batch.s0[:, None], batch.truth], axis=1), dtype=dtype))
            held.append(torch.as_tensor(batch.U, dtype=dtype))
        return cls(torch.cat(states), torch.cat(held), tuple(len(s) for s in states))

    def members(self) -> list[tuple[Tensor, Tensor]]:
        """States S and inputs U of every member."""
        return list(zip(self.S.split(self.counts), self.U.split(self.counts), strict=True))

    @property
    def steps(self) -> int:
        """Number of steps K of every run."""
        return self.U.shape[1]


def padded(counts: Sequence[int]) -> tuple[Tensor, Tensor]:
    """Indices of all members' items (members, most), repeated where a member has fewer, and weights (members, most)
    that sum to 1 per member."""
    most, first = max(counts), 0
    index, weight = [], []
    for count in counts:
        index.append(first + torch.arange(most) % count)
        weight.append((torch.arange(most) < count) / count)
        first += count
    return torch.stack(index), torch.stack(weight)


class Scaler(nn.Module):
    """Mean and standard deviation per member (members, 1, features); a constant feature keeps scale 1."""

    mean: Tensor
    std: Tensor

    def __init__(self, mean: Tensor, std: Tensor) -> None:
        super().__init__()
        self.register_buffer("mean", mean)
        self.register_buffer("std", std)

    @classmethod
    def fit(cls, samples: Iterable[Tensor], centred: bool = True) -> Scaler:
        """Scaler from each member's training samples (..., features); `centred=False` keeps zero at zero (for
        increments)."""
        found = []
        for part in samples:
            flat = part.reshape(-1, part.shape[-1]).double()
            spread = flat.std(0, keepdim=True, correction=0) if centred else flat.square().mean(0, keepdim=True).sqrt()
            found.append((flat.mean(0, keepdim=True), spread))
            dtype = part.dtype
        mean, spread = (torch.stack(parts) for parts in zip(*found, strict=True))
        # A channel that does not move up to round-off has nothing to be scaled by.
        still = spread <= 1e-9 * (mean.abs() + 1e-12)
        return cls((mean if centred else torch.zeros_like(mean)).to(dtype), torch.where(still, 1.0, spread).to(dtype))

    def forward(self, x: Tensor) -> Tensor:
        """Standardised `x` (members, batch, features)."""
        return (x - self.mean) / self.std

    def inverse(self, z: Tensor) -> Tensor:
        """Values `z` in the units of the samples."""
        return z * self.std + self.mean


class StackedLinear(nn.Module):
    """Linear layer (`torch.nn.Linear`) for every member: weight (members, inputs, outputs), bias (members, 1, outputs),
    same initial values per seed."""

    def __init__(self, inputs: int, outputs: int, draw: Sequence[torch.Generator], zero: bool = False) -> None:
        super().__init__()
        bound = 1.0 / math.sqrt(inputs)
        weights, biases = [], []
        for g in draw:  # weight before bias, as nn.Linear.reset_parameters draws them
            weights.append(torch.empty(outputs, inputs).uniform_(-bound, bound, generator=g).T)
            biases.append(torch.empty(1, outputs).uniform_(-bound, bound, generator=g))
        scale = 0.0 if zero else 1.0
        self.weight = nn.Parameter(scale * torch.stack(weights).contiguous())
        self.bias = nn.Parameter(scale * torch.stack(biases))

    def forward(self, x: Tensor) -> Tensor:
        """Outputs (members, batch, outputs) of inputs (members, batch, inputs)."""
        return torch.baddbmm(self.bias, x, self.weight)


def load_members(module: nn.Module, weights: Sequence[Mapping[str, np.ndarray]]) -> None:
    """Put the saved weights of every member, (1, ...) each, into a stacked module: a warm start."""
    module.load_state_dict({name: torch.as_tensor(np.concatenate([w[name] for w in weights])) for name in weights[0]})


class StackedMLP(nn.Module):
    """Fully connected layers of `sizes`; `zero_last` starts with an output of exactly zero."""

    def __init__(
        self,
        sizes: Sequence[int],
        draw: Sequence[torch.Generator],
        activation: Any = torch.relu,
        zero_last: bool = False,
    ) -> None:
        super().__init__()
        last = len(sizes) - 2
        pairs = list(pairwise(sizes))
        self.layers = nn.ModuleList(
            StackedLinear(a, b, draw, zero=zero_last and i == last) for i, (a, b) in enumerate(pairs)
        )
        self.activation = activation

    def forward(self, x: Tensor) -> Tensor:
        """Outputs (members, batch, sizes[-1]) of inputs (members, batch, sizes[0])."""
        for layer in self.layers[:-1]:
            x = self.activation(layer(x))
        return self.layers[-1](x)


def trapezoid_pose(s0: Tensor, y: Tensor, dt: float) -> Tensor:
    """Pose (..., K, 3) by the trapezoidal rule, second order in dt (eq. (10) is first order); arguments as
    `_features.dead_reckoning`."""
    path = torch.cat([s0[..., None, U : R + 1], y[..., :3]], dim=-2)
    turned = 0.5 * dt * torch.cumsum(path[..., 1:, 2] + path[..., :-1, 2], dim=-1)
    psi = s0[..., None, PSI] + torch.cat([torch.zeros_like(turned[..., :1]), turned], dim=-1)
    cos, sin = torch.cos(psi), torch.sin(psi)
    rates = torch.stack([path[..., 0] * cos - path[..., 1] * sin, path[..., 0] * sin + path[..., 1] * cos], dim=-1)
    moved = 0.5 * dt * torch.cumsum(rates[..., 1:, :] + rates[..., :-1, :], dim=-2)
    return torch.cat([s0[..., None, X : Y + 1] + moved, psi[..., 1:, None]], dim=-1)


def hold_error(S: Tensor, counts: Sequence[int], dt: float, steps: int) -> Tensor:
    """Root mean square error (members, 5) of u, v, r, position [m] and heading [rad] over `steps` steps of constant
    velocities.

    S: (runs, samples, 10) of all members; dt: time between samples [s]. The error is the size of the changes to
    predict.
    """
    start, truth = S[:, 0], S[:, 1 : steps + 1]
    kept = start[:, None, U : R + 1].expand(-1, steps, -1)
    pose = trapezoid_pose(start, kept, dt) - truth[..., :3]
    square = torch.cat(
        [(kept - truth[..., U : R + 1]).square(), pose[..., :2].square().sum(-1, keepdim=True), pose[..., 2:].square()],
        dim=-1,
    )
    return torch.stack([part.mean((0, 1)).sqrt() for part in square.split(list(counts))]).clamp(min=1e-6)


def random_windows(
    counts: Sequence[int], starts: int, batch: int, draw: Sequence[torch.Generator]
) -> tuple[Tensor, Tensor]:
    """Random run of the member and one of `starts` first samples for each window: both (members, batch), runs counted
    over all members."""
    first = np.concatenate([[0], np.cumsum(counts)[:-1]]).tolist()
    runs = [f + torch.randint(c, (batch,), generator=g) for f, c, g in zip(first, counts, draw, strict=True)]
    return torch.stack(runs), torch.stack([torch.randint(starts, (batch,), generator=g) for g in draw])


def position_errors(pose: Tensor, truth: Tensor) -> Tensor:
    """Mean position error over time (members, runs) [m] of pose and truth (members, runs, steps, >= 2)."""
    return torch.linalg.vector_norm(pose[..., :2] - truth[..., :2], dim=-1).mean(2)


def position_score(pose: Tensor, truth: Tensor, weight: Tensor) -> Tensor:
    """Mean position error of each member [m]: pose and truth (members, runs, steps, >= 2), weight (members, runs)
    summing to 1."""
    return (position_errors(pose, truth) * weight).sum(1)


def shares_of(total: int, shares: Sequence[float]) -> list[int]:
    """Whole numbers that sum to `total`, in the proportion of `shares` (which sum to 1)."""
    edges = [round(total * share) for share in np.cumsum(shares)]
    return [int(b - a) for a, b in pairwise([0, *edges])]
