"""Common parts of one-step models: training samples, and the rollout that feeds predictions back.

y = [u, v, r, n, delta, F_b, F_s]; a step maps (y_k, input features at k) to y_k+1 or to y_k+1 - y_k; the pose follows
by eq. (10) to (14). Arrays are of numpy or of torch, as the model's step takes them.
"""

from __future__ import annotations

from collections.abc import Callable

from ..ops import Array
from ..signals import PSI
from ._features import CHANNELS, InputFeatures, dead_reckoning, joined

NUM_CHANNELS = 7
TARGETS = ("state", "increment")


def check_target(target: str) -> None:
    """Raise ValueError where `target` is none of `TARGETS`."""
    if target not in TARGETS:
        raise ValueError(f"target = '{target}'; accepted: 'state' or 'increment'")


def transitions(S: Array, U: Array, features: InputFeatures) -> tuple[Array, Array, Array]:
    """Samples of one step: y_k (samples, 7), input features at k (samples, features) and y_k+1 (samples, 7).

    Args:
        S: states (runs, K + 1, 10); U: inputs (runs, K, inputs).
    """
    parts = S[:, :-1, CHANNELS], features(U, S[:, :-1, PSI]), S[:, 1:, CHANNELS]
    before, inputs, after = (part.reshape(-1, part.shape[-1]) for part in parts)
    return before, inputs, after


def one_step_rollout(
    step: Callable[[Array], Array], s0: Array, U: Array, features: InputFeatures, dt: float, *, increment: bool
) -> Array:
    """Roll a one-step model out in float64. The prediction of a run then depends on the other runs of the batch by far
    less than 1 mm.

    Args:
        step: (batch, 7 + features) to the next y (batch, 7), or to its change if `increment`; both in physical units.
        s0: (batch, 10); U: (batch, K, inputs).

    Returns:
        S (batch, K, 10).
    """
    y, psi, path = s0[:, CHANNELS], s0[:, PSI], []
    for k in range(U.shape[1]):
        z = step(joined([y, features(U[:, k], psi)]))
        y = y + z if increment else z
        psi = psi + dt * y[:, 2]
        path.append(y[:, None])
    channels = joined(path, 1)
    return joined([dead_reckoning(s0, channels, dt), channels])
