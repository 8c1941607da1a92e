"""120 s rollouts of the 7 m KVLCC2 beside `shipmmg.simulate_mmg_3dof`: a batch of 1,000, and one alone.

    python benchmarks/rollouts_shipmmg.py [--runs N] [--quick] [--json FILE]

Needs `pip install --no-deps shipmmg==0.0.9`: it asks for numpy below 2 and Pillow below 10, but runs with newer ones.
Both sides sail the same ship from the same start under the same rudder and revolutions: turns, shipmmg's own example
and its cheapest manoeuvre (a rudder that moves costs it up to twice as many evaluations).

- shipmmg: as its documentation has it, `simulate_mmg_3dof` with the default RK45 and `sol.sol(time)` for the states at
  1 s; one run a call, it has no batches. Its result holds u, v, r; x, y, psi would cost it more.
- shipbench, same equations: `Simulator.fast_rollout`, the MMG formula with 1 s steps, all ten states at 1 s.
- shipbench, fitted equations: `physics.predict`, eq. (2) to (8) fitted to 12 such turns, 1/3 s steps, all ten states at
1 s.

Checked first: each side's integration error against itself with finer steps, ours not above theirs; and the speeds of
both sides after 120 s, within a tenth of the ship's (the two MMG writings differ in the wake of a drifting ship and in
the flow at its rudder).
"""

from __future__ import annotations

import sys
import types
from collections.abc import Callable
from typing import Any

import measure
import numpy as np
from measure import Side

from shipbench.physics.mmg import MMGShip, load_mmg_ship
from shipbench.predictors.physics import Physics
from shipbench.records import Dataset, Run
from shipbench.simulate.manoeuvres import straight_state
from shipbench.simulate.simulator import Simulator

SPEED, RPM, HORIZON = 1.179, 624.0, 120
Peer = Callable[..., Any]


def import_shipmmg() -> Any:
    """shipmmg 0.0.9 imports `scipy.misc.derivative`, which scipy 1.12 dropped: the central difference is put back
    (without the zero-weighted middle point that the old one evaluated as well)."""
    misc = types.ModuleType("scipy.misc")
    misc.derivative = lambda f, x0, dx=1.0: (f(x0 + dx) - f(x0 - dx)) / (2.0 * dx)  # type: ignore[attr-defined]
    sys.modules.setdefault("scipy.misc", misc)
    try:
        from shipmmg import mmg_3dof
    except ImportError as error:
        raise SystemExit(f"{error}: pip install --no-deps shipmmg==0.0.9") from None
    return mmg_3dof


def shipmmg_ship(package: Any, ship: MMGShip) -> tuple[Any, Any]:
    """The same ship in shipmmg's words."""
    h, p, r, L = ship.hull, ship.propeller, ship.rudder, ship.L
    basic = package.Mmg3DofBasicParams(
        L_pp=L, B=ship.B, d=ship.T, x_G=ship.x_G, D_p=p.D, m=ship.m, I_zG=ship.I_zG, A_R=r.A_R, η=p.D / r.H_R,
        m_x=ship.m_x, m_y=ship.m_y,
        J_z=ship.J_z, f_α=r.f_alpha, ϵ=r.epsilon, t_R=r.t_R, x_R=r.x_R * L, a_H=r.a_H, x_H=r.x_H * L,
        γ_R_minus=r.gamma_minus,
        γ_R_plus=r.gamma_plus, l_R=r.l_R, κ=r.kappa, t_P=p.t_P, w_P0=p.w_P0, x_P=p.x_P / L,
    )  # fmt: skip
    names = (
        "X_vv",
        "X_vr",
        "X_rr",
        "X_vvvv",
        "Y_v",
        "Y_r",
        "Y_vvv",
        "Y_vvr",
        "Y_vrr",
        "Y_rrr",
        "N_v",
        "N_r",
        "N_vvv",
        "N_vvr",
        "N_vrr",
        "N_rrr",
    )
    k_0, k_1, k_2 = p.kt
    derivatives = {f"{name}_dash": getattr(h, name) for name in names}
    return basic, package.Mmg3DofManeuveringParams(k_0=k_0, k_1=k_1, k_2=k_2, R_0_dash=h.R0, **derivatives)  # type: ignore[union-attr]


def turns(number: int) -> tuple[np.ndarray, np.ndarray]:
    """s0 (number, 10) and U (number, 120, 4): rudders from -35 to 35 degrees, revolutions within 10 %."""
    rng = np.random.default_rng(0)
    delta, rpm = np.deg2rad(rng.uniform(-35.0, 35.0, number)), RPM * rng.uniform(0.9, 1.1, number)
    s0, U = straight_state(SPEED, RPM, number), np.zeros((number, HORIZON, 4))
    s0[:, 6], s0[:, 7] = rpm, delta
    U[:, :, 0], U[:, :, 1] = rpm[:, None], delta[:, None]
    return s0, U


def fitted_physics(sim: Simulator) -> Physics:
    """`physics` fitted to 12 turns of the same ship."""
    s0, U = turns(12)
    S = np.concatenate([s0[:, None], sim.rollout(s0, U, 1.0)], axis=1)
    U = np.concatenate([U, U[:, -1:]], axis=1)
    runs = tuple(Run(f"turn{i}", np.arange(HORIZON + 1.0), S[i], U[i]) for i in range(len(S)))
    return Physics().fit(Dataset("turns", sim.ship.particulars, 1.0, runs))


def check(sim: Simulator, peer: Peer, s0: np.ndarray, U: np.ndarray) -> None:
    """Integration errors of both sides in u, v, r L, and that both sail the same turn."""
    scale = np.array([1.0, 1.0, sim.ship.L]) / SPEED
    theirs, exact = (
        np.array([peer(s, c, **o) for s, c in zip(s0, U, strict=True)]) for o in ({}, {"rtol": 1e-10, "atol": 1e-12})
    )
    ours, fine = (Simulator(sim.ship, step).fast_rollout(s0, U, 1.0)[:, :, 3:6] for step in (sim.max_step, 0.02))
    their_error, our_error = (float(np.abs((a - b) * scale).max()) for a, b in ((theirs, exact), (ours, fine)))
    print(
        f"integration error, largest of u, v, r L over the speed: shipbench {our_error:.2g}, shipmmg {their_error:.2g}"
    )
    measure.agree("integration error (ours not above theirs)", our_error, their_error)
    measure.agree(
        "u, v, r L over the speed after 120 s (two writings of wake and rudder inflow)",
        float(np.abs((ours - exact) * scale)[:, -1].max()),
        0.1,
    )


def main() -> None:
    """Check, then time the batch and the single run."""
    given = measure.options(__doc__, runs=5)
    package = import_shipmmg()
    measure.header(given, "shipmmg")
    number = 20 if given.quick else 1000
    sim, (s0, U) = Simulator(load_mmg_ship("kvlcc2_l7"), 1.0), turns(number)
    basic, manoeuvring = shipmmg_ship(package, sim.ship)
    time = np.arange(HORIZON + 1.0)

    def peer(start: np.ndarray, commands: np.ndarray, **options: Any) -> np.ndarray:
        held = np.concatenate([commands[:1], commands])
        solution = package.simulate_mmg_3dof(
            basic, manoeuvring, time, held[:, 1], held[:, 0] / 60.0, u0=start[3], ρ=sim.ship.rho, **options
        )
        return solution.sol(time)[:3, 1:].T

    check(sim, peer, s0[:20], U[:20])
    model = fitted_physics(sim)
    print(
        "fitted physics against the simulator: "
        f"{np.abs(model.predict(s0, U) - sim.fast_rollout(s0, U, 1.0))[..., :2].mean():.2f} m in x, y"
    )
    loop = Side(
        f"for {number} runs: simulate_mmg_3dof(basic, manoeuvring, time, delta, npm, u0).sol(time)",
        lambda: [*map(peer, s0, U)],
    )
    batch = f"batch of {number} rollouts of 120 s"
    measure.compare(
        f"{batch}, MMG",
        Side("Simulator(ship, 1.0).fast_rollout(s0, U, 1.0)", lambda: sim.fast_rollout(s0, U, 1.0)),
        loop,
        given,
        target=50,
    )
    measure.compare(
        f"{batch}, physics", Side("physics.predict(s0, U)", lambda: model.predict(s0, U)), loop, given, target=50
    )
    start, commands, calls = s0[0], U[0], 5 if given.quick else 100
    one = Side(
        "simulate_mmg_3dof(basic, manoeuvring, time, delta, npm, u0).sol(time)",
        lambda: [peer(start, commands) for _ in range(calls)],
        calls,
    )
    ours = Side("physics.predict(s0, U)", lambda: [model.predict(start, commands) for _ in range(calls)], calls)
    found = measure.compare("one rollout of 120 s, physics", ours, one, given, target=1)
    if not given.quick:
        print(f"  under 1 ms: {'reached' if found.ours_s < 1e-3 else 'NOT reached'} ({1e3 * found.ours_s:.3f} ms)")


if __name__ == "__main__":
    main()
