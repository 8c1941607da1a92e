"""Physics plus a learned residual acceleration, for all members at once, and its solution by torchdiffeq over windows
of measured runs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
import torchdiffeq
from torch import Tensor, nn

from ...estimation.extension import Active
from ...estimation.rollout import Slopes
from ...physics.modifiers import Flow
from ...physics.wind import apparent_wind
from ...records import Dataset
from ...signals import PSI, R, U, V
from .._features import CHANNELS
from ..physics_model.fitted_ship import FittedShip
from .stacked import Scaler, StackedMLP

Air = tuple[Tensor, Tensor]


class _Compiled(torch.autograd.Function):
    """Accelerations (members, batch, 3) as machine code; of their derivatives only those with respect to the state
    psi, u, v, r (members, batch, 4) are needed: the coefficients are fixed."""

    @staticmethod
    def forward(ctx: Any, state: Tensor, code: Slopes, values: Tensor, act: Tensor, wind: Tensor | None) -> Tensor:
        x, q, given = (a.detach().double().numpy() for a in (state, values, act))
        rates, slopes = code(x, q, given, None if wind is None else wind.double().numpy())
        ctx.save_for_backward(torch.as_tensor(slopes, dtype=state.dtype))
        return torch.as_tensor(rates, dtype=state.dtype)

    @staticmethod
    def backward(ctx: Any, *grads: Tensor) -> tuple[Tensor, None, None, None, None]:
        (slopes,) = ctx.saved_tensors
        return (grads[0][..., None, :] @ slopes)[..., 0, :], None, None, None, None


class Residual(nn.Module):
    """Accelerations of all members: physics plus network.

    Args:
        physics: the fitted models, one per member, all with the same effects.
        hidden: width of the two hidden layers.
        scale_in: of `features`; scale_out (members, 1, 3): size of the accelerations.
    """

    p: Tensor
    q: Tensor
    scale_out: Tensor

    def __init__(
        self,
        physics: Sequence[FittedShip],
        hidden: int,
        scale_in: Scaler,
        scale_out: Tensor,
        draw: Sequence[torch.Generator],
    ) -> None:
        super().__init__()
        found = [m.forces() for m in physics]
        self.base, self.code = physics[0], physics[0].slopes()
        self.effects = [(a.effect, len(a.q)) for a in found[0][1]]
        q = np.array([[v for a in active for v in a.q] for _, active in found])
        self.register_buffer("q", torch.as_tensor(q, dtype=scale_out.dtype).T[..., None].contiguous())
        self.register_buffer(
            "p", torch.as_tensor(np.array([p for p, _ in found]), dtype=scale_out.dtype).T[..., None].contiguous()
        )
        self.register_buffer("scale_out", scale_out)
        self.scale_in = scale_in
        self.net = StackedMLP([scale_in.mean.shape[-1], hidden, hidden, 3], draw, torch.tanh, zero_last=True)

    def learned(self, x: Tensor) -> Tensor:
        """Residual accelerations (members, batch, 3) of `features` (members, batch, 7 or 9), in units of
        `scale_out`."""
        return self.net(self.scale_in(x))

    def forward(
        self, psi: Tensor | None, u: Tensor, v: Tensor, r: Tensor, actuators: Sequence[Tensor], air: Air | None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Accelerations (du, dv, dr), each (members, batch); `air` is true wind speed and direction."""
        apparent = None if air is None or psi is None else apparent_wind(psi, u, v, *air)
        if self.code is not None and psi is not None and u.device.type == "cpu":
            state, act = torch.stack([psi, u, v, r], dim=-1), torch.stack(list(actuators), dim=-1)
            wind = None if air is None else torch.stack(air, dim=-1)
            du, dv, dr = _Compiled.apply(state, self.code, torch.cat([self.p, self.q])[..., 0].T, act, wind).unbind(-1)
        else:
            q = iter(self.q.unbind(0))
            active = [Active(effect, tuple(next(q) for _ in range(num))) for effect, num in self.effects]
            flow = Flow(0.0, 0.0, 0.0, psi, u, v, r, *actuators)
            du, dv, dr = self.base.accelerations(flow, air, self.p.unbind(0), active)
        more = (self.learned(torch.stack([u, v, r, *actuators, *(apparent or ())], dim=-1)) * self.scale_out).unbind(-1)
        return du + more[0], dv + more[1], dr + more[2]


def features(S: Tensor, air: Tensor | None) -> Tensor:
    """Network inputs for states (..., 10): u, v, r, n, delta, F_b, F_s, and the speed through the air where true wind
    (..., 2) is given."""
    seen = S[..., CHANNELS]
    if air is None:
        return seen
    return torch.cat(
        [seen, torch.stack(apparent_wind(S[..., PSI], S[..., U], S[..., V], *air.unbind(-1)), dim=-1)], dim=-1
    )


class Grid(NamedTuple):
    """Integration grid of the training: a model step every `stride` samples, `per_knot` midpoint steps of `step`
    seconds in each."""

    stride: int
    per_knot: int
    step: float

    @classmethod
    def of(cls, physics: FittedShip) -> Grid:
        """Grid with steps of about a second for 100 m (the time scale of a ship goes with sqrt(L)). No step misses a
        change of the inputs."""
        if physics.substeps > 1:
            return cls(1, physics.substeps, physics.dt / physics.substeps)
        stride = max(1, int(0.1 * np.sqrt(physics.c.L) / physics.dt))
        return cls(stride, 1, stride * physics.dt)


class Drive(NamedTuple):
    """Known inputs of the rollouts of all members' runs.

    Args:
        S: (runs, knots + 1, 10) measured states.
        path: (runs, steps, 2, 4) actuators at the beginning and in the middle of every integration step.
        air: (runs, steps, 2) true wind, or None.
        counts: runs of each member.
    """

    S: Tensor
    path: Tensor
    air: Tensor | None
    counts: tuple[int, ...]

    @classmethod
    def of(cls, physics: Sequence[FittedShip], datasets: Sequence[Dataset], grid: Grid) -> Drive:
        """Inputs of the rollouts. Actuators do not depend on the hull's motion: their path is computed before the
        rollout."""
        parts, counts, d = [], [], grid.stride
        for model, data in zip(physics, datasets, strict=True):
            batch = data.batch()
            knots = batch.U.shape[1] // d
            S = np.concatenate([batch.s0[:, None], batch.truth], axis=1)[:, : knots * d + 1 : d]
            full = model.actuator_path(batch.s0, batch.U)
            begin, middle = (
                full[:, 0 : knots * d * grid.per_knot : d, 0],
                full[:, d // 2 :: d, d % 2][:, : knots * grid.per_knot],
            )
            air = model._wind(batch.U)
            wind = (
                np.zeros((len(S), 0, 2)) if air is None else np.repeat(air[:, : knots * d : d], grid.per_knot, axis=1)
            )
            parts.append(
                [torch.as_tensor(known, dtype=torch.float32) for known in (S, np.stack([begin, middle], axis=2), wind)]
            )
            counts.append(len(S))
        states, path, held = (torch.cat(known) for known in zip(*parts, strict=True))
        return cls(states, path, held if held.shape[1] else None, tuple(counts))


def solve(model: Residual, start: Tensor, path: Tensor, air: Tensor | None, step: float) -> Tensor:
    """Velocities u, v, r at the ends of the steps by torchdiffeq's midpoint rule (members, batch, steps, 3).

    Args:
        start: (members, batch, 10).
        path: (members, batch, steps, 2, 4); air: (members, batch, steps, 2) or None.
        step: [s].
    """
    stages = path.permute(2, 3, 4, 0, 1).contiguous()  # time first: one step is then a contiguous block
    wind = None if air is None else air.permute(2, 3, 0, 1).contiguous()

    def rate(t: Tensor, y: Tensor) -> Tensor:
        j, half = divmod(round(2.0 * float(t)), 2)  # time in steps: the rule asks at j and j + 1/2
        u, v, r = y[0], y[1], y[2]
        rates = model(
            y[3] if turns else None,
            u,
            v,
            r,
            stages[j, half].unbind(0),
            None if wind is None else (wind[j, 0], wind[j, 1]),
        )
        return step * torch.stack((*rates, r) if turns else rates)

    turns = wind is not None or bool(model.effects)  # the heading matters
    first = start[..., [U, V, R, PSI] if turns else [U, V, R]].movedim(-1, 0)
    times = torch.arange(path.shape[2] + 1, dtype=start.dtype, device=start.device)
    # pyright: ignore[reportIndexIssue, reportCallIssue, reportArgumentType]
    return torchdiffeq.odeint(rate, first, times, method="midpoint")[1:, :3].permute(2, 3, 0, 1)


def typical_accelerations(physics: Sequence[FittedShip], drive: Drive) -> Tensor:
    """Root mean square (members, 1, 3) of the physics' accelerations without measured wind along the measured
    states."""
    sizes = []
    for model, S in zip(physics, drive.S.double().split(drive.counts), strict=True):
        flow = Flow(0.0, 0.0, 0.0, S[..., PSI].numpy(), *S[..., CHANNELS].movedim(-1, 0).numpy())
        found = model.accelerations(flow, None, *model.forces())
        sizes.append([float(np.sqrt(np.mean(np.square(a)))) for a in found])
    return torch.tensor(sizes, dtype=torch.float32)[:, None]
