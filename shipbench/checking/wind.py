"""Check for a wind direction that is recorded as where the wind blows to: it would push the ship against the wind.

Changes of surge and sway over 8 s (at 130 m, Froude-scaled) are regressed on state, actuators and the wind's force
along and across the ship, once with the wind coming from the recorded direction and once going to it. The direction
whose force pushes to leeward is accepted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..physics.wind import apparent_wind
from ..signals import DELTA, F_B, F_S, PSI, N, R, U, V
from .finding import Curve, Finding, Picture, toml_line
from .recording import Recording
from .statistics import Fit, clustered_fit, clusters
from .thresholds import THRESHOLDS


def _rows(recording: Recording, turn: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Rows of the regressions: run (W,), change of (u, v) (W, 2), other columns of u's and of v's equation, wind's
    (along, across) (W, 2), with the direction turned."""
    ahead = max(1, round(THRESHOLDS.value("response_time") * recording.froude / recording.dt))
    speed, direction = (recording.dataset.inputs.index(name) for name in ("wind_speed", "wind_from"))
    edge = max(1, round(THRESHOLDS.value("averaging_time") * recording.froude / recording.dt))
    owner, changes, surge, sway, wind = [], [], [], [], []
    for i, run in enumerate(recording.runs):
        S, W = run.states, run.inputs
        a, b = apparent_wind(S[:, PSI], S[:, U], S[:, V], W[:, speed], W[:, direction] + turn)
        force = -np.hypot(a, b)[:, None] * np.column_stack([a, b])
        for k in range(0, len(run) - ahead - edge + 1, ahead):
            before, after, part = (
                S[k : k + edge].mean(axis=0),
                S[k + ahead : k + ahead + edge].mean(axis=0),
                S[k : k + ahead + edge],
            )
            u, v, r, n, delta, bow, stern = part.mean(axis=0)[[U, V, R, N, DELTA, F_B, F_S]]
            race, flow = (
                np.mean(part[:, DELTA] * part[:, N] * np.abs(part[:, N])),
                np.mean(part[:, DELTA] * part[:, U] * np.abs(part[:, U])),
            )
            owner.append(i)
            changes.append(after[[U, V]] - before[[U, V]])
            surge.append(
                [1.0, u, u * abs(u), n * abs(n), u * abs(n), np.mean(part[:, V] * part[:, R]), r**2, delta**2 * u**2]
            )
            sway.append([1.0, v, v * abs(u), r * u, r, v * abs(v), flow, race, bow, stern])
            wind.append(force[k : k + ahead + edge].mean(axis=0))
    return np.array(owner), np.array(changes), np.array(surge), np.array(sway), np.array(wind)


def _fits(recording: Recording, turn: float) -> tuple[list[Fit], np.ndarray, np.ndarray]:
    """Fits of surge and sway, whose last coefficient is the wind's; the wind's force and the changes (W, 2)."""
    owner, changes, surge, sway, wind = _rows(recording, turn)
    cluster = clusters(owner)
    fits = []
    for i, others in enumerate((surge, sway)):
        X = np.column_stack([others, wind[:, i]])
        size = np.sqrt(np.mean(X**2, axis=0)) + 1e-300
        fits.append(clustered_fit(changes[:, i], X / size, cluster))
    return fits, wind, changes


@dataclass(frozen=True)
class _Turned:
    """Values t of the wind's push on surge and sway, as recorded and turned; push and change across the ship (W,)."""

    t_from: np.ndarray
    t_to: np.ndarray
    push: np.ndarray
    change: np.ndarray


def blows_to(recording: Recording) -> _Turned | None:
    """Evidence that wind_from is where the wind blows to; None if it is not, without wind channels or where the wind
    has too little effect."""
    if not {"wind_speed", "wind_from"} <= set(recording.dataset.inputs):
        return None
    if len(_rows(recording, 0.0)[0]) < THRESHOLDS.count("regression_windows"):
        return None
    (as_from, wind, changes), (as_to, _, _) = _fits(recording, 0.0), _fits(recording, np.pi)
    t_from, t_to = (np.array([f.value[-1] / f.sd[-1] for f in fits]) for fits in (as_from, as_to))
    clear = int(np.argmax(np.abs(t_from)))
    error = THRESHOLDS.value("within_error")
    unsure = t_to[clear] < 0.0 or as_to[clear].p[-1] > THRESHOLDS.value("chance")
    suits = t_from[clear] > -error or t_to[1 - clear] < -error
    if unsure or suits:
        return None
    return _Turned(t_from, t_to, wind[:, 1], changes[:, 1])


def check(recording: Recording) -> list[Finding]:
    """Find a reversed wind direction; one finding at most."""
    found = blows_to(recording)
    if found is None:
        return []
    t_from, t_to = found.t_from, found.t_to
    sign = "clockwise" if recording.given.get("signs", {}).get("wind_from") == "to" else "to"
    text = (
        "wind_from is where the wind blows to: read as it stands it pushes the ship to windward (t = "
        f"{t_from[0]:.1f} along, {t_from[1]:.1f} across);"
        f" turned by 180 deg it pushes to leeward (t = {t_to[0]:.1f}, {t_to[1]:.1f})."
    )
    picture = Picture(
        "Change of sway against the wind's push as recorded", "push across the ship, speed squared [m^2/s^2]",
        "change of v [m/s]",
        (Curve("windows", found.push, found.change, "."),),
    )  # fmt: skip
    return [Finding(
        "wind", "error", "wind to", text, toml_line({"signs": {"wind_from": sign}}), channels=("wind_from",),
        evidence={"t_from_along": t_from[0], "t_from_across": t_from[1], "t_to_along": t_to[0], "t_to_across": t_to[1]},
        picture=picture,
    )]  # fmt: skip


CHECK = check
