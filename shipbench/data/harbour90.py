"""Simulated port approaches and departures of the 130 m container ship, 90 runs of 120 s at 1 s, without noise."""

from __future__ import annotations

import numpy as np

from ..physics.mmg import load_mmg_ship
from ..records import Dataset, Run
from ..run_meta import RunMeta
from ..signals import COMMANDS
from ..simulate.harbour import Gusts, draw_plan, fly
from .base import DatasetPart

SHIP = "container130"
# of the first 30 seeds, the one whose statistics are closest to the source paper's Table II (`shipbench data describe
# harbour90`)
SEED = 19
NUM_RUNS, HORIZON, WARM_UP = 90, 120, 60


def simulate(name: str, seed: int, gusts: Gusts | None = None, noise: np.ndarray | None = None) -> Dataset:
    """Sail the 90 runs of `seed`; `noise` (10,) are standard deviations of white sensor noise on the states (thruster
    forces: relative)."""
    ship = load_mmg_ship(SHIP)
    plan_rng, wind_rng, noise_rng = (np.random.default_rng(s) for s in (seed, [seed, 1], [seed, 2]))
    plan = draw_plan(plan_rng, NUM_RUNS, ship.L, HORIZON, WARM_UP)
    S, C = fly(ship, plan, wind_rng, HORIZON, WARM_UP, gusts)
    if noise is not None:
        scale = np.broadcast_to(noise, S.shape).copy()
        scale[..., 8:] *= np.abs(S[..., 8:])
        S = S + scale * noise_rng.standard_normal(S.shape)
    t = np.arange(HORIZON + 1, dtype=float)
    kinds = np.where(plan.stopping, "stop", np.where(plan.thrusters, "thruster_assist", "transit"))
    runs = tuple(Run(f"run{i:02d}", t, S[i], C[i], COMMANDS, RunMeta(manoeuvre=str(kinds[i]))) for i in range(NUM_RUNS))
    return Dataset(
        name=name, ship=ship.particulars, dt=1.0, runs=runs, actuators="measured", simulation=SHIP, licence="MIT",
        source=f"shipbench simulator, MMG ship '{SHIP}', seed {seed}",
    )  # fmt: skip


def make(seed: int = SEED) -> Dataset:
    """Make the noise-free set; the same seed gives the same samples."""
    return simulate("harbour90", int(seed))


DATASET = DatasetPart(
    "harbour90",
    "90 simulated port manoeuvres of a 130 m container ship, 120 s at 1 s, no noise",
    "MIT",
    make,
    cached=True,
)
