"""Physical constants and times of day, as the import uses them."""

from __future__ import annotations

WGS84_AXIS, WGS84_FLATTENING = 6378137.0, 1.0 / 298.257223563
"""Semi-major axis [m] and flattening of the ellipsoid (EPSG 7030)."""
EARTH_RADIUS = 6_371_000.0
"""Mean radius of the earth as a sphere [m]."""
GRAVITY = 9.81
"""Acceleration of gravity [m/s^2]."""
DAY = 86_400.0
"""Seconds of a day."""
SIGMA = 1.4826
"""Standard deviation of a normal distribution over its median absolute deviation."""
