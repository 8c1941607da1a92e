"""Coverage of a data set: time spent at each speed, drift, rudder angle, shaft speed, heading, thrust and wind; as PNG
for Markdown."""

from __future__ import annotations

import io
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...data.coverage import Samples
from ...records import Dataset
from ...signals import DELTA, F_B, F_S, PSI, N, R

_BINS = 40
_SECTORS = 24


@dataclass(frozen=True, eq=False)
class Coverage:
    """Histogram of time with its file's name, title and caption.

    `seconds` (nx, ny) in the cells between the edges `x` (nx + 1,) and `y` (ny + 1,) with their labels; of headings
    (nx,) in sectors, `x` in rad.
    """

    name: str
    title: str
    caption: str
    seconds: np.ndarray
    x: np.ndarray
    y: np.ndarray
    xlabel: str = ""
    ylabel: str = ""


def coverage(dataset: Dataset) -> list[Coverage]:
    """Histograms of speed against drift, rudder against shaft speed, headings, yaw rate against speed; thrusters and
    wind where there are any."""
    s = Samples(dataset)
    S, dt = s.states, dataset.dt
    speed, drift, delta = np.copysign(s.speed, s.froude), np.rad2deg(s.drift), np.rad2deg(S[:, DELTA])
    moving = np.isfinite(drift)
    headings, sectors = np.histogram(S[:, PSI] % (2 * np.pi), bins=_SECTORS, range=(0.0, 2 * np.pi))
    found = [
        Coverage("speed_drift", "Speed and drift angle",
            f"Without the {100 * np.mean(~moving):.1f} % of the time "
            "that the ship lies still.",
                 *_time_in(speed[moving], drift[moving], dt), "speed [m/s], astern negative",
                 "drift angle [deg], to starboard positive"),
        Coverage("rudder_rpm", "Rudder and shaft speed", "Positions where they are measured, else commands.",
                 *_time_in(S[:, N], delta, dt), "shaft speed [rpm]", "rudder angle [deg], to starboard positive"),
        Coverage("headings", "Headings", f"95 % of them lie within {np.rad2deg(s.heading_arc()):.0f} deg.",
            dt * headings, sectors, np.zeros(0)),
        Coverage("yaw_speed", "Yaw rate and speed", "", *_time_in(speed, np.rad2deg(S[:, R]), dt),
                 "speed [m/s], astern negative", "yaw rate [deg/s]"),
    ]  # fmt: skip
    if S[:, F_B:].any():
        used = (S[:, F_B] != 0.0) | (S[:, F_S] != 0.0)
        found.append(Coverage("thrusters", "Thrusters",
                f"The {100 * np.mean(used):.1f} % of the time that one of "
                "them pushes.",
                              *_time_in(1e-3 * S[used, F_B], 1e-3 * S[used, F_S], dt), "bow thruster [kN]",
                              "stern thruster [kN]"))  # fmt: skip
    wind, wind_from = s.environment("wind_speed"), s.environment("wind_from")
    if wind is not None and wind_from is not None:
        bow = np.rad2deg((wind_from - S[:, PSI] + np.pi) % (2 * np.pi) - np.pi)
        found.append(Coverage("wind", "True wind", "Where it comes from, seen from the bow.",
                              *_time_in(bow, wind, dt), "from [deg], over starboard positive",
                              "wind speed [m/s]"))  # fmt: skip
    return found


def _time_in(x: np.ndarray, y: np.ndarray, dt: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time spent in every cell [s], and the edges of the cells."""
    counts, edges_x, edges_y = np.histogram2d(x, y, bins=_BINS, range=[_span(x), _span(y)])
    return dt * counts, edges_x, edges_y


def _span(x: np.ndarray) -> tuple[float, float]:
    """Range from least to greatest value, never empty."""
    low, high = (float(x.min()), float(x.max())) if len(x) else (0.0, 0.0)
    return (low, high) if high - low > 1e-9 * max(abs(low), abs(high), 1.0) else (low - 0.5, high + 0.5)


def png(covered: Coverage, dt: float) -> bytes:
    """Picture drawn without a display and without global state; `dt` [s] is the least time of the scale."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    polar = covered.seconds.ndim == 1
    figure = Figure(figsize=(4.6, 3.5), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes: Any = figure.add_subplot(projection="polar" if polar else None)
    if polar:
        _rose(axes, covered)
    else:
        _cells(axes, covered, dt)
    axes.set_title(covered.title, fontsize=11)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _cells(axes: Any, covered: Coverage, dt: float) -> None:
    """Draw the time in every cell, in a logarithmic scale of colours."""
    from matplotlib.colors import LogNorm

    if covered.seconds.any():
        shown = np.ma.masked_equal(covered.seconds.T, 0.0)
        norm = LogNorm(dt, max(float(shown.max()), 10.0 * dt))
        mesh = axes.pcolormesh(covered.x, covered.y, shown, norm=norm, cmap="viridis_r", rasterized=True)
        axes.figure.colorbar(mesh, ax=axes, label="seconds")
    axes.axhline(0.0, color="0.7", lw=0.6, zorder=0)
    axes.axvline(0.0, color="0.7", lw=0.6, zorder=0)
    axes.set_xlabel(covered.xlabel)
    axes.set_ylabel(covered.ylabel)


def _rose(axes: Any, covered: Coverage) -> None:
    """Draw the time in every sector of heading, north up and clockwise."""
    axes.set_theta_zero_location("N")
    axes.set_theta_direction(-1)
    axes.bar(
        covered.x[:-1],
        covered.seconds,
        width=2 * np.pi / len(covered.seconds),
        align="edge",
        color="#0072B2",
        alpha=0.8,
    )
    axes.set_xticks(np.deg2rad([0, 90, 180, 270]), ["north", "east", "south", "west"])
    most = float(covered.seconds.max())
    axes.set_yticks([0.5 * most, most], [f"{0.5 * most / 60.0:.2g} min", f"{most / 60.0:.2g} min"], fontsize=8)
