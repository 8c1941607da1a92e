"""Data of the pictures of a page, read from saved predictions and thinned so that the page stays small."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..bench.results import Cell, read_band, read_predictions, read_truth
from ..bench.submissions import Results
from ..errors import InputError
from ..metrics.base import fit_percent
from ..metrics.ed import ed
from ..records import Batch
from ..signals import PSI, wrap_angle

POINTS = 80_000
"""Most time steps of all models and runs of one page together; one takes about 31 characters (11 columns)."""
_MOST, _LEAST = 121, 25
"""Most and fewest time steps of one run: no more than are visible, no fewer than show the track."""
_WINDOW = 50
"""Size of the ships and texts of one run, in time steps."""


@dataclass(frozen=True, eq=False)
class Track:
    """Window: `t` (steps,) [s], `truth` and each model's prediction (steps, 10), order and units of `signals.STATES`,
    the first row at s0.

    `fits`: by model the fit of every signal (10,) [%], over all time steps of the window. `widths`: by model the
    half-widths (steps, 6) of its 90 % band about the motion, 0 at s0; models without one are left out.
    """

    run: str
    t: np.ndarray
    truth: np.ndarray
    predicted: dict[str, np.ndarray] = field(default_factory=dict)
    fits: dict[str, np.ndarray] = field(default_factory=dict)
    widths: dict[str, np.ndarray] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Series:
    """Series of one data set.

    `t` (knots,) [s]; tracks by window; errors of each model by window, position [m] and heading [deg], (windows,
    knots); `left_out`: lines on omitted parts.
    """

    t: np.ndarray
    tracks: list[Track]
    errors: dict[str, tuple[np.ndarray, np.ndarray]]
    left_out: list[str]


def gather(results: Results, dataset: str, models: Sequence[str], points: int = POINTS) -> Series:
    """Read the saved predictions of `models` on `dataset`, of several seeds the first; at most `points` points of
    tracks are kept."""
    rows = results.rows[(results.rows["dataset"] == dataset) & results.rows["model"].isin(list(models))]
    seeds = rows.groupby("model")["seed"].min().to_dict()
    left_out = [
        (
            f"Of several seeds of {_listed(m for m in models if rows.loc[rows['model'] == m, 'seed'].nunique() > 1)} "
            "only the first is drawn."
        )
    ]
    left_out = left_out if rows["seed"].nunique() > 1 else []
    order = rows[rows["status"] == "ok"].groupby("run")["ed"].median().sort_values().index.tolist()
    order += [run for run in dict.fromkeys(rows["run"]) if run not in set(order)]
    banded = any(s["task"].get("bands") for s in results.summaries if s["dataset"] == dataset)
    tracks = len(models) * (1 + banded) + 1  # and the true one
    kept = max(1, points // (_LEAST * tracks + _WINDOW))
    chosen = set(
        order if len(order) <= kept else [order[i] for i in np.linspace(0, len(order) - 1, kept).round().astype(int)]
    )
    if len(chosen) < len(order):
        left_out.append(
            f"Tracks and time histories: {len(chosen)} of {len(order)} windows, evenly spread from the least error "
            "to the greatest."
        )
    reading = _Reading(chosen, int(np.clip((points // max(1, len(chosen)) - _WINDOW) // tracks, _LEAST, _MOST)))
    pairs = list(zip(results.summaries, results.sources, strict=True))
    for summary, source in pairs:
        if summary["dataset"] == dataset and summary["model"] in seeds and summary["seed"] == seeds[summary["model"]]:
            reading.take(summary, source)
    if reading.thinned:
        left_out.append(
            f"Every track and time history is drawn through {reading.thinned} of its points, evenly spread in time."
        )
    return reading.series(order, [*left_out, *reading.missing])


def _listed(names: Iterable[str]) -> str:
    return ", ".join(f"`{name}`" for name in names)


class _Reading:
    """Reader that gathers cell by cell, so that only thinned predictions stay in memory."""

    def __init__(self, chosen: set[str], most: int) -> None:
        self.chosen, self.most, self.thinned = chosen, most, 0
        self.tracks: dict[str, Track] = {}
        self.errors: dict[str, list[tuple[np.ndarray, np.ndarray]]] = {}
        self.missing: list[str] = []
        self.t = np.zeros(0)
        self._truth: dict[tuple[Path, int], Batch] = {}

    def take(self, summary: dict[str, Any], source: Path) -> None:
        cell = Cell(summary["dataset"], summary["model"], summary["fold"], summary["seed"])
        try:
            batch = self._batch(cell, source)
            S, W = read_predictions(source, cell), read_band(source, cell)
        except InputError as error:
            reason = " ".join(str(error).split())
            self.missing.append(
                f"The predictions of `{cell.model}`, fold {cell.fold}, are not drawn; they cannot be read: {reason}."
            )
            return
        if S is None:
            if summary["status"] in ("ok", "diverged"):
                self.missing.append(
                    f"The predictions of `{cell.model}`, fold {cell.fold}, are not drawn; they are not in the "
                    "result folder."
                )
            return
        if S.shape != batch.truth.shape:
            self.missing.append(
                f"The predictions of `{cell.model}`, fold {cell.fold}, are not drawn: shape {S.shape}, that of the "
                f"truth {batch.truth.shape}."
            )
            return
        ok = np.array([status == "ok" for status in summary["run_status"]])
        self._errors(summary, batch.truth[ok], S[ok])
        predicted = np.array([status != "skipped" for status in summary["run_status"]])
        self._tracks(cell.model, batch, S, W, summary["dt"], predicted)

    def _batch(self, cell: Cell, source: Path) -> Batch:
        if (source, cell.fold) not in self._truth:
            self._truth = {(source, cell.fold): read_truth(source, cell.dataset, cell.fold)}  # one at a time
        return self._truth[source, cell.fold]

    def _errors(self, summary: dict[str, Any], truth: np.ndarray, S: np.ndarray) -> None:
        knots = _thin(truth.shape[1], _MOST)
        self.t = summary["dt"] * (knots + 1.0)
        turned = np.rad2deg(np.abs(wrap_angle(S[:, knots, PSI] - truth[:, knots, PSI])))
        self.errors.setdefault(summary["model"], []).append((ed(true=truth[:, knots], pred=S[:, knots]), turned))

    def _tracks(
        self, model: str, batch: Batch, S: np.ndarray, W: np.ndarray | None, dt: float, predicted: np.ndarray
    ) -> None:
        knots = _thin(S.shape[1] + 1, self.most)
        if len(knots) <= S.shape[1]:
            self.thinned = len(knots)
        for i, run in enumerate(batch.ids):
            if run in self.chosen and predicted[i]:
                if run not in self.tracks:
                    self.tracks[run] = Track(
                        run, dt * knots, np.concatenate([batch.s0[i : i + 1], batch.truth[i]])[knots]
                    )
                self.tracks[run].predicted[model] = np.concatenate([batch.s0[i : i + 1], S[i]])[knots]
                if W is not None and np.isfinite(W[i]).all():
                    self.tracks[run].widths[model] = np.concatenate([np.zeros((1, W.shape[2])), W[i]])[knots]
                self.tracks[run].fits[model] = fit_percent(true=batch.truth[i], pred=S[i])

    def series(self, order: Sequence[str], left_out: list[str]) -> Series:
        errors = {
            m: (np.concatenate([e for e, _ in parts]), np.concatenate([h for _, h in parts]))
            for m, parts in self.errors.items()
        }
        tracks = [self.tracks[run] for run in sorted(order) if run in self.tracks]
        return Series(self.t, tracks, {m: e for m, e in errors.items() if len(e[0])}, left_out)


def _thin(count: int, most: int) -> np.ndarray:
    """Indices of at most `most` of `count` time steps, evenly spread, with the first and the last."""
    return np.unique(np.linspace(0, count - 1, min(count, most)).round().astype(int))
