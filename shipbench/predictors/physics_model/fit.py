"""Constrained nonlinear least squares over full rollouts (eq. 9): Gauss-Newton steps whose constrained subproblems
IPOPT solves.

CasADi differentiates one integration step; the sensitivities are carried along all runs at once (without effects as
machine code, `_physics_rollout`). IPOPT then meets a problem of 11 unknowns (and
the values of effects) with the bounds and the nonlinear constraints exact, so a step costs milliseconds, and the
rollouts are evaluated once per step instead of once per barrier iteration.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np

from ...compiled import Rollout
from ...effects.base import Effect
from ...estimation.eq2_rollout import Rolling, parameter_scale
from ...estimation.extension import Active, accelerations
from ...estimation.intervals import intervals
from ...integrate import kinematics, rk4_step
from ...ops import Array
from ...physics import eq2
from ...physics.modifiers import Flow
from ...records import Batch
from ...signals import COMMANDS, MOTION
from ..hold import Hold

_P = eq2.NUM_PARAMETERS
_START = np.array([0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 0.0, -0.8, 1.0, 0.0, 1.0])
Forces = tuple[tuple[Effect, tuple[float | None, ...]], ...]
"""Force effects and their values; None where the value is a symbol."""

_WORTH_COMPILING = 5000
"""Least integration steps of all runs for which compiling takes less time than it saves."""


@dataclass(frozen=True)
class Fit:
    """Parameters (11,), their 95 % intervals (11, 2; NaN where a parameter sits at a bound), cost per run and time
    step, steps taken."""

    p: np.ndarray
    ci95: np.ndarray
    cost: float
    steps: int


def rollout_function(
    c: eq2.Coefficients,
    h: float,
    wind: bool,
    sensitivities: bool,
    forces: Forces = (),
    ship: Any = None,
    run_steps: int = 0,
) -> Rollout:
    """Rollout with force effects: x the motion (6,), then, with `sensitivities`, its derivatives (6, num) by row; w as
    in `Data.inputs`.

    p holds p0..p10 and then the values of `forces` that are None; the last column of w is the time at the beginning of
    the step, if there are forces. `ship` (Particulars) serves the effects. The code is for this ship and these effects
    alone: it is compiled where `run_steps`, the integration steps of all runs, are many enough.
    """
    return _rollout_function(c, h, wind, sensitivities, forces, ship, run_steps >= _WORTH_COMPILING)


@lru_cache(maxsize=8)
def _rollout_function(
    c: eq2.Coefficients, h: float, wind: bool, sensitivities: bool, forces: Forces, ship: Any, machine_code: bool
) -> Rollout:
    num = _P + sum(v is None for _, q in forces for v in q)
    x, S, p = ca.SX.sym("x", 6), ca.SX.sym("S", num, 6).T, ca.SX.sym("p", num)
    w = ca.SX.sym("w", (14 if wind else 12) + bool(forces))
    free = iter([p[i] for i in range(_P, num)])
    active = [Active(effect, tuple(next(free) if v is None else v for v in q)) for effect, q in forces]

    def rhs(state: tuple[Array, ...], stage: int) -> tuple[Array, ...]:
        px, py, psi, u, v, r = state
        t = w[w.numel() - 1] + 0.5 * stage * h if forces else 0.0
        flow = Flow(px, py, t, psi, u, v, r, *(w[4 * stage + i] for i in range(4)))
        air = (w[12], w[13]) if wind else None
        return (*kinematics(psi, u, v, r), *accelerations(active, flow, air, c, [p[i] for i in range(_P)], ship))

    x_next = ca.vertcat(*rk4_step(rhs, tuple(x[i] for i in range(6)), h))
    if not sensitivities:
        return Rollout(ca.Function("step", [x, w, p], [x_next], {"cse": True}), machine_code)
    S_next = ca.jacobian(x_next, x) @ S + ca.jacobian(x_next, p)
    state, following = ca.vertcat(x, ca.vec(S.T)), ca.vertcat(x_next, ca.vec(S_next.T))
    return Rollout(ca.Function("step", [state, w, p], [following], {"cse": True}), machine_code)


def bounds(scale: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Box of p in units of the scale; docs/theory.md#parameters-of-the-right-side."""
    low = np.array([-0.3, 0.0, 0.0, 0.0, -0.15, 0.5, -2.0, -8.0, 0.0, -0.5, 0.0])
    high = np.array([0.3, 5.0 * scale[1], 3.0 * scale[2], 20.0 * scale[3], 0.15, 6.0, 2.0, 0.0, 0.3, 0.5, 6.0])
    return low, high


def _constraints(p: ca.SX) -> ca.SX:
    """Constraints g(p) <= 0: lift rises for |a| <= 20 deg, |c_L| <= 2 for |a| <= 35 deg, drag never negative, at most 3
    deg of neutral rudder angle."""
    a, b = np.deg2rad(20.0), np.deg2rad(35.0)
    lift = [p[4] + s * b * (p[5] + s * b * (p[6] + s * b * p[7])) for s in (1, -1)]
    return ca.vertcat(
        *(-(p[5] + 2 * s * a * p[6] + 3 * a * a * p[7]) for s in (1, -1)),
        lift[0] - 2.0,
        -lift[1] - 2.0,
        p[9] ** 2 - 4 * p[8] * p[10],
        p[4] - np.deg2rad(3.0) * p[5],
        -p[4] - np.deg2rad(3.0) * p[5],
    )


def subproblem(num: int, scale: np.ndarray) -> ca.Function:
    """IPOPT solver of min_q g'(q - q0) + (q - q0)' H (q - q0)/2 over `num` values q, of which the first 11 are p/scale,
    with the constraints of the paper's eq. (9)."""
    q, q0, grad, H = ca.SX.sym("q", num), ca.SX.sym("q0", num), ca.SX.sym("g", num), ca.SX.sym("H", num, num)
    d = q - q0
    constraints = _constraints(q[:_P] * scale)
    problem: dict[str, Any] = {
        "x": q,
        "p": ca.veccat(q0, grad, H),
        "f": ca.dot(grad, d) + 0.5 * ca.bilin(H, d, d),
        "g": constraints,
    }
    options: dict[str, Any] = {
        "ipopt.print_level": 0,
        "print_time": False,
        "ipopt.sb": "yes",
        "ipopt.tol": 1e-9,
        "ipopt.max_iter": 200,
    }
    return ca.nlpsol("step", "ipopt", problem, options)


@dataclass(frozen=True)
class Data:
    """Data of a fit.

    path: actuators at the stages of every substep (batch, K * substeps, 3, 4); wind: (batch, K, 2) speed and direction,
    or None; dt: sample time [s].
    """

    c: eq2.Coefficients
    batch: Batch
    path: np.ndarray
    wind: np.ndarray | None
    dt: float
    substeps: int

    @property
    def truth(self) -> np.ndarray:
        return self.batch.truth[:, :, MOTION]

    def weight(self) -> np.ndarray:
        return inverse_size(self.batch, self.dt)

    def inputs(self, path: np.ndarray, with_time: bool = False) -> np.ndarray:
        """Inputs of the rollout function (runs, steps, columns)."""
        runs, steps = path.shape[:2]
        w = path.reshape(runs, steps, 12)
        if self.wind is not None:
            w = np.concatenate([w, np.repeat(self.wind, self.substeps, axis=1)], axis=2)
        if with_time:
            t = np.arange(steps) * self.dt / self.substeps
            w = np.concatenate([w, np.broadcast_to(t[:, None], (runs, steps, 1))], axis=2)
        return w

    def motion(self, rollout: Rollout, start: np.ndarray, w: np.ndarray, p: np.ndarray) -> np.ndarray:
        """Motion (runs, K, 6) at the samples from start (runs, 10)."""
        return rollout(start[:, MOTION], w, p)[:, self.substeps - 1 :: self.substeps]

    def linearised(
        self, rollout: Rollout, start: np.ndarray, w: np.ndarray, p: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motion and its derivatives (runs, K, 6, num) with respect to p, at the samples."""
        x0 = np.concatenate([start[:, MOTION], np.zeros((len(start), 6 * len(p)))], axis=1)
        found = rollout(x0, w, p)[:, self.substeps - 1 :: self.substeps]
        return found[..., :6], found[..., 6:].reshape(*found.shape[:2], 6, len(p))


Linearise = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


def fit_parameters(rolling: Rolling, batch: Batch, iterations: int, tolerance: float) -> Fit:
    """Minimise the mean over runs of the weighted squared trajectory error of x, y, psi, u, v, r.

    Args:
        rolling: ship, actuators and step.
        batch: runs of equal length.
        iterations, tolerance: stop after so many steps, or when the cost falls by less than this share.
    """
    truth, weight = batch.truth[:, :, MOTION], inverse_size(batch, rolling.dt)
    scale = parameter_scale(rolling.c)
    low, high = (b / scale for b in bounds(scale))

    def residuals(q: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):  # a diverging trial comes back non-finite and is refused
            return (rolling.states(batch.s0, batch.U, q * scale)[:, :, MOTION] - truth) * weight

    def linearise(q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        S, J = rolling.linearised(batch.s0, batch.U, q * scale)
        with np.errstate(all="ignore"):
            J *= weight[:, None] * scale  # in place: of many runs, nothing else is as large
            return (S[:, :, MOTION] - truth) * weight, J

    solver = subproblem(_P, scale)
    q, e, J, cost, taken = descend(
        linearise, residuals, solver, np.clip(_START, low, high), low, high, np.zeros(_P), iterations, tolerance
    )
    if not np.isfinite(cost):
        return Fit(q * scale, np.full((_P, 2), np.nan), cost, taken)
    return Fit(q * scale, intervals(q, e, J, low, high) * scale[:, None], cost, taken)


def descend(
    linearise: Linearise, residuals: Callable[[np.ndarray], np.ndarray], solver: ca.Function, q: np.ndarray,
    low: np.ndarray, high: np.ndarray,
    ridge: np.ndarray, iterations: int, tolerance: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, float, int]:  # fmt: skip
    """Damped Gauss-Newton from q: minimise sum e(q)^2 + sum ridge q^2; returns q, e, J, the cost and the steps
    taken."""
    e, J = linearise(q)
    cost, damping, taken = float(np.sum(e * e) + np.sum(ridge * q * q)), 1e-3, 0
    while taken < iterations and damping < 1e6 and np.isfinite(cost):
        taken += 1
        grad = np.einsum("bksp,bks->p", J, e) + ridge * q
        H = np.einsum("bksp,bksq->pq", J, J) + np.diag(ridge)
        damped = H + damping * np.diag(np.maximum(np.diag(H), 1e-9 * np.trace(H)))
        trial = np.asarray(
            solver(x0=q, p=ca.veccat(q, grad, damped), lbx=low, ubx=high, lbg=-np.inf, ubg=0.0)["x"]
        ).ravel()
        trial = np.clip(trial, low, high)
        with np.errstate(all="ignore"):
            new = float(np.sum(residuals(trial) ** 2) + np.sum(ridge * trial * trial))
        if np.isfinite(new) and new < cost:
            done = cost - new < tolerance * cost
            q, damping = trial, max(damping * 0.1, 1e-8)
            del e, J  # of many runs, two of them side by side are most of the memory
            e, J = linearise(q)
            cost = float(np.sum(e * e) + np.sum(ridge * q * q))
            if done:
                break
        else:
            damping *= 10.0
    return q, e, J, cost, taken


def inverse_size(batch: Batch, dt: float) -> np.ndarray:
    """Inverse root mean square error (6,) of constant velocities, per signal: the size of the changes to predict."""
    runs, samples = batch.truth.shape[:2]
    return 1.0 / (_hold_error(batch, dt) * np.sqrt(runs * samples * 6.0))


def _hold_error(batch: Batch, dt: float) -> np.ndarray:
    """Root mean square error (6,) of keeping u, v, r: x and y share the position's."""
    error = (Hold.at(dt).predict(batch.s0, batch.U[:, :, : len(COMMANDS)]) - batch.truth)[:, :, MOTION]
    size = np.sqrt(np.mean(error**2, axis=(0, 1)))
    size[:2] = np.sqrt(np.mean(size[:2] ** 2))
    return np.maximum(size, 1e-9)
