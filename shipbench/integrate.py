"""Fixed-step integration with held inputs, on any back end.

The state is a tuple of components so that one formula serves numpy arrays, torch tensors and casadi symbols.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from .ops import Array, cos, sin

State = tuple[Array, ...]


def rk4_step(rhs: Callable[[State, int], State], state: State, dt: Array) -> State:
    """Step of the classical Runge-Kutta method of order 4.

    `rhs(state, stage)` returns the derivatives; `stage` is 0 at the beginning, 1 at the middle and 2 at the end of the
    step, for inputs that are known at those times.
    """

    def ahead(slope: State, factor: float) -> State:
        return tuple(s + factor * dt * k for s, k in zip(state, slope, strict=True))

    k1 = rhs(state, 0)
    k2 = rhs(ahead(k1, 0.5), 1)
    k3 = rhs(ahead(k2, 0.5), 1)
    k4 = rhs(ahead(k3, 1.0), 2)
    return tuple(s + dt / 6.0 * (a + 2.0 * (b + c) + d) for s, a, b, c, d in zip(state, k1, k2, k3, k4, strict=True))


def kinematics(psi: Array, u: Array, v: Array, r: Array) -> State:
    """Rates of north, east [m/s] and heading [rad/s] of midship (seed paper eq. 10)."""
    return u * cos(psi) - v * sin(psi), u * sin(psi) + v * cos(psi), r


def motion_rhs(
    accelerations: Callable[[Array, Array, Array, Array, int], Sequence[Array]],
) -> Callable[[State, int], State]:
    """Right-hand side of (x, y, psi, u, v, r) from `accelerations(psi, u, v, r, stage) -> (du, dv, dr)`."""

    def rhs(state: State, stage: int) -> State:
        _, _, psi, u, v, r = state
        return (*kinematics(psi, u, v, r), *accelerations(psi, u, v, r, stage))

    return rhs
