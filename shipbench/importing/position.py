"""Conversion of instrument readings to the signals of the contract: a local plane, midship instead of the antenna,
velocity in body axes, true wind."""

from __future__ import annotations

import numpy as np

from .constants import WGS84_AXIS, WGS84_FLATTENING

_E2 = WGS84_FLATTENING * (2.0 - WGS84_FLATTENING)
"""Square of the ellipsoid's eccentricity."""
Angle = np.ndarray | float


def to_plane(
    lat: np.ndarray, lon: np.ndarray, origin: tuple[float, float], height: np.ndarray | float = 0.0,
    origin_height: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """North and east [m] in the plane that touches the WGS84 ellipsoid at `origin`.

    Exact geographic/topocentric conversion, IOGP Guidance Note 7-2, section 4.1.2 (EPSG method 9837). Its two formulas
    serve the few kilometres of a run as well as a projection library would: distances are off by less than d^3 / (6
    R^2), 4 mm at 10 km and 0.5 m at 50 km.

    Args:
        lat, lon: geodetic [rad].
        origin: its lat, lon [rad].
        height, origin_height: above the ellipsoid [m].
    """
    x, y, z = (
        a - b
        for a, b in zip(
            _geocentric(lat, lon, height),
            _geocentric(np.float64(origin[0]), np.float64(origin[1]), origin_height),
            strict=True,
        )
    )
    sin_lat, cos_lat, sin_lon, cos_lon = np.sin(origin[0]), np.cos(origin[0]), np.sin(origin[1]), np.cos(origin[1])
    north = -sin_lat * cos_lon * x - sin_lat * sin_lon * y + cos_lat * z
    east = -sin_lon * x + cos_lon * y
    return north, east


def _geocentric(lat: Angle, lon: Angle, height: Angle) -> tuple[Angle, Angle, Angle]:
    normal = WGS84_AXIS / np.sqrt(1.0 - _E2 * np.sin(lat) ** 2)
    across = (normal + height) * np.cos(lat)
    return across * np.cos(lon), across * np.sin(lon), ((1.0 - _E2) * normal + height) * np.sin(lat)


def to_midship(
    x: np.ndarray, y: np.ndarray, psi: np.ndarray, lever: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Position of midship from the position of a point on board at `lever` (forward, starboard) [m]."""
    forward, starboard = lever
    return x - forward * np.cos(psi) + starboard * np.sin(psi), y - forward * np.sin(psi) - starboard * np.cos(psi)


def velocity_at_midship(
    u: np.ndarray, v: np.ndarray, r: np.ndarray, lever: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray]:
    """Surge and sway of midship from those of a point on board at `lever` (forward, starboard) [m]: u_P = u - r y_P,
    v_P = v + r x_P."""
    forward, starboard = lever
    return u + r * starboard, v - r * forward


def to_body(north: np.ndarray, east: np.ndarray, psi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Forward and starboard components of a horizontal vector."""
    return north * np.cos(psi) + east * np.sin(psi), -north * np.sin(psi) + east * np.cos(psi)
