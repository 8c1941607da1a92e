"""Sea trials of a ship that *is* the fitted model: eq. (2) with drawn parameters. No cause is hidden and the structure
is the same.

It serves to count false alarms only; causes to be found are always hidden in the MMG ship.
"""

from __future__ import annotations

import numpy as np

from ..effects.base import having, searched_by
from ..errors import InputError, WorkError
from ..ops import Array
from ..physics import eq2, wind
from ..physics.modifiers import Flow, Modifiers
from ..records import Dataset
from ..ship import Particulars, complete
from .hidden import Hidden, Vessel, actuator_paths, integrate
from .trials import CRUISE, Trials, draw_sailing, write_down

HULL_SPREAD = 0.2
"""Standard deviation of the relative differences of the drawn hull from the regressions."""

_TRIES = 50
_MAX_TURN = 1.5


def draw_parameters(rng: np.random.Generator, c: eq2.Coefficients) -> list[float]:
    """Draw p0..p10 of a symmetric ship: resistance, lift and drag of the rudder near the values of the source paper and
    rudder theory."""
    area, speed = 0.5 * c.rho * c.L * c.T, 0.1 * np.sqrt(9.81 * c.L)
    p = [0.0] * eq2.NUM_PARAMETERS
    p[1] = 0.002 * area * speed * rng.uniform(0.0, 2.0)
    p[2] = 0.015 * area * rng.uniform(0.7, 1.3)
    p[5], p[7] = 2.5 * rng.uniform(0.8, 1.2), -1.6 * rng.uniform(0.5, 1.5)
    p[8], p[10] = 0.03 * rng.uniform(0.5, 1.5), 1.5 * rng.uniform(0.7, 1.3)
    return p


def draw_hull(rng: np.random.Generator) -> list[Hidden]:
    """Draw differences of an ordinary ship from the regressions: hull derivatives, and the effects with the trait
    `ordinary`."""
    (hull,) = searched_by("hull")
    factors = np.clip(HULL_SPREAD * rng.standard_normal(len(hull.parameters)), -0.5, 0.5)
    own = []
    for effect in having("ordinary"):
        centre, spread = effect.traits.ordinary
        own.append(
            Hidden(effect, effect.internal({effect.parameters[0].name: centre + spread * rng.standard_normal()}))
        )
    return [Hidden(hull, tuple(float(f) for f in factors)), *own]


def _modifiers(hull: list[Hidden], s: Flow, ship: Particulars) -> Modifiers:
    e = Modifiers()
    for item in hull:
        item.effect.force(e, s, item.q, ship)
    return e


def _self_propulsion(c: eq2.Coefficients, p: list[float], speed: float) -> float:
    """Shaft speed [rpm] that holds `speed` [m/s] straight ahead (bisection)."""
    low, high = 0.0, 60_000.0 / c.D_P**0.5
    for _ in range(100):
        middle = 0.5 * (low + high)
        du = eq2.accelerations(speed, 0.0, 0.0, middle, 0.0, 0.0, 0.0, None, c, p)[0]
        low, high = (middle, high) if du < 0 else (low, middle)
    return 0.5 * (low + high)


def gust_size(c: eq2.Coefficients, speed: float, gust: float) -> np.ndarray:
    """Accelerations (3,) [m/s^2, m/s^2, rad/s^2] of a gust [m/s] from ahead (surge) and abeam (sway, yaw) at `speed`
    [m/s] in calm air, with the wind forces of the MMG ship, so that both simulators are shaken alike."""
    calm, ahead, abeam = (
        wind.blendermann(speed + a, b, c.A_F, c.A_L, c.L) for a, b in ((0.0, 0.0), (gust, 0.0), (0.0, gust))
    )
    return np.abs(np.array([(ahead[0] - calm[0]) / (c.m + c.m_x), abeam[1] / c.m11, abeam[2] / c.m22]))


def _gusts(rng: np.random.Generator, runs: int, steps: int, dt: float, size: np.ndarray, tau: float) -> np.ndarray:
    """Ornstein-Uhlenbeck accelerations (runs, steps, 3)."""
    keep = np.exp(-dt / tau)
    out = np.empty((runs, steps, 3))
    out[:, 0] = rng.standard_normal((runs, 3))
    for k in range(1, steps):
        out[:, k] = keep * out[:, k - 1] + np.sqrt(1.0 - keep * keep) * rng.standard_normal((runs, 3))
    return size * out


def fitted_trials(ship: Vessel, seed: int, plan: Trials | None = None, name: str = "trials") -> Dataset:
    """Trials of eq. (2) on the particulars and actuators of `ship`: same commands, sensors and size of gusts as
    `sea_trials`.

    A drawn hull that spins (|r| L over the speed beyond 1.5) is drawn again.

    Raises:
        InputError: the plan has a mean wind, which eq. (2) does not know.
        WorkError: no drawn hull of 50 is one that can be sailed.
    """
    plan = plan or Trials()
    if any(plan.wind):
        raise InputError(
            f"trials of eq. (2) have no mean wind (value: {plan.wind}); accepted: gusts alone, or `sea_trials` of "
            "an MMG ship."
        )
    rng = np.random.default_rng(seed)
    particulars = complete(ship.particulars)
    c = eq2.coefficients(particulars)
    speed = CRUISE * (ship.L / 130.0) ** 0.5
    size = gust_size(c, speed, plan.gusts * (ship.L / 130.0) ** 0.5)
    for _ in range(_TRIES):
        p, hull = draw_parameters(rng, c), draw_hull(rng)
        sailing = draw_sailing(rng, ship, plan, _self_propulsion(c, p, speed))
        gusts = _gusts(rng, plan.runs, sailing.U.shape[1], sailing.dt, size, 20.0 * sailing.scale)
        num = max(1, int(np.ceil(sailing.dt / sailing.max_step - 1e-9)))

        def acceleration(
            s: Flow, k: int, p: list[float] = p, hull: list[Hidden] = hull, gusts: np.ndarray = gusts
        ) -> tuple[Array, ...]:
            e = _modifiers(hull, s, particulars)
            found = eq2.accelerations(s.u, s.v, s.r, s.n, s.delta, s.F_b, s.F_s, (s.u, s.v), c, p, e)
            return tuple(a + gusts[:, k, i] for i, a in enumerate(found))

        S = integrate(
            acceleration, sailing.s0, actuator_paths(ship, sailing.s0, sailing.U, sailing.dt, num), sailing.dt, num
        )
        if is_sane(S, ship.L):
            return write_down(
                ship, sailing, S, (), plan, rng, name, f"shipbench trials of eq. (2) on {ship.name}, seed {seed}"
            )
    raise WorkError(
        f"trials of eq. (2) on ship '{ship.name}': none of {_TRIES} drawn hulls can be sailed; choose another ship "
        "or seed."
    )


def is_sane(S: np.ndarray, L: float) -> bool:
    """Whether all runs S (runs, samples, 10) stay finite and none spins: |r| L is below 1.5 times the speed (0.8 m/s at
    least, at 130 m)."""
    if not np.all(np.isfinite(S)):
        return False
    floor = 0.8 * (L / 130.0) ** 0.5
    return bool(np.all(np.abs(S[..., 5]) * L <= _MAX_TURN * np.maximum(np.hypot(S[..., 3], S[..., 4]), floor)))
