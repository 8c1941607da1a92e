"""Tunnel thrusters: side force and moment, with the loss at forward speed."""

from __future__ import annotations

from dataclasses import dataclass

from ..ops import Array, absolute, exp


@dataclass(frozen=True)
class Tunnels:
    """Positions [m from midship] and the greatest losses of side force and moment at forward speed."""

    x_bow: float
    x_stern: float
    loss_force: float = 0.0
    loss_moment: float = 0.0
    speed_of_loss: float = 2.1


def tunnel_thrusters(
    u: Array, F_b: Array, F_s: Array, c: Tunnels, loss: Array = 0.0, lever: Array = 0.0
) -> tuple[Array, Array]:
    """Side force [N] and moment [N m] about midship of thruster forces F_b, F_s [N, pushing the hull to starboard].

    Y = k_Y (F_b + F_s), N = k_N (x_bow F_b + x_stern F_s), k = 1 - loss q exp(1 - q), q = (u/u_loss)^2. The jet's
    suction on the hull takes more of the
    moment than of the force; the loss is worst near 4 kn (2.1 m/s) and gone at 15 kn.

    Source: shape after the 60 000 DWT tanker tests of Int. Shipbuild. Progress 1967 (doi 10.3233/ISP-1967-1415601):
    moment down to 50 % at 4 kn.
    Limits: no loss at rest.
    """
    q = (u / c.speed_of_loss) ** 2
    bump = q * exp(1.0 - q)
    return (
        (1.0 - (c.loss_force + 0.6 * loss) * bump) * (F_b + F_s),
        (1.0 - (c.loss_moment + loss) * bump) * ((c.x_bow + lever) * F_b + c.x_stern * F_s),
    )


def fading(u: Array, L: float) -> Array:
    """Share of its force that a thruster may lose for good as the ship gathers way: 1 - exp(-|u| / (0.1 sqrt(g L))).

    Source: public simulators, k = exp(-|u| / u_0) or 1 + a Fn with a < 0, without a return at speed;
    docs/theory.md#thrusters.
    Limits: none at rest.
    """
    return 1.0 - exp(-absolute(u) / (0.1 * (9.81 * L) ** 0.5))
