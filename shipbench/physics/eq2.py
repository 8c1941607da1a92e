"""Fitted model: equations (2) to (8) of the source paper, in the reading of docs/theory.md#equations-of-motion.

The left side (masses, hull derivatives) comes from published regressions on the main dimensions; the right side holds
p0..p10. Its structure (quadratic hull, lift and drag polynomials of the rudder) differs from the MMG simulator's on
purpose.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from ..ops import Array, absolute, arctan2, clip, cos, maximum, sin, smoothstep, sqrt
from ..ship import Particulars
from . import propeller, regressions, thruster, wind
from .modifiers import Modifiers, is_neutral

NUM_PARAMETERS = 11
ALPHA_MAX = 1.2
"""Angle of attack [rad] beyond which the lift and drag polynomials are held constant: cubic polynomials are not valid
there."""


@dataclass(frozen=True)
class Coefficients:
    """Dimensional left side and geometry (SI), from `coefficients`.

    X_vr and X_rr are the whole factors of v r and r^2 in surge: mass and added mass are in them.
    """

    m: float
    x_G: float
    m_x: float
    m11: float
    m12_Y: float
    m12_N: float
    m22: float
    m_y: float
    I_zz: float
    J_z: float
    Y_v: float
    Y_r: float
    N_v: float
    N_r: float
    X_vr: float
    X_rr: float
    Y_vv: float
    Y_vr: float
    Y_rr: float
    N_rr: float
    N_vvr: float
    N_vrr: float
    max_drift: float
    eps: float
    rho: float
    L: float
    T: float
    D_P: float
    x_P: float
    w_P0: float
    t_P: float
    kt: tuple[float, float, float]
    A_R: float
    eta: float
    x_R: float
    a_H: float
    x_H: float
    tunnels: thruster.Tunnels
    A_F: float
    A_L: float


def coefficients(ship: Particulars) -> Coefficients:
    """Left side of eq. (2) for a ship.

    Source: Inoue et al. (1981) for the derivatives, whose structure eq. (2) is; Clarke et al. (1983) for the added
    masses in sway and yaw, Soeding (1982) for
    surge, X_vr = -0.28 m_y as KCS has it (docs/theory.md#equations-of-motion), a_H and x_H of Yoshimura & Masumoto
    (2012).
    """
    L, B, T, rho = ship.L, ship.B, ship.T, ship.rho
    form = (L, B, T, ship.Cb)
    mass, lin, non = regressions.clarke_1983(*form), regressions.inoue_linear(*form), regressions.inoue_nonlinear(*form)
    q2, qd = 0.5 * rho * L**2, 0.5 * rho * L * T
    m_x = regressions.surge_added_mass(ship.mass / rho, L, rho)
    m_y = -mass.Y_vd * q2 * L
    Y_rd, N_vd, N_rd = mass.Y_rd * q2 * L**2, mass.N_vd * q2 * L**2, mass.N_rd * q2 * L**3
    a_H, x_H = regressions.hull_rudder_interaction(L, B, ship.Cb)
    X_vr = -0.28 * m_y
    return Coefficients(
        m=ship.mass, x_G=ship.xG, m_x=m_x,
        m11=ship.mass + m_y, m12_Y=ship.mass * ship.xG - Y_rd, m12_N=ship.mass * ship.xG - N_vd,
        m22=ship.Izz + ship.mass * ship.xG**2 - N_rd, m_y=m_y, I_zz=ship.Izz, J_z=-N_rd,
        Y_v=lin.Y_v * qd, Y_r=lin.Y_r * qd * L, N_v=lin.N_v * qd * L, N_r=lin.N_r * qd * L**2,
        X_vr=m_y + X_vr + ship.mass, X_rr=ship.mass * ship.xG - Y_rd,
        Y_vv=non.Y_vv * qd, Y_vr=non.Y_vr * qd * L, Y_rr=non.Y_rr * qd * L**2,
        N_rr=non.N_rr * qd * L**3, N_vvr=non.N_vvr * qd * L**2, N_vrr=non.N_vrr * qd * L**3,
        max_drift=min(0.5, 0.8 * abs(non.N_rr / non.N_vrr)),
        eps=0.05 * (L / 100.0) ** 0.5, rho=rho, L=L, T=T, D_P=ship.D_P, x_P=ship.x_P, w_P0=ship.w_P0, t_P=ship.t_P,
        kt=ship.kt,
        A_R=ship.A_R, eta=min(ship.D_P / ship.H_R, 1.0), x_R=ship.x_R, a_H=a_H, x_H=x_H * L,
        tunnels=thruster.Tunnels(ship.x_bow, ship.x_stern), A_F=ship.A_F, A_L=ship.A_L,
    )  # fmt: skip


def propulsion(u: Array, n: Array, c: Coefficients, e: Modifiers | None = None) -> tuple[Array, Array, Array]:
    """Thrust and flow (X_n, V_A, race): thrust on the ship (1 - t) T [N], axial speed at the propeller and of its race
    [m/s]; n in rpm."""
    e = e or Modifiers()
    V_A = u - (c.w_P0 + e.wake) * maximum(u, 0.0)  # no wake going astern: the propeller then leads
    thrust = propeller.thrust_quadratic(n / 60.0, V_A, c.D_P, c.kt, c.rho) * e.thrust
    if is_neutral(e.reversal, 0.0):
        race = propeller.race_speed(V_A, maximum(thrust, 0.0), c.D_P, c.rho)
    else:  # the drag of a propeller that goes astern, but does not drive, is no race
        race = propeller.race_through(V_A, maximum(thrust, 0.0) * smoothstep(n, 0.0, 1.0), c.D_P, c.rho)
    X_n = (1.0 - c.t_P) * (thrust + e.off_design * e.thrust)
    return X_n, V_A, race if is_neutral(e.race, 1.0) else V_A + e.race * (race - V_A)


def rudder(
    v: Array,
    r: Array,
    delta: Array,
    V_A: Array,
    race: Array,
    c: Coefficients,
    p: Sequence[Array],
    e: Modifiers | None = None,
) -> tuple[Array, Array, Array]:
    """Rudder force (X, Y, N) from lift and drag, c_L = p4 + p5 a + p6 a^2 + p7 a^3, c_D = p8 + p9 a + p10 a^2 (eq. 7,
    8).

    Inflow: the share eta = D_P/H_R of the blade stands in the race, the rest in the wake; sideways 0.364 v + 0.66 x_R r
    (Kose/Brix flow straightening). Angle of attack a = delta + atan2(w_R, u_R). Lift acts across the inflow, to port
    for a > 0; drag along it.
    """
    e = e or Modifiers()
    u2, angle = c.eta * race * race + (1.0 - c.eta) * V_A * V_A, delta + e.delta
    if not is_neutral(e.reversal, 0.0):
        through = c.eta * race * absolute(race) + (1.0 - c.eta) * V_A * absolute(V_A)
        u2 = sqrt(through * through + 1e-8)
        angle = angle * (1.0 - 2.0 * e.reversal * smoothstep(-through, 0.0, 4e-4 * 9.81 * c.L))
    u_R = sqrt(u2 + 1e-6)
    w_R = e.sideways(0.364 * v + 0.66 * c.x_R * r * e.straightening_r)
    beta = arctan2(w_R, u_R)
    a = clip(angle + beta, -ALPHA_MAX, ALPHA_MAX)
    q = 0.5 * c.rho * c.A_R * (u2 + w_R * w_R)
    lift = q * (p[4] + a * (p[5] + a * (p[6] + a * p[7]))) * e.lift_factor(a)
    drag = q * (p[8] + a * (p[9] + a * p[10]))
    cb, sb = cos(beta), sin(beta)
    side = -(lift * cb + drag * sb)
    return lift * sb - drag * cb, (1.0 + c.a_H) * side, (c.x_R + c.a_H * c.x_H) * side


class _Inertia(NamedTuple):
    m: Array
    x_G: Array
    surge: Array
    m11: Array
    m12_Y: Array
    m12_N: Array
    m22: Array
    X_vr: Array
    X_rr: Array


def _inertia(c: Coefficients, e: Modifiers) -> _Inertia:
    """Masses of the left side, as changed by effects."""
    if (
        all(is_neutral(field, 1.0) for field in (e.mass, e.m_x, e.m_y, e.J_z))
        and is_neutral(e.x_G, 0.0)
        and is_neutral(e.coupling, 0.0)
    ):
        return _Inertia(c.m, c.x_G, c.m + c.m_x, c.m11, c.m12_Y, c.m12_N, c.m22, c.X_vr, c.X_rr)
    m, x_G = c.m * e.mass, c.x_G + e.x_G
    moved = m * x_G - c.m * c.x_G + e.coupling
    added = c.m_y * (e.m_y - 1.0)
    m22 = c.I_zz * e.mass + m * x_G * x_G + c.J_z * e.J_z
    X_vr = c.X_vr + 0.72 * added + (m - c.m)
    return _Inertia(
        m, x_G, m + c.m_x * e.m_x, m + c.m_y * e.m_y, c.m12_Y + moved, c.m12_N + moved, m22, X_vr, c.X_rr + moved
    )


def accelerations(
    u: Array,
    v: Array,
    r: Array,
    n: Array,
    delta: Array,
    F_b: Array,
    F_s: Array,
    air: tuple[Array, Array] | None,
    c: Coefficients,
    p: Sequence[Array],
    mods: Modifiers | None = None,
) -> tuple[Array, Array, Array]:
    """Accelerations (du, dv, dr) of eq. (2) [m/s^2, m/s^2, rad/s^2].

    n in rpm, delta in rad, F_b and F_s in N; `air` is the ship's velocity relative to the air in body axes
    (`wind.apparent_wind`) or None without wind; p holds p0..p10: p0 lateral over axial propeller force [1], p1..p3
    resistance [N s/m, N s^2/m^2, N s^3/m^3], p4..p10 rudder [1]; `mods` carries effects that the plain model leaves
    out.

    The two cubic yaw terms are divided by U; their v/U is held at 0.5 (30 deg of drift, the end of the charts) or where
    N_vrr v r^2/U would exceed the yaw damping N_rr r|r|: beyond, a ship set sideways by wind at low speed would spin up
    without limit.

    X_e, Y_e, N_e are thrusters and measured wind. R(u) = -(p1 u + p2 u|u| + p3 u^3): it opposes the motion for both
    signs of u.
    """
    e = mods or Modifiers()
    f = e.hull
    if air is not None:
        air = (air[0] - e.air_u, air[1] - e.air_v)
    u_c, v_c = e.water(air, u, v)
    moving = not (is_neutral(u_c, 0.0) and is_neutral(v_c, 0.0))
    if moving:
        u, v = u - u_c, v - v_c
    i = _inertia(c, e)
    speed = sqrt(u * u + v * v + c.eps * c.eps)
    X_n, V_A, race = propulsion(u, n, c, e)
    if not is_neutral(e.backing, 0.0):
        left = 1.0 - e.backing * smoothstep(-n / 60.0 * c.D_P, 0.0, 0.02 * (9.81 * c.L) ** 0.5)
        V_A, race = V_A * left, race * left
    X_d, Y_d, N_d = rudder(v, r, delta, V_A, race, c, p, e)
    Y_T, N_T = thruster.tunnel_thrusters(u, F_b * e.bow, F_s * e.stern, c.tunnels, e.loss, e.lever)
    abs_r = absolute(r)
    X = (
        X_n
        + X_d
        - f.resistance * (u * (p[1] + p[2] * absolute(u) + p[3] * u * u))
        + f.X_nonlinear * i.X_vr * v * r
        + i.X_rr * r * r
        + e.X
    )
    Y_n = p[0] * X_n
    Y = Y_n + Y_d + Y_T + f.Y_v * c.Y_v * speed * v + (f.Y_r * c.Y_r * speed - i.m * u) * r + e.Y
    Y = Y + f.Y_nonlinear * (c.Y_vv * v * absolute(v) + c.Y_vr * v * abs_r + c.Y_rr * r * abs_r)
    N = c.x_P * Y_n + N_d + N_T + f.N_v * c.N_v * speed * v + (f.N_r * c.N_r * speed - i.m * i.x_G * u) * r + e.N
    drift = clip(v / speed, -c.max_drift, c.max_drift)
    N = N + f.N_nonlinear * (c.N_rr * r * abs_r + (c.N_vvr * v + c.N_vrr * r) * drift * r)
    if air is not None:
        X_W, Y_W, N_W = e.wind_on(*wind.harmonic(*air, c.A_F, c.A_L, c.L))
        X, Y, N = X + X_W, Y + Y_W, N + N_W
    det = i.m11 * i.m22 - i.m12_Y * i.m12_N
    du, dv, dr = X / i.surge, (i.m22 * Y - i.m12_Y * N) / det, (i.m11 * N - i.m12_N * Y) / det
    return (du + r * v_c, dv - r * u_c, dr) if moving else (du, dv, dr)
