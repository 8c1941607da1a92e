"""MMG ship: hull, propeller, rudder, thrusters, wind, current and depth summed into accelerations. This is the
simulator's truth.

The fitted model (`eq2`) has a different structure on purpose: data made and fitted with the same equations prove
little.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from ..errors import InputError, unknown_name
from ..ops import Array, cos, sin, where
from ..ship import Ship
from ..toml_files import read_toml
from . import hull, propeller, rudder, shallow_water, thruster, wind
from .modifiers import Modifiers, is_neutral


@dataclass(frozen=True)
class MMGPropeller:
    """Propeller and wake; `form` is "quadratic" (K_T polynomial) or "four_quadrant" (B4-70, P/D 0.8)."""

    form: str
    D: float
    w_P0: float
    t_P: float
    x_P: float
    C1: float
    C2_plus: float
    C2_minus: float
    kt: tuple[float, float, float] = (0.0, 0.0, 0.0)
    side_force_astern: bool = False


@dataclass(frozen=True)
class MMGActuators:
    """Time constants [s] and rate limits of shaft [rev/s^2], rudder [rad/s] and thrusters [N/s]; greatest rudder angle
    [rad]."""

    T_n: float
    rate_n: float
    T_delta: float
    rate_delta: float
    T_F: float
    rate_F: float
    delta_max: float


@dataclass(frozen=True)
class MMGShip:
    """Particulars and coefficients of a simulated ship; masses in kg, inertia in kg m^2, lengths in m."""

    name: str
    L: float
    B: float
    T: float
    Cb: float
    rho: float
    m: float
    x_G: float
    I_zG: float
    m_x: float
    m_y: float
    J_z: float
    hull: hull.PolynomialHull | hull.UnifiedHull
    propeller: MMGPropeller
    rudder: rudder.MMGRudder
    thrusters: thruster.Tunnels
    actuators: MMGActuators
    A_F: float
    A_L: float
    particulars: Ship


@dataclass(frozen=True)
class Environment:
    """Current, wind and depth, uniform over the field; each value a float or one per run.

    current_speed [m/s] and current_to [rad, direction it flows towards]; wind_speed [m/s] and wind_from [rad]; depth
    [m].
    """

    current_speed: Array = 0.0
    current_to: Array = 0.0
    wind_speed: Array = 0.0
    wind_from: Array = 0.0
    depth: Array | None = None


CALM = Environment()


def accelerations(
    ship: MMGShip,
    psi: Array,
    u: Array,
    v: Array,
    r: Array,
    n: Array,
    delta: Array,
    F_b: Array,
    F_s: Array,
    env: Environment = CALM,
    mods: Modifiers | None = None,
) -> tuple[Array, Array, Array]:
    """Accelerations (du, dv, dr) over ground at midship [m/s^2, m/s^2, rad/s^2]; n in rpm, delta in rad, F_b and F_s in
    N.

    (m + m_x) du - (m + m_y) v r - m x_G r^2 = X;  (m + m_y) dv + (m + m_x) u r + m x_G dr = Y; (I_zG + m x_G^2 + J_z)
    dr + m x_G (dv + u r) = N, all with velocities through the water, to which the turning of a constant current is
    added. `mods` carries hidden effects.

    Source: Yasukawa & Yoshimura (2015), eq. 4; current as in Fossen (2021), section 10.3.
    """
    e = mods or Modifiers()
    u_rw, v_rw = wind.apparent_wind(psi, u, v, env.wind_speed, env.wind_from)
    u_rw, v_rw = u_rw - e.air_u, v_rw - e.air_v
    u_m, v_m = e.water((u_rw, v_rw), u, v)
    u_c = env.current_speed * cos(env.current_to - psi) + u_m
    v_c = env.current_speed * sin(env.current_to - psi) + v_m
    u_w, v_w = u - u_c, v - v_c
    m_x, m_y, J_z, factors = ship.m_x * e.m_x, ship.m_y * e.m_y, ship.J_z * e.J_z, e.hull
    if env.depth is not None:
        deep = shallow_water.depth_factors(env.depth, ship.L, ship.B, ship.T, ship.Cb)
        m_y, J_z, factors = m_y * deep.m_y, J_z * deep.J_z, factors * deep.hull
    X, Y, N = water_forces(ship, u_w, v_w, r, n / 60.0, delta, F_b, F_s, factors, e)
    X_W, Y_W, N_W = e.wind_on(*wind.blendermann(u_rw, v_rw, ship.A_F, ship.A_L, ship.L))
    X, Y, N = X + X_W + e.X, Y + Y_W + e.Y, N + N_W + e.N
    m, x_G = ship.m * e.mass, ship.x_G + e.x_G
    du = (X + (m + m_y) * v_w * r + m * x_G * r * r) / (m + m_x)
    m11, m12, m22 = m + m_y, m * x_G, ship.I_zG * e.mass + m * x_G**2 + J_z
    f1, f2 = Y - (m + m_x) * u_w * r, N - m * x_G * u_w * r
    det = m11 * m22 - m12 * m12
    dv = (m22 * f1 - m12 * f2) / det
    dr = (m11 * f2 - m12 * f1) / det
    return du + r * v_c, dv - r * u_c, dr


def water_forces(
    ship: MMGShip,
    u: Array,
    v: Array,
    r: Array,
    n: Array,
    delta: Array,
    F_b: Array,
    F_s: Array,
    factors: hull.HullFactors,
    e: Modifiers | None = None,
) -> tuple[Array, Array, Array]:
    """Sum of hull, propeller, rudder and thruster forces (X, Y, N) about midship; velocities through the water, n in
    rev/s."""
    p, e = ship.propeller, e or Modifiers()
    if isinstance(ship.hull, hull.PolynomialHull):
        X_H, Y_H, N_H = hull.polynomial(u, v, r, ship.hull, ship.L, ship.T, ship.rho, factors)
    else:
        X_H, Y_H, N_H = hull.unified(u, v, r, ship.hull, ship.L, ship.T, ship.rho, factors)
    w_P = propeller.wake_fraction(u, v, r, p.w_P0, p.x_P, p.C1, p.C2_plus, p.C2_minus)
    w_P = w_P if is_neutral(e.wake, 0.0) else w_P + where(u > 0, e.wake, 0.0 * w_P)
    V_A = (1.0 - w_P) * u
    if p.form == "quadratic":
        thrust = propeller.thrust_quadratic(n, V_A, p.D, p.kt, ship.rho)
    else:
        thrust = propeller.thrust_four_quadrant(n, V_A, p.D, ship.rho)
    thrust = thrust * e.thrust
    u_R = rudder.inflow_speed(u, n, thrust, w_P, ship.rudder, p.D, ship.rho, e.race)
    X_R, Y_R, N_R = rudder.mmg_rudder(u, v, r, delta + e.delta, u_R, ship.rudder, ship.L, ship.rho, e.lift_factor)
    Y_T, N_T = thruster.tunnel_thrusters(u, F_b * e.bow, F_s * e.stern, ship.thrusters, e.loss, e.lever)
    X = X_H + (1.0 - p.t_P) * thrust + X_R
    Y, N = Y_H + Y_R + Y_T, N_H + N_R + N_T
    if p.side_force_astern:
        Y_P, N_P = propeller.side_force_astern(n, u, p.D, ship.L, ship.T, ship.rho)
        Y, N = Y + Y_P, N + N_P
    return X, Y, N


def ships_folder() -> Path:
    """Folder of the ship files: inside an installed package, else the repository's `configs/ships`."""
    package = Path(__file__).resolve().parent.parent
    inside = package / "configs" / "ships"
    return inside if inside.is_dir() else package.parent / "configs" / "ships"


def load_mmg_ship(name: str) -> MMGShip:
    """Read `configs/ships/<name>.toml`: the particulars, and the simulator's coefficients in its [mmg] table.

    Raises:
        InputError: no such ship, or a coefficient is missing or unknown.
    """
    path = ships_folder() / f"{name}.toml"
    if not path.is_file():
        raise unknown_name("ship", name, [p.stem for p in ships_folder().glob("*.toml")])
    data = read_toml(path)
    ship = Ship.load(path)
    try:
        mmg = data["mmg"]
        return _assemble(ship, mmg)
    except (KeyError, TypeError) as error:
        raise InputError(
            f"{path}: [mmg] is incomplete: {error}. See configs/ships/container130.toml for a full set."
        ) from None


def _assemble(ship: Ship, mmg: dict[str, Any]) -> MMGShip:
    rho, L, T = ship.rho, ship.L, ship.T
    m = ship.mass if ship.mass is not None else rho * float(ship.displacement or 0.0)
    unit_mass, unit_inertia = 0.5 * rho * L**2 * T, 0.5 * rho * L**4 * T
    hull_data = dict(mmg["hull"])
    form = hull_data.pop("form")
    if ship.propeller is None or ship.rudder is None or ship.rudder.height is None:
        raise KeyError("[propeller] and [rudder] with height")
    prop, blade = ship.propeller, ship.rudder
    aspect = float(ship.rudder.height) ** 2 / blade.area
    rudder_data = {"f_alpha": rudder.lift_slope(aspect), **mmg["rudder"]}
    thrusters = ship.thrusters
    tunnels = mmg.get("thrusters", {})
    kinds = {"polynomial": hull.PolynomialHull, "unified": hull.UnifiedHull}
    return MMGShip(
        name=ship.name, L=L, B=ship.B, T=T, Cb=float(ship.Cb or m / (rho * L * ship.B * T)), rho=rho, m=m,
        x_G=float(ship.xG or 0.0),
        I_zG=ship.Izz if ship.Izz is not None else m * (0.25 * L) ** 2,
        m_x=mmg["m_x_dash"] * unit_mass, m_y=mmg["m_y_dash"] * unit_mass, J_z=mmg["J_z_dash"] * unit_inertia,
        hull=kinds[form](**hull_data),
        propeller=MMGPropeller(
            D=prop.diameter, w_P0=float(prop.wake or 0.0), t_P=float(prop.thrust_deduction or 0.0),
            x_P=float(prop.x or -0.48 * L),
            kt=prop.kt or (0.0, 0.0, 0.0), **mmg["propeller"],
        ),
        rudder=rudder.MMGRudder(A_R=blade.area, H_R=float(ship.rudder.height), **rudder_data),
        thrusters=thruster.Tunnels(thrusters.x_bow if thrusters else 0.0, thrusters.x_stern if thrusters else 0.0,
            **tunnels),
        actuators=MMGActuators(**{f.name: mmg["actuators"][f.name] for f in fields(MMGActuators)}),
        A_F=ship.wind.frontal_area if ship.wind else 0.0, A_L=ship.wind.lateral_area if ship.wind else 1.0,
        particulars=ship,
    )  # fmt: skip
