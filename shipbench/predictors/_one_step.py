"""What one-step models share, whatever learns the step: samples to learn from, and the rollout that feeds predictions back.

y = [u, v, r, n, delta, F_b, F_s]; a step maps (y_k, input features at k) to y_k+1 or to y_k+1 - y_k; the pose follows by eq. (10) to (14).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
from torch import Tensor

from ..signals import PSI
from ._stacked import CHANNELS, InputFeatures, StackedRuns, dead_reckoning

NUM_CHANNELS = 7
TARGETS = ("state", "increment")


def check_target(target: str) -> None:
    """Raises ValueError where `target` is none of `TARGETS`."""
    if target not in TARGETS:
        raise ValueError(f"target = '{target}'; accepted: 'state' or 'increment'")


def transitions(runs: StackedRuns, features: InputFeatures) -> list[tuple[Tensor, Tensor, Tensor]]:
    """Per member: y_k (samples, 7), input features at k (samples, features), y_k+1 (samples, 7)."""
    parts = []
    for S, held in zip(runs.S.split(runs.counts), runs.U.split(runs.counts), strict=True):
        inputs = features(held, S[:, :-1, PSI])
        parts.append((S[:, :-1, CHANNELS].flatten(0, 1), inputs.flatten(0, 1), S[:, 1:, CHANNELS].flatten(0, 1)))
    return parts


@torch.no_grad()
def one_step_rollout(
    step: Callable[[Tensor], Tensor],
    s0: np.ndarray,
    U: np.ndarray,
    features: InputFeatures,
    dt: float,
    *,
    increment: bool,
    device: str = "cpu",
) -> np.ndarray:
    """Roll a one-step model out in float64, so that what is predicted for a run does not depend, to far below 1 mm, on the runs beside it.

    Args:
        step: (batch, 7 + features) to the next y (batch, 7), or to its change if `increment`; both in physical units, on `device`.
        s0: (batch, 10); U: (batch, K, inputs).

    Returns:
        S (batch, K, 10).
    """
    start, held = torch.as_tensor(s0, device=device), torch.as_tensor(U, device=device)
    y, psi, path = start[:, CHANNELS], start[:, PSI], []
    for k in range(U.shape[1]):
        z = step(torch.cat([y, features(held[:, k], psi)], dim=-1))
        y = y + z if increment else z
        psi = psi + dt * y[:, 2]
        path.append(y)
    channels = torch.stack(path, dim=1)
    return torch.cat([dead_reckoning(start, channels, dt), channels], dim=-1).cpu().numpy()
