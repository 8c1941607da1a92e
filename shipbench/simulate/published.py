"""Four ships of the literature in their authors' own equations, which neither the MMG simulator nor the fitted model
shares.

Trials of these ships test the diagnosis on hulls, propellers and rudders unknown to the fit: cubic hull forces with
products of rudder and drift (Mariner), thrust and rudder flow as quadratics of speed and shaft speed (tanker), a hull
that heels in turns (S175), a small fast one that heels, with absolute values in its hull forces and rudders beside the
races (navy). Side forces of the propeller and of zero helm and a rudder's stall are left out: they are causes with
names.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy.optimize import brentq

from ..effects.base import flow_first
from ..errors import InputError
from ..integrate import rk4_step
from ..physics.mmg import MMGActuators
from ..physics.modifiers import Flow, Modifiers, is_neutral
from ..physics.wind import RHO_AIR, apparent_wind
from ..records import Dataset
from ..ship import Propeller, Rudder, Ship, Wind, complete
from .hidden import Hidden, actuator_paths
from .trials import Trials, draw_sailing, gusts, write_down

Motion = tuple[np.ndarray, ...]
Push = tuple[np.ndarray, np.ndarray, np.ndarray]
_UNDERSTOOD = ("u_c", "v_c", "air_u", "air_v", "delta", "thrust", "X", "Y", "N")
"""Fields of `Modifiers` that are defined for any ship's equations."""
_SUBSTEPS = 4


@dataclass(frozen=True)
class Published:
    """Ship and its equations.

    Attributes:
        particulars: given to a user of the diagnosis.
        actuators: of an ordinary ship of this size; the sources leave them open or limit angles to the range of
            autopilots.
        cruise: speed [m/s] about which the equations hold; trials begin at `ratios` of it.
        rates: (motion, n [rpm], delta [rad], factor of the thrust, (X, Y, N) [N, N, N m] to add) -> accelerations;
            motion is u, v, r through the water and, beyond the plane, further states, whose rates follow.
        more: number of those: roll rate [rad/s] and heel [rad], or none.
        rpm: of the shaft where the equations have none.
    """

    name: str
    particulars: Ship
    actuators: MMGActuators
    cruise: float
    ratios: tuple[float, float]
    rates: Callable[[Motion, np.ndarray, np.ndarray, float, Push], Motion]
    more: int = 0
    rpm: float | None = None

    @property
    def L(self) -> float:
        return self.particulars.L


def _sum(terms: Mapping[str, float], **values: np.ndarray) -> np.ndarray:
    """Sum of coefficient times product: {"vvr": c} is c v v r."""
    return np.sum([c * np.prod([values[letter] for letter in term], axis=0) for term, c in terms.items()], axis=0)


_MARINER = {
    "X": {"u": -184, "uu": -110, "uuu": -215, "vv": -899, "rr": 18, "rv": 798, "dd": -95, "udd": -190, "vd": 93,
        "uvd": 93},
    "Y": {"v": -1160, "r": -499, "vvv": -8078, "vvr": 15356, "vu": -1160, "ru": -499, "d": 278, "ddd": -90, "ud": 556,
        "uud": 278, "vdd": -4,
          "vvd": 1190},
    "N": {"v": -264, "r": -166, "vvv": 1636, "vvr": -5483, "vu": -264, "ru": -166, "d": -139, "ddd": 45, "ud": -278,
        "uud": -139, "vdd": 13,
          "vvd": -489},
}  # fmt: skip
_SERVICE = 7.7175


def _mariner(motion: Motion, n: np.ndarray, delta: np.ndarray, thrust: float, push: Push) -> Motion:
    """Ship of Chislett & Strom-Tejsen (1965), HyA report Hy-5, about 15 kn; coefficients 1e-5, on rho/2 L^2 U^2.

    The shaft is not in the equations; more thrust is more of the force that holds the service speed, half of -X_u as
    for a resistance that grows with the square.
    """
    L, m, I_z, x_G = 160.93, 798e-5, 39.2e-5, -0.023
    U = np.hypot(motion[0], motion[1]) + 1e-9
    u, v, r, d = (motion[0] - _SERVICE) / U, motion[1] / U, motion[2] * L / U, -delta
    q = 0.5 * 1025.0 * L * L * U * U
    X, Y, N = (1e-5 * _sum(_MARINER[axis], u=u, v=v, r=r, d=d) for axis in "XYN")
    X = X + (thrust - 1.0) * 57e-5 * _SERVICE**2 / U**2
    X, Y, N = X + push[0] / q, Y + push[1] / q, N + push[2] / (q * L)
    m22, m23, m32, m33 = m + 748e-5, m * x_G + 9.354e-5, m * x_G - 4.646e-5, I_z + 43.8e-5
    det = m22 * m33 - m23 * m32
    unit = U * U / L
    return X * unit / (m + 42e-5), (m33 * Y - m23 * N) * unit / det, (m22 * N - m32 * Y) * unit / (L * det)


def _tanker(motion: Motion, n: np.ndarray, delta: np.ndarray, thrust: float, push: Push) -> Motion:
    """Van Berlekom & Goddard (1972), SNAME Trans. 80, deep water: a 190,000 dwt tanker; forces by mass (bis system)."""
    L, mass = 304.8, 220_000.0 * 1025.0
    u, v, r = motion
    rps, d = np.maximum(n, 0.0) / 60.0, -delta
    beta = np.arctan2(v, np.maximum(u, 0.1))
    T = thrust * (-0.00695 / L * u * u - 0.00063 * u * rps + 0.0000354 * L * rps * rps)
    c = np.maximum(0.605 * u * rps + 38.2 * rps * rps, 0.0)
    swirl = c * np.abs(beta) * beta * np.abs(d)
    X = (-0.0377 * u * u + 0.3 * v * v - 0.093 * c * d * d + 0.152 * c * beta * d) / L + 2.02 * v * r + 0.78 * T
    Y = (-1.205 * u * v - 2.4 * np.abs(v) * v + 0.208 * c * d - 2.16 * swirl) / L - 0.752 * u * r
    N = (-0.451 * u * v - 0.098 * c * d + 0.688 * swirl) / L**2 - (0.3 * np.abs(v) * r + 0.231 * u * r) / L
    return (X + push[0] / mass) / 1.05, (Y + push[1] / mass) / 2.02, (N + push[2] / (mass * L * L)) / 0.1232


_S175 = {
    "X": {"uu": -0.0004226, "vr": -0.00311, "vv": -0.00386, "rr": 0.0002, "ff": -0.0002},
    "Y": {"v": -0.0116, "r": 0.00242, "f": -0.000063, "vvv": -0.109, "rrr": 0.00177, "vvr": 0.0214, "vrr": -0.0405,
        "vvf": 0.04605, "vff": 0.00304,
          "rrf": 0.009325, "rff": -0.001368},
    "K": {"v": 0.0003026, "r": -0.000063, "p": -0.0000075, "f": -0.000021, "vvv": 0.002843, "rrr": -0.0000462,
        "vvr": -0.000588, "vrr": 0.0010565,
          "vvf": -0.0012012, "vff": -0.0000793, "rrf": -0.000243, "rff": 0.00003569},
    "N": {"v": -0.0038545, "r": -0.00222, "p": 0.000213, "f": -0.0001424, "vvv": 0.001492, "rrr": -0.00229,
        "vvr": -0.0424, "vrr": 0.00156,
          "vvf": -0.019058, "vff": -0.0053766, "rrf": -0.0038592, "rff": 0.0024195},
}  # fmt: skip


def _s175(motion: Motion, n: np.ndarray, delta: np.ndarray, thrust: float, push: Push) -> Motion:
    """Son & Nomoto (1982), Naval Arch. Ocean Eng. 20: the container ship S175 with heel; on rho/2 L^2 U^2."""
    L, D, rho = 175.0, 6.533, 1025.0
    m, m_x, m_y, I_x, I_z, height, lever = 0.00792, 0.000238, 0.007049, 0.0000210, 0.000875, 0.0313, 0.05
    U = np.hypot(motion[0], motion[1]) + 1e-9
    u, v, r, p, f = motion[0] / U, motion[1] / U, motion[2] * L / U, motion[3] * L / U, motion[4]
    rps = np.maximum(n / 60.0, 0.05)
    u_P = u * (0.816 + 1.09 * (v - 0.526 * r) ** 2)
    J = np.maximum(u_P * U / (rps * D), 1e-3)
    K_T = 0.527 - 0.455 * J
    u_R = 0.921 * u_P * np.sqrt(np.maximum(1.0 + 8.0 * 0.631 * K_T / (np.pi * J * J), 0.01))
    v_R = 0.088 * v - 0.156 * r - 0.275 * r**3 + 1.96 * r * r * v
    F_N = -6.13 * 1.8219 / (1.8219 + 2.25) * 33.0376 / L**2 * (u_R**2 + v_R**2) * np.sin(delta + np.arctan(v_R / u_R))
    T = thrust * 2.0 * D**4 / (U * L) ** 2 * K_T * rps * rps
    X, Y, K, N = (_sum(_S175[axis], u=u, v=v, r=r, p=p, f=f) for axis in "XYKN")
    q = 0.5 * rho * L * L * U * U
    X = X + 0.825 * T + 0.71 * F_N * np.sin(delta) + (m + m_y) * v * r + push[0] / q
    Y = Y + 1.237 * F_N * np.cos(delta) - (m + m_x) * u * r + push[1] / q
    K = K - 1.237 * 0.033 * F_N * np.cos(delta) + m_x * height * u * r - rho * 9.81 * 21222.0 / q * 0.3 / L * f
    N = N - (0.5 + 0.237 * 0.48) * F_N * np.cos(delta) + push[2] / (q * L)
    inertia = np.array([[m + m_y, -m_y * height, m_y * lever], [-m_y * height, I_x, 0.0], [m_y * lever, 0.0, I_z]])
    dv, dp, dr = np.linalg.solve(inertia, np.array([Y, K, N]))
    return X * U * U / (m + m_x) / L, dv * U * U / L, dr * U * U / L**2, dp * U * U / L**2, motion[3]


_NAVY: dict[str, dict[str, float]] = {
    "Y": {"Uv": -11800, "ur": 131000, "Vv": -3700, "vR": -794000, "rV": -182000, "fUV": 10800, "fUR": 251000,
        "fuu": -74},
    "K": {"Uv": 9260, "ur": -102000, "Vv": 29300, "vR": 621000, "rV": 142000, "fUV": -8400, "fUR": -196000,
        "fuu": -1180, "Up": -15500,
          "Pp": -416000, "p": -500000},
    "N": {"Uv": -92000, "Ur": -4710000, "Rr": -202e6, "rV": -15.6e6, "fUV": -214000, "fuR": -4980000, "fuU": -8000},
}  # fmt: skip


def _navy(motion: Motion, n: np.ndarray, delta: np.ndarray, thrust: float, push: Push) -> Motion:
    """Blanke & Christensen (1993), 10th Ship Control Systems Symposium, Ottawa: a multipurpose navy ship at 8 m/s, SI,
    about midship; in capitals the absolute values. Two rudders of 1.5 m^2 whose lift grows by 0.054 a degree; stall at
    23 degrees is left out. The propellers are not in the source: two of 1.6 m with K_T = 0.45 - 0.40 J, bilinear in
    revolutions and speed, as are linear propeller models."""
    rho, volume, x_G, z_G, x_R, z_R, D = 1014.0, 357.0, -3.38, -1.06, -23.79, 1.5, 1.6
    m, (u, v, r, p, f), rps = rho * volume, motion, np.maximum(n, 0.0) / 60.0
    values = {"u": u, "v": v, "r": r, "p": p, "f": f, "U": np.abs(u), "V": np.abs(v), "R": np.abs(r), "P": np.abs(p)}
    Y, K, N = (_sum(_NAVY[axis], **values) for axis in "YKN")
    angle = delta + np.arctan2(v + x_R * r, np.maximum(u, 0.1))
    lift = 0.5 * rho * 3.0 * (u * u + v * v) * 0.054 * np.rad2deg(angle)
    T = thrust * 2.0 * rho * D**4 * (0.45 * rps * rps - 0.40 * rps * 0.95 * u / D)
    X = (
        0.95 * T
        - 1960.0 * u * np.abs(u)
        + 1.33 * m * v * r
        + m * (x_G * r * r - z_G * p * r)
        - np.abs(lift * np.sin(delta))
        + push[0]
    )
    Y = Y - m * u * r - lift * np.cos(delta) + push[1]
    K = K + m * z_G * u * r + z_R * lift * np.cos(delta) - m * 9.81 * (1.1 * f + 0.325 * f**3)
    N = N - m * x_G * u * r - x_R * lift * np.cos(delta) + push[2]
    inertia = np.array(
        [
            [m + 393e3, 296e3 - m * z_G, m * x_G + 1.4e6],
            [-296e3 - m * z_G, 3.1503e6, 0.0],
            [m * x_G - 538e3, 0.0, 86.634e6],
        ]
    )
    dv, dp, dr = np.linalg.solve(inertia, np.array([Y, K, N]))
    return X / (m + 17.4e3), dv, dr, dp, p


def _ordinary(L: float) -> MMGActuators:
    k = (L / 130.0) ** 0.5
    return MMGActuators(
        T_n=6.0 * k,
        rate_n=0.05,
        T_delta=1.5 * k,
        rate_delta=np.deg2rad(3.0) / k,
        T_F=3.0 * k,
        rate_F=1.0,
        delta_max=np.deg2rad(35.0),
    )


PUBLISHED = {
    "mariner": Published(
        "mariner",
        Ship(name="Mariner", L=160.93, B=23.17, T=8.23, displacement=16_630.0, propeller=Propeller(diameter=6.7),
            rudder=Rudder(area=30.0),
             wind=Wind(frontal_area=450.0, lateral_area=1800.0)),
        _ordinary(160.93), _SERVICE, (0.8, 1.1), _mariner, rpm=73.0,
    ),
    "tanker": Published(
        "tanker",
        Ship(name="Tanker", L=304.8, B=47.17, T=18.46, displacement=220_000.0, propeller=Propeller(diameter=9.1),
            rudder=Rudder(area=117.0),
             wind=Wind(frontal_area=1100.0, lateral_area=3200.0)),
        _ordinary(304.8), 5.5, (0.45, 1.25), _tanker,
    ),
    "s175": Published(
        "s175",
        Ship(name="S175", L=175.0, B=25.4, T=8.5, displacement=21222.0,
             propeller=Propeller(diameter=6.533, x=-86.0, kt=(0.527, -0.455, 0.0), wake=0.184, thrust_deduction=0.175),
             rudder=Rudder(area=33.04, height=7.76, x=-87.5), wind=Wind(frontal_area=600.0, lateral_area=2500.0)),
        _ordinary(175.0), 7.0, (0.45, 1.25), _s175, more=2,
    ),
    "navy": Published(
        "navy",
        Ship(name="Navy ship", L=51.5, B=8.6, T=2.3, displacement=357.0, rho=1014.0, xG=-3.38,
            propeller=Propeller(diameter=1.9),
             rudder=Rudder(area=3.0, height=1.5, x=-23.79), wind=Wind(frontal_area=50.0, lateral_area=220.0)),
        replace(_ordinary(51.5), rate_n=0.5), 8.0, (0.6, 1.1), _navy, more=2,
    ),
}  # fmt: skip
"""Ships by name; displacement as in the equations.

Diameter and rudder area of mariner and tanker, and areas above water, are round figures for ships of their kind; the
diameter of the navy ship is that of one propeller with the thrust of both.
"""


def rpm_at(ship: Published, speed: float) -> float:
    """Shaft speed [rpm] that holds `speed` [m/s] straight ahead."""
    if ship.rpm is not None:
        return ship.rpm
    none = np.zeros(1)

    def surge(rpm: float) -> float:
        return float(
            ship.rates(
                (np.array([speed]), *(none for _ in range(2 + ship.more))),
                np.array([rpm]),
                none,
                1.0,
                (none, none, none),
            )[0][0]
        )

    return float(brentq(surge, 1.0, 1000.0))


def wind_force(ship: Published, u_rw: np.ndarray, v_rw: np.ndarray) -> Push:
    """Wind force and moment [N, N, N m] from the velocity through the air [m/s]: C_X = -0.6 cos, C_Y = 0.85 sin, C_N =
    0.07 sin 2 gamma, within the range that Blendermann (1994) measured on ships of many kinds. Neither the simulator
    nor the fit has these coefficients."""
    areas, q = ship.particulars.wind, 0.5 * RHO_AIR * np.hypot(u_rw, v_rw)
    assert areas is not None
    side = q * areas.lateral_area
    return (
        -0.6 * q * areas.frontal_area * u_rw,
        -0.85 * side * v_rw,
        -0.14 * side * ship.L * u_rw * v_rw / (np.hypot(u_rw, v_rw) + 1e-9),
    )


def _modified(hidden: Sequence[Hidden], flow: Flow, ship: Published) -> Modifiers:
    """Changes of the equations by the hidden effects.

    Raises:
        InputError: an effect acts on a part that only MMG ships have.
    """
    e, particulars, neutral = Modifiers(), complete(ship.particulars), Modifiers()
    for item in hidden:
        item.effect.force(e, flow, item.q, particulars)
        for f in fields(e):
            value, before = getattr(e, f.name), getattr(neutral, f.name)
            if (
                f.name not in _UNDERSTOOD
                and value is not before
                and not (isinstance(before, float) and is_neutral(value, before))
            ):
                raise InputError(
                    f"effect '{item.effect.name}' changes '{f.name}', which published ships do not have; accepted: "
                    "effects that act through "
                    f"{', '.join(_UNDERSTOOD)}, actuators or sensors."
                )
    return e


def published_trials(
    ship: Published, seed: int, hidden: Sequence[Hidden] = (), plan: Trials | None = None, name: str = "trials"
) -> Dataset:
    """Trials of a published ship with `hidden` causes: commands, sensors and gusts as in `sea_trials`, ahead and
    without thrusters.

    Raises:
        InputError: see `_modified`.
    """
    plan = replace(plan or Trials(), astern=False, thrusters=False)
    rng = np.random.default_rng(seed)
    sailing = draw_sailing(rng, ship, plan, rpm_at(ship, ship.cruise), ship.cruise, ship.ratios)
    if ship.rpm is not None:
        sailing.s0[:, 6] = sailing.U[..., 0] = ship.rpm
    steps, forces = sailing.U.shape[1], flow_first(hidden)
    mean = (plan.wind[0] * sailing.scale, plan.wind[1] * sailing.scale)
    wind = gusts(rng, plan.runs, steps, sailing.dt, plan.gusts * sailing.scale, 20.0 * sailing.scale, mean)
    path = actuator_paths(ship, sailing.s0, sailing.U, sailing.dt, _SUBSTEPS, hidden)
    x: Motion = (*sailing.s0[:, :6].T, *np.zeros((ship.more, plan.runs)))
    S = np.empty((plan.runs, steps + 1, 10))
    S[..., 6:] = path[:, :: 2 * _SUBSTEPS]
    S[:, 0, :6] = sailing.s0[:, :6]
    for j in range(steps * _SUBSTEPS):

        def rhs(x: Motion, stage: int, j: int = j) -> Motion:
            return _rates(
                ship,
                forces,
                x,
                path[:, 2 * j + stage],
                wind[:, j // _SUBSTEPS],
                (j + 0.5 * stage) * sailing.dt / _SUBSTEPS,
            )

        x = rk4_step(rhs, x, sailing.dt / _SUBSTEPS)
        if (j + 1) % _SUBSTEPS == 0:
            level = np.cos(x[7]) if ship.more else 1.0
            S[:, (j + 1) // _SUBSTEPS, :6] = np.stack([*x[:4], x[4] * level, x[5] * level], axis=-1)
    return write_down(
        ship, sailing, S, hidden, plan, rng, name, f"shipbench trials of the published ship {ship.name}, seed {seed}"
    )


def _rates(
    ship: Published, hidden: Sequence[Hidden], x: Motion, actuators: np.ndarray, wind: np.ndarray, t: float
) -> Motion:
    """Rates of x, y, psi, u, v, r over ground and of the further states. u, v, r are those of the ship's own plane,
    which heels."""
    px, py, psi, u, v, r, *more = x
    flow = Flow(px, py, t, psi, u, v, r, *actuators.T)
    e = _modified(hidden, flow, ship)
    u_rw, v_rw = apparent_wind(psi, u, v, wind[:, 0], wind[:, 1])
    push = tuple(a + b for a, b in zip(wind_force(ship, u_rw - e.air_u, v_rw - e.air_v), (e.X, e.Y, e.N), strict=True))
    du, dv, dr, *rest = ship.rates((u - e.u_c, v - e.v_c, r, *more), flow.n, flow.delta + e.delta, e.thrust, push)
    level = np.cos(more[1]) if more else 1.0
    cos, sin, across, turn = np.cos(psi), np.sin(psi), v * level, r * level
    return u * cos - across * sin, u * sin + across * cos, turn, du + turn * e.v_c, dv - turn * e.u_c, dr, *rest
