"""The fitted physics plus a learned residual acceleration, trained through the solver of torchdiffeq on windows that grow in length.

The residual is a small network of (u, v, r, n, delta, F_b, F_s) whose output starts at exactly zero: training starts at the fitted
physics and the weights of the best validation rollout are kept, the untouched physics among them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor, nn

from ..errors import InputError
from ..integrate import motion_rhs, rk4_step
from ..physics import eq2
from ..physics.wind import apparent_wind
from ..records import Dataset
from ..signals import ACTUATORS, MOTION, PSI, R, U
from ._stacked import Scaler, StackedMLP, StackedRuns, generators, hold_error, random_windows, trapezoid_pose, with_valid
from .base import History, PredictorBase
from .physics import Physics
from .training import Chunk, Recipe, StackedTask, train

Air = tuple[Tensor, Tensor]


class Residual(nn.Module):
    """Accelerations of all members: physics plus network.

    Args:
        physics: the fitted models, one per member.
        hidden: width of the two hidden layers.
        scale_in: of (u, v, r, n, delta, F_b, F_s); scale_out (members, 1, 3): size of the accelerations.
    """

    p: Tensor
    scale_out: Tensor

    def __init__(self, physics: Sequence[Physics], hidden: int, scale_in: Scaler, scale_out: Tensor, draw: Sequence[torch.Generator]) -> None:
        super().__init__()
        self.c = physics[0].c
        self.register_buffer("p", torch.as_tensor(np.stack([m.p for m in physics]), dtype=scale_out.dtype).T[..., None].contiguous())
        self.register_buffer("scale_out", scale_out)
        self.scale_in = scale_in
        self.net = StackedMLP([7, hidden, hidden, 3], draw, torch.tanh, zero_last=True)

    def learned(self, u: Tensor, v: Tensor, r: Tensor, actuators: Sequence[Tensor]) -> Tensor:
        """Residual accelerations (members, batch, 3); arguments (members, batch)."""
        return self.net(self.scale_in(torch.stack([u, v, r, *actuators], dim=-1))) * self.scale_out

    def forward(self, psi: Tensor | None, u: Tensor, v: Tensor, r: Tensor, actuators: Sequence[Tensor], air: Air | None) -> tuple[Tensor, Tensor, Tensor]:
        """(du, dv, dr), each (members, batch); `air` is true wind speed and direction."""
        apparent = None if air is None or psi is None else apparent_wind(psi, u, v, *air)
        du, dv, dr = eq2.accelerations(u, v, r, *actuators, apparent, self.c, self.p.unbind(0))
        more = self.learned(u, v, r, actuators).unbind(-1)
        return du + more[0], dv + more[1], dr + more[2]


class Stage(NamedTuple):
    """Part of the training: window length [model steps], windows per minibatch, number of minibatches, Adam's step size at its beginning."""

    steps: int
    batch: int
    minibatches: int


class Grid(NamedTuple):
    """How the training integrates: `stride` samples per knot, `per_knot` midpoint steps of `step` seconds between knots."""

    stride: int
    per_knot: int
    step: float


class Drive(NamedTuple):
    """What is known ahead of the rollout: states at the knots (runs, knots, 10), actuators at beginning and middle of every step
    (runs, steps, 2, 4), wind (runs, steps, 2) or None, runs of each member."""

    S: Tensor
    path: Tensor
    air: Tensor | None
    counts: tuple[int, ...]
