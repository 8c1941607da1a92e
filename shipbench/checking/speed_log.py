"""Check for a speed-log dropout: the log reads zero while the ship makes way, below some speed (a Doppler log, a held
receiver), or now and then.

A ship without way through the water drifts with it, steadily for a minute or two. Where the log reads zero, and the
track departs from the nearest steady drift by more than the log explains, the log is wrong.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import cumulative_trapezoid

from ..data.noise import white_noise
from ..records import Dataset, Run
from ..signals import PSI, U, V, X, Y
from .finding import Curve, Finding, Picture, labelled
from .recording import Recording
from .statistics import stretches
from .thresholds import THRESHOLDS


@dataclass(frozen=True)
class Dropout:
    """Speed-log dropout. level: speed [m/s] up to which the log reads zero; pieces that show it, and their share of the
    samples; departure: the greatest of the track from a steady drift [m], and its seconds; worst: the run with that."""

    level: float
    pieces: int
    share: float
    departure: float
    seconds: float
    worst: Run


def dropout(dataset: Dataset) -> Dropout | None:
    """Speed-log dropout: u and v read nothing though the ship makes way; None where there is none."""
    L, dt = dataset.ship.L, dataset.dt
    limits = THRESHOLDS.value("short_window"), THRESHOLDS.value("silent_longest")
    shortest, longest = (max(round(seconds * (L / 130.0) ** 0.5 / dt), 5) for seconds in limits)
    runs = [run for run in dataset.runs if len(run) >= shortest]
    if not runs:
        return None
    noise = {c: float(np.median([white_noise(run.states[:, c]) for run in runs])) for c in (X, Y, U, V)}
    noises, speed = THRESHOLDS.value("beyond_noise"), THRESHOLDS.value("speed_at_rest") * (9.81 * L) ** 0.5
    u, v = (max(noises * noise[c], speed) for c in (U, V))
    least = max(THRESHOLDS.value("least_distance") * L, noises * noise[X], noises * noise[Y])
    found, samples = [], 0
    for run in runs:
        for begin, end in stretches((np.abs(run.states[:, U]) < u) & (np.abs(run.states[:, V]) < v)):
            for a in range(begin, end, longest):
                S = run.states[a : min(a + longest, end)]
                departure, left = _departures(S, dt) if len(S) >= shortest else (0.0, 0.0)
                if departure > least and left > THRESHOLDS.value("most") * departure:
                    found.append((departure, len(S) * dt, run))
                    samples += len(S)
    if len(found) < THRESHOLDS.count("silent_pieces"):
        return None
    return Dropout(
        float(np.hypot(u, v)),
        len(found),
        samples / sum(map(len, dataset.runs)),
        *max(found, key=lambda shown: shown[0]),
    )


def in_words(found: Dropout) -> str:
    """Sentence on the dropout, with its figures."""
    return (
        f"u and v read zero (below {found.level:.2g} m/s) in {found.pieces} pieces, {found.share:.0%} of the "
        "samples, but the ship makes way "
        f"there: the track departs from a steady drift by up to {found.departure:.3g} m in {found.seconds:.3g} s."
    )


def _departures(S: np.ndarray, dt: float) -> tuple[float, float]:
    """Greatest distance [m] of the track from the nearest steady drift, as recorded and less the displacement by u and
    v."""
    track = S[:, X] + 1j * S[:, Y]
    way = cumulative_trapezoid((S[:, U] + 1j * S[:, V]) * np.exp(1j * S[:, PSI]), dx=dt, initial=0.0)
    line = np.column_stack([np.ones(len(S)), np.arange(len(S))]).astype(complex)
    z = np.column_stack([track, track - way])
    plain, left = np.max(np.abs(z - line @ np.linalg.lstsq(line, z, rcond=None)[0]), axis=0)
    return float(plain), float(left)


def check(recording: Recording) -> list[Finding]:
    """Find a speed-log dropout; one finding at most."""
    found = dropout(recording.dataset)
    if found is None:
        return []
    run = found.worst
    by_track = np.hypot(*np.gradient(run.states[:, [X, Y]], run.t, axis=0).T)
    curves = (
        Curve("u", run.t, run.states[:, U]),
        Curve("v", run.t, run.states[:, V]),
        Curve("speed of the track", run.t, by_track),
    )
    return [Finding(
        "speed_log", "error", "speed-log dropout", in_words(found), channels=("u", "v"),
        todo="Import it again without u and v: `shipbench data import` takes them from the track then, as "
             "`shipbench diagnose` does by itself.",
        evidence={"level": found.level, "pieces": found.pieces, "share": found.share, "departure_m": found.departure},
        picture=Picture(f"Speed in run {recording.name_of(run)}", "time [s]", labelled("u", "v"), curves),
    )]  # fmt: skip


CHECK = check
