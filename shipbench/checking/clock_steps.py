"""Check for clocks that were set during the log: the ship moves by more, or by less, than the time stamps allow.

After a step back (the rows with repeated times are gone), position and heading jump ahead along the motion. After a
step ahead, a gap in time is longer than the distance across it.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from ..records import Run
from ..signals import PSI, R, U, V, X, Y
from .finding import Finding, toml_line
from .recording import Recording
from .statistics import times
from .thresholds import THRESHOLDS


def _motion(before: np.ndarray, after: np.ndarray) -> tuple[complex, float, float]:
    """Velocity in the earth's axes, yaw rate, and the greatest change of the velocity from the one to the other
    (samples, 10)."""
    way = [np.mean((S[:, U] + 1j * S[:, V]) * np.exp(1j * S[:, PSI])) for S in (before, after)]
    rate = 0.5 * float(np.mean(before[:, R]) + np.mean(after[:, R]))
    return complex(0.5 * (way[0] + way[1])), rate, float(abs(way[1] - way[0]))


def set_back(run: Run, k: int, leap: complex, turned: float) -> float | None:
    """Time [s] by which the clock was set back between samples k and k + 1, where position and heading both jump along
    the motion; else None."""
    way, rate, _ = _motion(run.states[max(0, k - 3) : k + 1], run.states[k + 1 : k + 5])
    seconds = float(np.real(leap * np.conj(way)) / max(abs(way) ** 2, 1e-12))
    share = THRESHOLDS.value("little")
    explained = abs(leap - seconds * way) < share * abs(leap) and abs(turned - seconds * rate) < share * abs(turned)
    return seconds if explained and abs(seconds) >= THRESHOLDS.value("clock_step") else None


def clock_finding(recording: Recording, steps: dict[tuple[str, int], float]) -> Finding:
    """Finding on the clocks set back: (run id, last sample before) -> seconds."""
    runs = {run.id: run for run in recording.runs}
    (name, k), seconds = max(steps.items(), key=lambda step: abs(step[1]))
    cuts: dict[str, dict[str, list[list[float]]]] = {}
    for other, i in steps:
        t = float(runs[other].t[i + 1])
        cuts.setdefault(recording.name_of(runs[other]), {"cut": []})["cut"].append([t, t])
    run = runs[name]
    text = (
        f"the clock is set {'back' if seconds > 0.0 else 'ahead'} {times(len(steps), len(cuts))}: from {run.t[k]:g} "
        f"s to {run.t[k + 1]:g} s of "
        f"'{recording.name_of(run)}' position and heading move on as in {seconds + recording.dt:.3g} s."
    )
    todo = "The cut splits the run there. What follows is a recording of its own."
    figures = {"seconds": seconds, "steps": len(steps)}
    return Finding(
        "spikes", "warning", "clock step", text, toml_line({"runs": cuts}), todo, ("t",), tuple(cuts), figures
    )


def check(recording: Recording) -> list[Finding]:
    """Find gaps in time that are longer than the distance across them, by a second or more; one finding."""
    pieces: dict[str, list[Run]] = {}
    for run in recording.runs:
        pieces.setdefault(recording.name_of(run), []).append(run)
    found = {}
    for name, runs in pieces.items():
        for a, b in pairwise(sorted(runs, key=lambda run: float(run.t[0]))):
            gap = float(b.t[0] - a.t[-1])
            seconds = _ahead(a.states, b.states, gap, recording)
            if seconds is not None:
                found[name] = (gap, seconds, float(a.t[-1]))
    if not found:
        return []
    worst = max(found, key=lambda name: found[name][1])
    gap, seconds, at = found[worst]
    text = (
        f"the clock is set ahead {times(len(found), len(found))}: from {at:g} s to {at + gap:g} s of '{worst}' "
        f"the ship moves on as in {gap - seconds:.3g} s. The runs are split there."
    )
    return [
        Finding(
            "clock_steps",
            "note",
            "clock step",
            text,
            "",
            "Nothing: no sample is made up in the gap.",
            ("t",),
            tuple(found),
            {"seconds": seconds},
        )
    ]


def _ahead(before: np.ndarray, after: np.ndarray, gap: float, recording: Recording) -> float | None:
    """Time [s] by which the stamps of a gap are longer than the ship needs across it; None where the motion does not
    show it."""
    if gap < 1.5 * recording.dt:
        return None
    way, rate, change = _motion(before[-4:], after[:4])
    moved = complex(*(after[0, [X, Y]] - before[-1, [X, Y]]))
    seconds = float(np.real(moved * np.conj(way)) / max(abs(way) ** 2, 1e-12))
    turned = float(np.remainder(after[0, PSI] - before[-1, PSI] + np.pi, 2.0 * np.pi) - np.pi)
    early, beside = gap - seconds, abs(moved - seconds * way)
    least = THRESHOLDS.value("least_distance") * recording.dataset.ship.L
    doubt = (0.5 * change * gap + beside + least) / max(abs(way), 1e-12)
    alike = abs(turned - rate * seconds) <= abs(turned - rate * gap) or abs(rate * gap) < 0.01
    long = early >= THRESHOLDS.value("clock_step") and early > 2.0 * doubt
    return early if long and seconds > 0.0 and alike else None


CHECK = check
