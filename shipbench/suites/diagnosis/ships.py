"""Ships for the suite: known hulls at other lengths, with other derivatives, rudders, propellers, actuators and
thrusters.

Development ships come from container130, half of them with its hull forces rewritten as a cubic polynomial, test ships
from KCS and KVLCC2: tuning on the first does not use the hulls of the second.
"""

from __future__ import annotations

from dataclasses import fields, replace

import numpy as np

from ...errors import WorkError
from ...physics.hull import PolynomialHull, UnifiedHull, unified
from ...physics.mmg import MMGShip, load_mmg_ship
from ...physics.thruster import Tunnels
from ...ship import Propeller, Rudder, Ship, Thrusters, Wind
from ...simulate.fitted_ship import is_sane
from ...simulate.hidden import sail
from ...simulate.manoeuvres import self_propulsion_rpm
from ...simulate.simulator import Simulator
from ...simulate.trials import CRUISE

WHICH = ("development", "test")
PARENTS = {"development": ("container130",), "test": ("kcs", "kvlcc2_l7")}
LENGTHS = {"development": (80.0, 180.0), "test": (60.0, 200.0)}
_TRIES = 60
_RESISTANCE = {"R0", "X0_F", "X0_A"}


def scaled(ship: MMGShip, L: float) -> MMGShip:
    """Same ship at length L [m] by Froude's law; dimensionless coefficients stay."""
    k = L / ship.L
    p, a = ship.particulars, ship.actuators
    prop, blade = p.propeller or Propeller(diameter=ship.propeller.D), p.rudder or Rudder(area=ship.rudder.A_R)
    wind = p.wind or Wind(frontal_area=0.6 * p.B**2, lateral_area=0.08 * p.L**2)
    wind = Wind(frontal_area=wind.frontal_area * k**2, lateral_area=wind.lateral_area * k**2)
    thrusters = p.thrusters and Thrusters(
        x_bow=p.thrusters.x_bow * k, x_stern=p.thrusters.x_stern * k, max_force=p.thrusters.max_force * k**3
    )
    name = f"{ship.name}-{L:.0f}m"
    size = {
        "name": name, "L": L, "B": p.B * k, "T": p.T * k, "xG": (p.xG or 0.0) * k, "Izz": ship.I_zG * k**5,
        "mass": None if p.mass is None else p.mass * k**3,
        "displacement": None if p.displacement is None else p.displacement * k**3,
        "propeller": prop.model_copy(update={"diameter": prop.diameter * k, "x": ship.propeller.x_P * k}),
        "rudder": blade.model_copy(update={"area": blade.area * k**2, "height": ship.rudder.H_R * k,
                "x": ship.rudder.x_R * L}),
        "thrusters": thrusters, "wind": wind,
    }  # fmt: skip
    t = k**0.5
    return replace(
        ship, name=name, L=L, B=ship.B * k, T=ship.T * k, m=ship.m * k**3, x_G=ship.x_G * k, I_zG=ship.I_zG * k**5,
        m_x=ship.m_x * k**3,
        m_y=ship.m_y * k**3, J_z=ship.J_z * k**5,
        propeller=replace(ship.propeller, D=ship.propeller.D * k, x_P=ship.propeller.x_P * k),
        rudder=replace(ship.rudder, A_R=ship.rudder.A_R * k**2, H_R=ship.rudder.H_R * k),
        thrusters=replace(ship.thrusters, x_bow=ship.thrusters.x_bow * k, x_stern=ship.thrusters.x_stern * k,
                          speed_of_loss=ship.thrusters.speed_of_loss * t),
        actuators=replace(a, T_n=a.T_n * t, rate_n=a.rate_n / k, T_delta=a.T_delta * t, rate_delta=a.rate_delta / t,
            T_F=a.T_F * t,
                          rate_F=a.rate_F * k**2.5),
        A_F=wind.frontal_area, A_L=wind.lateral_area, particulars=p.model_copy(update=size),
    )  # fmt: skip


def with_thrusters(ship: MMGShip, rng: np.random.Generator) -> MMGShip:
    """Ship with two tunnel thrusters of a size and at places that fit the hull (those of container130 by Froude's law,
    20 % up or down)."""
    x_bow, x_stern = rng.uniform(0.36, 0.44) * ship.L, -rng.uniform(0.32, 0.42) * ship.L
    force = float(63_000.0 * ship.m / 9.6e6 * rng.uniform(0.8, 1.2))
    tunnels = Tunnels(x_bow, x_stern, rng.uniform(0.15, 0.35), rng.uniform(0.3, 0.5), 2.1 * (ship.L / 130.0) ** 0.5)
    particulars = ship.particulars.model_copy(
        update={"thrusters": Thrusters(x_bow=x_bow, x_stern=x_stern, max_force=force)}
    )
    return replace(ship, thrusters=tunnels, particulars=particulars)


def with_actuators(ship: MMGShip, rng: np.random.Generator) -> MMGShip:
    """Ship with actuators of container130 by Froude's law, each 20 % faster or slower."""
    like = scaled(load_mmg_ship("container130"), ship.L).actuators
    force = ship.particulars.thrusters.max_force if ship.particulars.thrusters else 1.0
    own = {
        f.name: getattr(like, f.name) * rng.uniform(0.8, 1.25)
        for f in fields(like)
        if f.name not in ("delta_max", "rate_F")
    }
    return replace(
        ship, actuators=replace(like, **own, rate_F=0.5 * force / (ship.L / 130.0) ** 0.5, delta_max=np.deg2rad(35.0))
    )


def with_other_hull(ship: MMGShip, rng: np.random.Generator, which: str) -> MMGShip:
    """Ship with other derivatives and added masses: 10 to 40 % up or down (development), N(0, s) with s of 15 to 30 %
    (test); resistance a third of that."""
    spread = rng.uniform(0.15, 0.3)

    def change() -> float:
        step = (
            rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 0.4)
            if which == "development"
            else spread * rng.standard_normal()
        )
        return float(np.clip(step, -0.5, 0.6))

    values = {
        f.name: getattr(ship.hull, f.name) * (1.0 + change() * (0.33 if f.name in _RESISTANCE else 1.0))
        for f in fields(ship.hull)
    }
    return replace(
        ship,
        hull=replace(ship.hull, **values),
        m_y=ship.m_y * (1.0 + 0.5 * change()),
        J_z=ship.J_z * (1.0 + 0.5 * change()),
    )


def as_polynomial(hull: UnifiedHull) -> PolynomialHull:
    """Cubic polynomial nearest to a hull's forces up to 25 deg of drift and r' = 0.8: another structure, which differs
    where the cubic ends."""
    beta, rp = (a.ravel() for a in np.meshgrid(np.deg2rad(np.linspace(-25.0, 25.0, 21)), np.linspace(-0.8, 0.8, 17)))
    v = -np.sin(beta)
    X, Y, N = (f / 0.5 for f in unified(np.cos(beta), v, rp, hull, 1.0, 1.0, 1.0))
    surge = np.stack([v * v, v * rp, rp * rp, v**4], axis=1)
    odd = np.stack([v, rp, v**3, v * v * rp, v * rp * rp, rp**3], axis=1)
    fitted = [
        np.linalg.lstsq(basis, force, rcond=None)[0].tolist()
        for basis, force in ((surge, X - hull.X0_F * np.cos(beta) ** 2), (odd, Y), (odd, N))
    ]
    return PolynomialHull(-hull.X0_F, *fitted[0], *fitted[1], *fitted[2])


def with_other_gear(ship: MMGShip, rng: np.random.Generator) -> MMGShip:
    """Ship with another rudder area and propeller diameter (the ship file states them), another race and flow
    straightening (it does not)."""
    area, diameter = rng.uniform(0.85, 1.2), rng.uniform(0.95, 1.05)
    p, c = ship.particulars, ship.rudder
    blade, prop = p.rudder, p.propeller
    known: Ship = p.model_copy(
        update={
            "rudder": blade and blade.model_copy(update={"area": c.A_R * area, "height": c.H_R * area**0.5}),
            "propeller": prop and prop.model_copy(update={"diameter": ship.propeller.D * diameter}),
        }
    )
    kappa, plus, minus = rng.uniform(0.9, 1.1, 3) * (c.kappa, c.gamma_plus, c.gamma_minus)
    rudder = replace(c, A_R=c.A_R * area, H_R=c.H_R * area**0.5, kappa=kappa, gamma_plus=plus, gamma_minus=minus)
    return replace(
        ship, particulars=known, rudder=rudder, propeller=replace(ship.propeller, D=ship.propeller.D * diameter)
    )


def steers(ship: MMGShip) -> bool:
    """Whether it can be sailed: 240 s (at 130 m) of hard turns to both sides do not spin it, and nearly straight ahead
    it does not turn by itself faster than r' = 0.5."""
    scale = (ship.L / 130.0) ** 0.5
    speed, dt = CRUISE * scale, 2.0 * scale
    rpm = self_propulsion_rpm(Simulator(ship), speed)
    s0 = np.zeros((4, 10))
    s0[:, 3], s0[:, 6] = speed, rpm
    U = np.zeros((4, 120, 4))
    U[..., 0] = rpm
    U[:2, :, 1] = np.deg2rad([[35.0], [-35.0]])
    U[2:, :10, 1] = np.deg2rad([[3.0], [-3.0]])
    S = sail(ship, s0, U, dt, max_step=scale)
    if not is_sane(S, ship.L):
        return False
    end = S[2:, -30:]
    return bool(np.max(np.abs(end[..., 5]) * ship.L / np.hypot(end[..., 3], end[..., 4])) < 0.5)


def draw_ship(rng: np.random.Generator, which: str, thrusters: bool) -> MMGShip:
    """Draw a development or test ship; `thrusters`: it must have them (else test ships have them in half of the draws).

    Raises:
        WorkError: no drawn variant steers.
    """
    parent = load_mmg_ship(str(rng.choice(PARENTS[which])))
    fitted = thrusters or bool(rng.random() < 0.5)
    for _ in range(_TRIES):
        ship = scaled(parent, float(rng.uniform(*LENGTHS[which])))
        if ship.particulars.thrusters is None and fitted:
            ship = with_thrusters(ship, rng)
        ship = with_actuators(with_other_gear(with_other_hull(ship, rng, which), rng), rng)
        if which == "development" and isinstance(ship.hull, UnifiedHull) and rng.random() < 0.5:
            ship = replace(ship, hull=as_polynomial(ship.hull), name=f"{ship.name}-polynomial")
        if steers(ship):
            return ship
    raise WorkError(f"none of {_TRIES} variants of ship '{parent.name}' steers; draw from another seed.")
