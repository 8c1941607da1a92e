"""Pictures of what a data set covers: where in speed, drift, rudder, revolutions, heading, thrust and wind its time was spent."""

from __future__ import annotations

import io
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from ..data.coverage import Samples
from ..records import Dataset
from ..signals import DELTA, F_B, F_S, PSI, N, R

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_BINS = 40
_SECTORS = 24


@dataclass(frozen=True)
class Picture:
    """A PNG with its file's name, title and caption."""

    name: str
    title: str
    caption: str
    png: bytes


def pictures(dataset: Dataset) -> list[Picture]:
    """Speed against drift, rudder against revolutions, headings, yaw rate against speed; thrusters and wind where there are any."""
    s = Samples(dataset)
    S, dt = s.states, dataset.dt
    speed, drift, delta = np.copysign(s.speed, s.froude), np.rad2deg(s.drift), np.rad2deg(S[:, DELTA])
    moving = np.isfinite(drift)
    found = [
        _draw("speed_drift", "Speed and drift angle", f"Without the {100 * np.mean(~moving):.1f} % of the time that the ship lies still.",
              _time_in(speed[moving], drift[moving], dt, "speed [m/s], astern negative", "drift angle [deg], to starboard positive")),
        _draw("rudder_rpm", "Rudder and revolutions", "Positions where they are measured, else commands.",
              _time_in(S[:, N], delta, dt, "revolutions [rpm]", "rudder angle [deg], to starboard positive")),
        _draw("headings", "Headings", f"95 % of them lie within {np.rad2deg(s.heading_arc()):.0f} deg.", _rose(S[:, PSI], dt), polar=True),
        _draw("yaw_speed", "Yaw rate and speed", "", _time_in(speed, np.rad2deg(S[:, R]), dt, "speed [m/s], astern negative", "yaw rate [deg/s]")),
    ]  # fmt: skip
    if S[:, F_B:].any():
        used = (S[:, F_B] != 0.0) | (S[:, F_S] != 0.0)
        found.append(_draw("thrusters", "Thrusters", f"The {100 * np.mean(used):.1f} % of the time that one of them pushes.",
                           _time_in(1e-3 * S[used, F_B], 1e-3 * S[used, F_S], dt, "bow thruster [kN]", "stern thruster [kN]")))  # fmt: skip
    wind, wind_from = s.environment("wind_speed"), s.environment("wind_from")
    if wind is not None and wind_from is not None:
        bow = np.rad2deg((wind_from - S[:, PSI] + np.pi) % (2 * np.pi) - np.pi)
        found.append(_draw("wind", "True wind", "Where it comes from, seen from the bow.",
                           _time_in(bow, wind, dt, "from [deg], over starboard positive", "wind speed [m/s]")))  # fmt: skip
    return found


def _time_in(x: np.ndarray, y: np.ndarray, dt: float, label_x: str, label_y: str) -> Callable[[Axes], None]:
    """Seconds spent in every cell, in steps of ten."""

    def draw(ax: Axes) -> None:
        from matplotlib.colors import LogNorm

        if len(x):
            counts, edges_x, edges_y = np.histogram2d(x, y, bins=_BINS, range=[_span(x), _span(y)])
            shown = np.ma.masked_equal(dt * counts.T, 0.0)
            mesh = ax.pcolormesh(edges_x, edges_y, shown, norm=LogNorm(dt, max(float(shown.max()), 10.0 * dt)), cmap="viridis_r", rasterized=True)
            figure: Any = ax.figure
            figure.colorbar(mesh, ax=ax, label="seconds")
        ax.axhline(0.0, color="0.7", lw=0.6, zorder=0)
        ax.axvline(0.0, color="0.7", lw=0.6, zorder=0)
        ax.set_xlabel(label_x)
        ax.set_ylabel(label_y)

    return draw


def _span(x: np.ndarray) -> tuple[float, float]:
    """From least to greatest value, and never empty."""
    low, high = float(x.min()), float(x.max())
    return (low, high) if high - low > 1e-9 * max(abs(low), abs(high), 1.0) else (low - 0.5, high + 0.5)


def _rose(psi: np.ndarray, dt: float) -> Callable[[Any], None]:
    """Time per sector of heading, north up and clockwise."""

    def draw(ax: Any) -> None:
        counts, edges = np.histogram(psi % (2 * np.pi), bins=_SECTORS, range=(0.0, 2 * np.pi))
        ax.set_theta_zero_location("N")
        ax.set_theta_direction(-1)
        ax.bar(edges[:-1], dt * counts, width=2 * np.pi / _SECTORS, align="edge", color="#0072B2", alpha=0.8)
        ax.set_xticks(np.deg2rad([0, 90, 180, 270]), ["north", "east", "south", "west"])
        most = dt * float(counts.max())
        ax.set_yticks([0.5 * most, most], [f"{0.5 * most / 60.0:.2g} min", f"{most / 60.0:.2g} min"], fontsize=8)

    return draw


def _draw(name: str, title: str, caption: str, draw: Callable[[Any], None], polar: bool = False) -> Picture:
    """Without a display and without global state."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(4.6, 3.5), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot(projection="polar" if polar else None)
    draw(axes)
    axes.set_title(title, fontsize=11)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return Picture(name, title, caption, buffer.getvalue())
