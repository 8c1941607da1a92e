"""Training of the neural ODE on five folds, all together, beside torchdiffeq used as its README shows, a fold at a
time.

    python benchmarks/neural_ode_training.py [--runs 3] [--quick] [--json FILE]

The peer is the README's loop: a module with `forward(t, y)`, `odeint(func, y0, t)` over a batch of windows, the loss of
the states, `backward`, one step of the optimiser; with the solver that odeint takes by default (dopri5, its own
tolerances), and with `method="rk4"` on our grid. All sides have the same equations (our physics and a network of the
same size), windows, stages, loss, AdamW, clipping, learning rates and validation, and keep the weights of the best
validation rollout; each fits the physics of its folds first. Ours trains five folds in every run, a peer one, another
in each: times are seconds a fold. dopri5 has fewer epochs (it takes hours else), ours then as many.
"""

from __future__ import annotations

import math
import sys
from typing import Any

import measure
import numpy as np
import torch
from stacked_training import folds
from torch import Tensor, nn
from torchdiffeq import odeint

from shipbench.data.base import load_dataset
from shipbench.predictors import neural_ode
from shipbench.predictors.networks.residual import Drive, Grid, Residual, features, typical_accelerations
from shipbench.predictors.networks.stacked import (
    Scaler,
    generators,
    hold_error,
    position_score,
    random_windows,
    trapezoid_pose,
)
from shipbench.predictors.physics import Physics
from shipbench.records import Dataset
from shipbench.signals import PSI, R, U, V, X, Y

EPOCHS, EPOCHS_DOPRI5 = 40, 4
TARGET, ACCEPTED = 5.0, 0.25
"""Ratio to be reached, and accepted relative difference of the validation errors in the mean over folds."""
Pair = tuple[Dataset, Dataset]


class Rates(nn.Module):
    """The README's `func`: rates of u, v, r of one fold's windows, their actuators looked up at t."""

    def __init__(self, model: Residual, path: Tensor, step: float) -> None:
        super().__init__()
        self.model, self.step = model, step
        last = path[:, -1, 1:]
        self.knots = torch.cat([path.flatten(1, 2), last], dim=1).unbind(
            1
        )  # at the beginnings and middles of the steps, half a step apart

    def forward(self, t: Tensor, y: Tensor) -> Tensor:
        place = min(2.0 * float(t.detach()) / self.step, len(self.knots) - 1.0)
        k = min(int(place), len(self.knots) - 2)
        now = self.knots[k] + (place - k) * (self.knots[k + 1] - self.knots[k])
        rates = self.model(None, *(c[None] for c in y.unbind(-1)), now[None].unbind(-1), None)
        return torch.cat(rates).T


class Peer:
    """One fold, trained as a user of torchdiffeq would."""

    def __init__(self, pair: Pair, epochs: int, method: str | None) -> None:
        train, valid = pair
        self.method = {} if method is None else {"method": method}
        spec = neural_ode.NeuralODE(epochs=epochs)
        physics = Physics().fit(train, valid)
        self.grid = Grid.of(physics)
        self.dt = self.grid.step * self.grid.per_knot
        self.runs, self.valid = Drive.of([physics], [train], self.grid), Drive.of([physics], [valid], self.grid)
        self.draw = generators([0])
        scale = Scaler.fit([features(self.runs.S, None)])
        self.model = Residual([physics], spec.hidden, scale, typical_accelerations([physics], self.runs), self.draw)
        self.spec, self.stages = spec, spec._stages(self.runs.S.shape[1] - 1)

    def roll(self, drive: Drive, runs: Tensor, starts: Tensor, steps: int) -> tuple[Tensor, Tensor, Tensor]:
        """u, v, r, pose and the measured states of windows (windows, steps, ..)."""
        S = drive.S[runs[:, None], starts[:, None] + torch.arange(steps + 1)]
        fine = self.grid.per_knot
        path = drive.path[runs[:, None], starts[:, None] * fine + torch.arange(steps * fine)]
        times = self.dt * torch.arange(steps + 1)
        options: dict[str, Any] = dict(self.method)
        if self.method:
            options["options"] = {"step_size": self.grid.step}
        y = odeint(Rates(self.model, path, self.grid.step), S[:, 0, [U, V, R]], times, **options)[1:].transpose(0, 1)
        return y, trapezoid_pose(S[:, 0], y, self.dt), S[:, 1:]

    def loss(self, steps: int, batch: int, scale: Tensor) -> Tensor:
        runs, starts = random_windows(self.runs.counts, self.runs.S.shape[1] - steps, batch, self.draw)
        y, pose, truth = self.roll(self.runs, runs[0], starts[0], steps)
        error = ((y - truth[..., U : R + 1]) / scale[:3]).square().sum(-1)
        error = (
            error
            + ((pose[..., :2] - truth[..., X : Y + 1]) / scale[3]).square().sum(-1)
            + ((pose[..., 2] - truth[..., PSI]) / scale[4]).square()
        )
        small = self.model.learned(features(truth[:, -1], None)[None]).square().sum(-1)
        return error.mean() + self.spec.penalty * small.mean()

    @torch.no_grad()
    def score(self) -> float:
        """Mean position error [m] of the validation rollouts."""
        count = self.valid.counts[0]
        rows = torch.arange(count)
        _, pose, truth = self.roll(self.valid, rows, torch.zeros_like(rows), self.valid.S.shape[1] - 1)
        return float(position_score(pose[None], truth[None], torch.full((1, count), 1.0 / count)))

    def train(self) -> float:
        """The loop; returns the best validation error [m]."""
        optimizer = torch.optim.AdamW(self.model.parameters(), lr=self.spec.lr, weight_decay=self.spec.weight_decay)
        best, done, total = self.score(), 0, sum(s.epochs for s in self.stages)
        for stage in self.stages:
            scale = hold_error(self.runs.S, self.runs.counts, self.dt, stage.steps)[0]
            for _ in range(stage.epochs):
                done += 1
                for group in optimizer.param_groups:
                    group["lr"] = self.spec.lr * (0.02 + 0.98 * 0.5 * (1.0 + math.cos(math.pi * done / total)))
                for _ in range(neural_ode._Windows.MINIBATCHES):
                    optimizer.zero_grad()
                    self.loss(stage.steps, stage.batch, scale).backward()
                    nn.utils.clip_grad_norm_(self.model.parameters(), 1.0)
                    optimizer.step()
                best = min(best, self.score())
        return best


def train_ours(pairs: list[Pair], epochs: int) -> list[float]:
    """All folds together; validation errors [m] of what is kept, by the predictor's own rollouts."""
    models = [neural_ode.NeuralODE(epochs=epochs) for _ in pairs]
    neural_ode.NeuralODE.fit_group(models, [t for t, _ in pairs], [v for _, v in pairs], [0] * len(pairs))
    found = []
    for model, (_, valid) in zip(models, pairs, strict=True):
        batch = valid.batch()
        S = model.predict(batch.s0, batch.U)
        found.append(float(np.hypot(*(S - batch.truth)[..., X : Y + 1].transpose(2, 0, 1)).mean()))
    return found


def against(
    title: str, pairs: list[Pair], epochs: int, method: str | None, given: measure.Options, accepted: float
) -> None:
    """One peer."""
    ours: list[float] = []
    peers: list[float] = []

    def stacked() -> None:
        ours[:] = train_ours(pairs, epochs)

    def plain() -> None:
        peers.append(Peer(pairs[len(peers) % len(pairs)], epochs, method).train())

    call = "odeint(func, y0, t)" if method is None else f'odeint(func, y0, t, method="{method}")'
    measure.compare(
        f"{title}, {epochs} epochs, seconds a fold",
        measure.Side(f"NeuralODE.fit_group of {len(pairs)} folds, epochs={epochs}", stacked, calls=len(pairs)),
        measure.Side(f"loop with {call}", plain), given, target=TARGET, warm=False,
    )  # fmt: skip
    here = ours[: len(peers)] if len(peers) < len(ours) else ours
    a, b = (sum(errors) / len(errors) for errors in (here, peers))
    print(f"  validation ED, mean of {len(here)} folds: ours {a:.3f} m, peer {b:.3f} m")
    measure.agree("relative validation error", abs(a / b - 1.0), accepted)


def main() -> None:
    """Both solvers."""
    given = measure.options(__doc__, runs=3)
    measure.header(given, "torchdiffeq", "lightning")
    torch.set_num_threads(1)  # both sides: ours trains on one
    pairs = folds(load_dataset("harbour90"))[: 2 if given.quick else None]
    epochs = 1 if given.quick else EPOCHS
    accepted = 1.0 if given.quick else ACCEPTED
    against("neural_ode beside torchdiffeq's rk4", pairs, epochs, "rk4", given, accepted)
    if not given.quick:
        one = measure.Options(1, given.quick, given.json)
        against("neural_ode beside torchdiffeq's default, dopri5", pairs, EPOCHS_DOPRI5, None, one, accepted)


if __name__ == "__main__":
    sys.exit(main())
