"""The physics fit (72 runs of 120 s, 11 parameters) beside `scipy.optimize.least_squares` with finite differences on
`solve_ivp` rollouts.

    python benchmarks/fit_scipy.py [--runs N] [--quick] [--json FILE]

Both minimise the same weighted trajectory error of x, y, psi, u, v, r (eq. 9) within the same bounds, to the same
relative decrease of the cost (1e-4).

- scipy: `least_squares(method="trf", jac="2-point")`, one `solve_ivp` (RK45, rtol 1e-6) a run. Its right-hand side is
  eq. (2) to (8) as straight Python floats, made from the one formula, which is much faster than the formula on numpy
  scalars. Every parameter goes from 1 to 2 between its bounds, from a start 2 % inside them, with differences of 0.1 %:
  other steps end in the noise of the adaptive solver, far from the optimum. It is given the actuators for nothing, and
  it has no nonlinear constraints.
- shipbench: `Physics().fit(train)`, all of it: actuators, parameters under bounds and constraints, intervals.

Checked: the cost at scipy's solution, by shipbench's rollouts, is within 3 % of ours (10 % with the 6 runs of
`--quick`).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import casadi as ca
import measure
import numpy as np
from measure import Side
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from shipbench.data.base import load_dataset
from shipbench.integrate import kinematics
from shipbench.physics import eq2
from shipbench.predictors.physics import Physics
from shipbench.predictors.physics_model.fit import _START, bounds, inverse_size, parameter_scale
from shipbench.records import Batch
from shipbench.signals import MOTION

_PYTHON = {
    "ADD": "{0}+{1}", "SUB": "{0}-{1}", "MUL": "{0}*{1}", "DIV": "{0}/{1}", "NEG": "-{0}", "SQ": "{0}*{0}",
    "TWICE": "{0}+{0}", "INV": "1.0/{0}",
    "FABS": "abs({0})", "SQRT": "sqrt({0})", "SIN": "sin({0})", "COS": "cos({0})", "EXP": "exp({0})",
    "ATAN2": "atan2({0},{1})",
    "FMIN": "{0} if {0}<{1} else {1}", "FMAX": "{0} if {0}>{1} else {1}",
}  # fmt: skip


def right_hand_side(c: eq2.Coefficients) -> Callable[..., tuple[float, ...]]:
    """d(x, y, psi, u, v, r)/dt = f(state, actuators, p) in plain Python floats, made from the instructions of the one
    formula."""
    x, a, p = ca.SX.sym("x", 6), ca.SX.sym("a", 4), ca.SX.sym("p", eq2.NUM_PARAMETERS)
    _, _, psi, u, v, r = ca.vertsplit(x)
    n, delta, F_b, F_s = ca.vertsplit(a)
    rates = ca.vertcat(
        *kinematics(psi, u, v, r), *eq2.accelerations(u, v, r, n, delta, F_b, F_s, None, c, ca.vertsplit(p))
    )
    formula = ca.Function("rates", [x, a, p], [rates], {"cse": True})
    names = {number: name[3:] for name, number in vars(ca).items() if name.startswith("OP_")}
    lines = ["def rates(x, a, p):"]
    for k in range(formula.n_instructions()):
        name, given, out = names[formula.instruction_id(k)], formula.instruction_input(k), formula.instruction_output(k)
        if name == "CONST":
            lines.append(f" w{out[0]} = {formula.instruction_constant(k)!r}")
        elif name == "INPUT":
            lines.append(f" w{out[0]} = {'xap'[given[0]]}[{given[1]}]")
        elif name == "OUTPUT":
            lines.append(f" y{out[1]} = w{given[0]}")
        else:
            lines.append(f" w{out[0]} = {_PYTHON[name].format(*(f'w{i}' for i in given))}")
    scope: dict[str, Any] = {}
    exec("from math import atan2, cos, exp, sin, sqrt\n" + "\n".join([*lines, " return y0, y1, y2, y3, y4, y5"]), scope)
    return scope["rates"]


def scipy_fit(model: Physics, batch: Batch) -> np.ndarray:
    """p0..p10 by scipy, the actuators taken from `model`."""
    rates, scale, dt = right_hand_side(model.c), parameter_scale(model.c), model.dt
    truth, weight = batch.truth[:, :, MOTION], inverse_size(batch, dt)
    path = model.actuator_path(batch.s0, batch.U)
    times = np.arange(1.0, truth.shape[1] + 1.0) * dt
    known = [np.concatenate([run[:, :2].reshape(-1, 4), run[-1:, 2]]).tolist() for run in path]  # every half step
    half = 0.5 * dt / model.substeps

    def rollout(p: list[float], start: np.ndarray, actuators: list[list[float]]) -> np.ndarray:
        last = len(actuators) - 2

        def slope(t: float, x: np.ndarray) -> tuple[float, ...]:
            place = t / half
            i = min(int(place), last)
            part, before, after = place - i, actuators[i], actuators[i + 1]
            return rates(x.tolist(), [b + part * (a - b) for a, b in zip(after, before, strict=True)], p)

        return solve_ivp(slope, (0.0, times[-1]), start, t_eval=times, rtol=1e-6, atol=1e-8).y.T

    def residual(q: np.ndarray) -> np.ndarray:
        p = (q * scale).tolist()
        return np.concatenate(
            [
                ((rollout(p, s, a) - y) * weight).ravel()
                for s, a, y in zip(batch.s0[:, MOTION], known, truth, strict=True)
            ]
        )

    low, high = (b / scale for b in bounds(scale))
    width = high - low
    start = 1.0 + (np.clip(_START, low + 0.02 * width, high - 0.02 * width) - low) / width
    found = least_squares(
        lambda z: residual(low + (z - 1.0) * width),
        start,
        bounds=(1.0, 2.0),
        method="trf",
        jac="2-point",
        diff_step=1e-3,
        ftol=1e-4,
    )
    print(f"  scipy: {found.nfev} steps, {found.njev} Jacobians, {found.message}")
    return (low + (found.x - 1.0) * width) * scale


def cost(model: Physics, batch: Batch, p: np.ndarray) -> float:
    """Eq. (9) at p, by shipbench's rollouts."""
    S = model._rolling().states(batch.s0, batch.U, p)
    return float(np.sum(((S - batch.truth)[:, :, MOTION] * inverse_size(batch, model.dt)) ** 2))


def main() -> None:
    """Fit both, compare the costs, print the ratio."""
    given = measure.options(__doc__, runs=1)
    measure.header(given)
    train = load_dataset("harbour90").subset(range(0, 72, 12 if given.quick else 1))
    model, batch = Physics().fit(train), train.batch()
    found: list[np.ndarray] = []
    ours = Side("Physics().fit(train)", lambda: Physics().fit(train))
    peer = Side(
        "least_squares(residual, start, bounds=..., jac='2-point'), a solve_ivp a run",
        lambda: found.append(scipy_fit(model, batch)),
    )
    result = measure.compare(
        f"fit of 11 parameters to {len(train)} runs of 120 s", ours, peer, given, target=100, warm=False
    )
    if not given.quick:
        print(f"  under 3 s: {'reached' if result.ours_s < 3.0 else 'NOT reached'} ({result.ours_s:.2f} s)")
    ours_cost, peer_cost = cost(model, batch, model.p), cost(model, batch, found[-1])
    print(f"cost at our p {ours_cost:.6f} (with constraints), at scipy's p {peer_cost:.6f} (without)")
    measure.agree("cost, relative", abs(ours_cost - peer_cost) / ours_cost, 0.1 if given.quick else 0.03)


if __name__ == "__main__":
    main()
