"""Stretch of a log on the uniform grid, in the contract's signals; then cut at standstills and into windows."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np

from ..physics.wind import true_wind
from ..ship import Ship
from ..signals import COMMANDS, ENVIRONMENT, STATES
from .constants import GRAVITY
from .entries import ANGLES
from .mapping import Mapping, Point
from .position import to_body, to_midship, to_plane, velocity_at_midship
from .resample import interval_means, interval_values, sample
from .speeds import Smoothed, derivative
from .stretches import Stretch
from .thresholds import THRESHOLDS

Series = dict[str, tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True)
class Piece:
    """Uniform samples: t (n,) [s], and each standard column (n,); `origin` lat, lon [deg] of the local plane, if
    any."""

    t: np.ndarray
    columns: dict[str, np.ndarray]
    origin: tuple[float, float] | None = None
    derived: dict[str, Smoothed] = field(default_factory=dict)

    def rows(self, begin: int, end: int) -> Piece:
        """Piece of some samples."""
        return Piece(self.t[begin:end], {k: v[begin:end] for k, v in self.columns.items()}, self.origin, self.derived)


def shortest_run(mapping: Mapping) -> float:
    """Length [s] below which a piece is left out: as in the mapping (two samples at least), else a whole window, else
    20 samples."""
    split = mapping.split
    if split.shortest is not None:
        return max(split.shortest, mapping.dt)
    samples = round(split.window / mapping.dt) if split.window else THRESHOLDS.count("default_shortest")
    return samples * mapping.dt


def on_grid(stretch: Stretch, mapping: Mapping, ship: Ship) -> Piece:
    """States and inputs at start + k dt.

    States are low-pass filtered and sampled, or interpolated; commands, wind and depth are means over [t_k, t_k+1), as
    a rollout holds them there. Speeds that the log lacks come from course and speed over ground, or from the smoothed
    track; actuators that it lacks are left to the loader.
    """
    series = {name: (t, np.unwrap(v) if name in ANGLES else v) for name, (t, v) in stretch.series.items()}
    count = math.floor((stretch.end - stretch.start) / mapping.dt + 1e-6) + 1
    grid = stretch.start + mapping.dt * np.arange(count)

    def states(t: np.ndarray, v: np.ndarray) -> np.ndarray:
        return sample(t, v, stretch.start, mapping.dt, count, mapping.antialias)

    derived: dict[str, Smoothed] = {}
    origin = _positions_at_midship(series, mapping)
    columns = {name: states(*series[name]) for name in STATES if name in series}
    froude_time = math.sqrt(ship.L / GRAVITY)
    if "r" not in columns:
        t, psi = series["psi"]
        derived["r"] = derivative(t, psi[:, None], grid, mapping.dt, froude_time)
        columns["r"] = derived["r"].rate[:, 0]
    _velocity_at_midship(series, columns, mapping, states)
    if "u" not in columns or "v" not in columns:
        t, x, y = _together(series["x"], series["y"])
        track = derivative(t, np.column_stack([x, y]), grid, mapping.dt, froude_time)
        for name, value in zip("uv", to_body(track.rate[:, 0], track.rate[:, 1], columns["psi"]), strict=True):
            if name not in columns:
                columns[name], derived[name] = value, track
    for name in COMMANDS:
        if name in series:
            columns[name] = interval_means(*series[name], stretch.start, mapping.dt, count)
    _environment(series, columns, mapping, stretch, count)
    order = ("x", "y", "psi", "u", "v", "r", *STATES[6:], *COMMANDS, *ENVIRONMENT)
    return Piece(grid, {name: columns[name] for name in order if name in columns}, origin, derived)


def _lever(mapping: Mapping, channel: str, kind: str) -> tuple[float, float] | None:
    point: Point | None = next(getattr(s, kind) for s in mapping.sources.values() if channel in s.channels)
    return None if point is None else (point.x, point.y)


def _heading_at(series: Series, t: np.ndarray) -> np.ndarray:
    return np.interp(t, *series["psi"])


def _positions_at_midship(series: Series, mapping: Mapping) -> tuple[float, float] | None:
    """Replace lat and lon by x and y, move them to midship, and return the plane's origin [deg]."""
    origin = None
    if "lat" in series:
        t, lat, lon = _together(series.pop("lat"), series.pop("lon"))
        zero = (
            (lat[0], lon[0])
            if mapping.origin is None
            else (math.radians(mapping.origin.lat), math.radians(mapping.origin.lon))
        )
        origin = (round(math.degrees(zero[0]), 8), round(math.degrees(zero[1]), 8))
        x, y = to_plane(lat, lon, zero)
    else:
        t, x, y = _together(series["x"], series["y"])
    at = "lat" if origin else "x"
    if (lever := _lever(mapping, at, "antenna")) is not None:
        x, y = to_midship(x, y, _heading_at(series, t), lever)
    series["x"], series["y"] = (t, x), (t, y)
    return origin


def _together(
    a: tuple[np.ndarray, np.ndarray], b: tuple[np.ndarray, np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples of two channels of one source at their common times; where they are renewed in different rows, at the
    times of both."""
    t, i, j = np.intersect1d(a[0], b[0], assume_unique=True, return_indices=True)
    if len(t) >= THRESHOLDS.value("renewed_together") * min(len(a[0]), len(b[0])):
        return t, a[1][i], b[1][j]
    t = np.union1d(a[0], b[0])
    t = t[(t >= max(a[0][0], b[0][0])) & (t <= min(a[0][-1], b[0][-1]))]
    return t, np.interp(t, *a), np.interp(t, *b)


def _velocity_at_midship(
    series: Series, columns: dict[str, np.ndarray], mapping: Mapping,
    states: Callable[[np.ndarray, np.ndarray], np.ndarray]
) -> None:  # fmt: skip
    """Velocities u and v at midship, where the log has them: from its own columns, else from speed and course over
    ground."""
    measured = [name for name in "uv" if name in columns]
    if len(measured) == 2 and (lever := _lever(mapping, "u", "speed_sensor")) is not None:
        columns["u"], columns["v"] = velocity_at_midship(columns["u"], columns["v"], columns["r"], lever)
    if len(measured) < 2 and "sog" in series:
        t, sog, cog = _together(series["sog"], series["cog"])
        body = to_body(sog * np.cos(cog), sog * np.sin(cog), _heading_at(series, t))
        u, v = (states(t, component) for component in body)
        if (lever := _lever(mapping, "sog", "antenna")) is not None:
            u, v = velocity_at_midship(u, v, columns["r"], lever)
        for name, value in (("u", u), ("v", v)):
            columns.setdefault(name, value)


def _environment(
    series: Series, columns: dict[str, np.ndarray], mapping: Mapping, stretch: Stretch, count: int
) -> None:
    def inputs(t: np.ndarray, v: np.ndarray) -> np.ndarray:
        return interval_values(t, v, stretch.start, mapping.dt, count)

    wind = None
    if "wind_speed" in series:
        t, speed, come_from = _together(series["wind_speed"], series["wind_from"])
        wind = inputs(t, speed * np.cos(come_from)), inputs(t, speed * np.sin(come_from))
    elif "apparent_wind_speed" in series:
        t, speed, come_from = _together(series["apparent_wind_speed"], series["apparent_wind_from"])
        u, v = (np.interp(t, stretch.start + mapping.dt * np.arange(count), columns[name]) for name in "uv")
        wind = tuple(
            inputs(t, component) for component in true_wind(_heading_at(series, t), u, v, speed, come_from, "apparent")
        )  # type: ignore[assignment]
    if wind is not None:
        columns["wind_speed"] = np.hypot(*wind)
        columns["wind_from"] = np.unwrap(np.arctan2(wind[1], wind[0]))
    if "depth" in series:
        columns["depth"] = inputs(*series["depth"])


def without_standing(piece: Piece, mapping: Mapping) -> Iterator[Piece]:
    """Parts of a piece in which the ship moves: speed below `still_speed` for `still_time` or longer is cut out (mean
    over a quarter of it)."""
    limit, dt = mapping.split.still_speed, mapping.dt
    if limit is None:
        yield piece
        return
    width = max(int(mapping.split.still_time / 4 / dt), 1)
    speed = np.hypot(piece.columns["u"], piece.columns["v"])
    padded = np.pad(speed, (width // 2, width - 1 - width // 2), mode="edge")
    still = np.convolve(padded, np.full(width, 1.0 / width), mode="valid") < limit
    for begin, end in _blocks(still):
        if (end - begin) * dt < mapping.split.still_time:
            still[begin:end] = False
    for begin, end in _blocks(~still):
        yield piece.rows(begin, end)


def _blocks(flags: np.ndarray) -> list[tuple[int, int]]:
    """Intervals [begin, end) of each block of true values."""
    edges = np.flatnonzero(np.diff(np.r_[False, flags, False].astype(np.int8)))
    return list(zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True))


def windows(piece: Piece, mapping: Mapping) -> Iterator[Piece]:
    """Windows of the mapping's length that share no sample, and the rest; or the piece as it is."""
    if mapping.split.window is None:
        yield piece
        return
    samples = round(mapping.split.window / mapping.dt) + 1
    for begin in range(0, len(piece.t), samples):
        yield piece.rows(begin, begin + samples)


def outliers(piece: Piece, ship: Ship) -> dict[str, int]:
    """Samples with a speed above sqrt(g L), a Froude number of 1: by the track, and by u and v."""
    greatest = math.sqrt(GRAVITY * ship.L)
    step = np.hypot(np.diff(piece.columns["x"]), np.diff(piece.columns["y"])) / np.diff(piece.t)
    speed = np.hypot(piece.columns["u"], piece.columns["v"])
    return {
        f"{name} (faster than sqrt(g L) = {greatest:.3g} m/s)": int((v > greatest).sum())
        for name, v in (("x, y", step), ("u, v", speed))
    }
