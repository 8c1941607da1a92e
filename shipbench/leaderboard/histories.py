"""Tracks and time histories of every drawn window, as data of linked plots (`render/linked.py`)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ..metrics.ed import ed
from ..render.linked import Line, Quantity, linked_plots, linked_run
from ..signals import DELTA, F_B, F_S, PSI, STATES, N, R, U, V, X, Y, wrap_angle
from ..storage import Frame
from .plots import outline
from .series import Series, Track

_DEGREES = 180.0 / np.pi
EAST, NORTH = Quantity("east", "east", "m", 1), Quantity("north", "north", "m", 1)
ERROR = Quantity("error", "position error ED", "m", 1)
SIGNALS = (
    (U, 1.0, Quantity("u", "surge speed u", "m/s", 3)),
    (V, 1.0, Quantity("v", "sway speed v", "m/s", 3)),
    (R, _DEGREES, Quantity("r", "yaw rate r", "deg/s", 3)),
    (PSI, _DEGREES, Quantity("psi", "heading psi", "deg", 1)),
    (DELTA, _DEGREES, Quantity("delta", "rudder angle", "deg", 1)),
    (N, 1.0, Quantity("n", "shaft speed", "rpm", 0)),
    (F_B, 1e-3, Quantity("F_b", "bow thruster", "kN", 1)),
    (F_S, 1e-3, Quantity("F_s", "stern thruster", "kN", 1)),
)
"""Index of the state, factor to the displayed unit, column. The decimals are finer than a plot can be read."""
FITTED = (U, V, R, PSI)
"""Signals whose fit in percent is shown for every model."""


def study_plots(series: Series, rows: Frame, models: Sequence[str], L: float, B: float) -> dict[str, Any]:
    """Linked plots of the windows of `series`; a ship without thrusters has none in the histories.

    Args:
        series: result of `gather`.
        rows: rows of the data set, for the errors beside the plots.
        models: model i of this list has colour and switch i.
        L, B: the ship's length and beam [m].
    """
    if not series.tracks:
        return {"runs": [], "fits": []}
    first = rows.sort_values(["seed", "fold"], kind="stable").drop_duplicates(
        ["model", "run"]
    )  # as the tracks: of several seeds the first
    by_run = {run: part.set_index("model") for run, part in first.groupby("run")}
    signals = [
        s for s in SIGNALS if s[0] not in (F_B, F_S) or any(np.any(t.truth[:, s[0]] != 0.0) for t in series.tracks)
    ]
    columns = [EAST, NORTH, *(q for _, _, q in signals), ERROR]
    runs = []
    for track in series.tracks:
        mine = by_run[track.run]
        lines = [shown(track.truth, track.truth, signals)]
        bands: list[dict[str, np.ndarray]] = [{}]
        for model in models:
            predicted = track.predicted.get(model)
            bands.append(widths(track.widths.get(model), signals))
            if predicted is None:
                lines.append({})
                continue
            close = near(predicted, track.truth)
            lines.append(shown(close, track.truth, signals) | {"error": ed(true=track.truth, pred=close)})
        quarters = track.truth[np.linspace(0, len(track.truth) - 1, 5).round().astype(int)]
        hulls = [outline(float(s[X]), float(s[Y]), float(s[PSI]), L, B) for s in quarters]
        cells = [[_error(mine, m), *_fits(track, m)] for m in models]
        runs.append(linked_run(track.run, str(mine["kind"].iloc[0]), track.t, columns, lines, hulls, cells, bands))
    names = [Line("measured", "measured"), *(Line(m, i) for i, m in enumerate(models))]
    histories = ["error", *(q.name for _, _, q in signals)]
    start = _median_run([by_run[track.run] for track in series.tracks])
    return linked_plots(columns, names, histories, runs, ("east", "north"), start) | {
        "fits": [STATES[i] for i in FITTED]
    }


def shown(S: np.ndarray, truth: np.ndarray, signals: Sequence[tuple[int, float, Quantity]]) -> dict[str, np.ndarray]:
    """Columns of states (steps, 6 or 10) by name; the heading is unwrapped to the turn of the true one."""
    turned = S.copy()
    turned[:, PSI] = truth[:, PSI] + wrap_angle(S[:, PSI] - truth[:, PSI])
    return {"east": S[:, Y], "north": S[:, X]} | {q.name: factor * turned[:, i] for i, factor, q in signals}


def widths(W: np.ndarray | None, signals: Sequence[tuple[int, float, Quantity]]) -> dict[str, np.ndarray]:
    """Half-widths (steps, 6) of a band by column, in the units of display; empty where there is no band."""
    if W is None:
        return {}
    return {"east": W[:, Y], "north": W[:, X]} | {
        q.name: factor * W[:, i] for i, factor, q in signals if i < W.shape[1]
    }


def _fits(track: Track, model: str) -> list[str]:
    fits = track.fits.get(model)
    return [f"{fits[i]:.0f} %" if fits is not None and np.isfinite(fits[i]) else "-" for i in FITTED]


def _error(mine: Frame, model: str) -> str:
    if model not in mine.index:
        return "not run"
    row = mine.loc[model]
    return f"{row['ed']:.3g} m" if row["status"] == "ok" else f"{row['status']}: {row['reason']}"


def _median_run(found: Sequence[Frame]) -> int:
    """Index of the window shown first: the one whose best model has the median error."""
    sizes = [float(rows.loc[rows["status"] == "ok", "ed"].min()) for rows in found]
    return int(np.argsort(np.nan_to_num(sizes, nan=np.inf), kind="stable")[len(sizes) // 2])


def near(predicted: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """States (steps, 6 or 10) up to the first position that lies farther off than twice the true track's extent: a
    model that diverges must not hide the others. The truth may have gaps."""
    known = truth[np.isfinite(truth[:, :2]).all(axis=1), :2]
    reach = 2.0 * float(np.max(np.ptp(known, axis=0), initial=1e-3)) if len(known) else np.inf
    with np.errstate(all="ignore"):
        far = (np.max(np.abs(predicted[:, :2] - truth[:, :2]), axis=1) > reach) | ~np.isfinite(predicted).all(axis=1)
    return np.where((np.cumsum(far) > 0)[:, None], np.nan, predicted)
