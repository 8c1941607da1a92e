"""Check for a heading that was interpolated linearly across 360/0 or 180/-180, reported as such and not as the jumps or
the yaw-rate scale that it causes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..importing.north import fill_angle, interpolated
from ..signals import PSI
from .finding import Curve, Finding, Picture, toml_line
from .recording import Recording
from .statistics import times


def correct_north(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Recording with linear interpolation in place of such samples, and one finding."""
    found = {run.id: places for run in recording.runs if (places := interpolated(run.states[:, PSI], recording.turn))}
    if not found:
        return recording, []
    runs = []
    fills: dict[str, dict[str, dict[str, list[list[float]]]]] = {}
    for run in recording.runs:
        if run.id in found:
            bad = np.zeros(len(run), dtype=bool)
            for a, b in found[run.id]:
                bad[a : b + 1] = True
            fill = fills.setdefault(recording.name_of(run), {"fill": {"psi": []}})["fill"]["psi"]
            fill.extend([float(run.t[a]), float(run.t[b])] for a, b in found[run.id])
            states = run.states.copy()
            states[:, PSI] = fill_angle(states[:, PSI], bad, recording.turn)
            run = replace(run, states=states)
        runs.append(run)
    return recording.with_dataset(recording.dataset.with_runs(runs)), [_finding(recording, found, fills)]


def _finding(recording: Recording, found: dict[str, list[tuple[int, int]]], fills: dict) -> Finding:
    run = next(run for run in recording.runs if run.id in found)
    a, b = found[run.id][0]
    number = np.rad2deg(2.0 * np.pi * np.remainder(run.states[a - 1 : b + 2, PSI], recording.turn) / recording.turn)
    total, samples = sum(map(len, found.values())), sum(b - a + 1 for places in found.values() for a, b in places)
    text = (
        f"psi was interpolated linearly across 360/0, {times(total, len(fills))}, in {samples} samples. "
        f"The first: from {number[0]:.0f} to {number[-1]:.0f} degrees by "
        f"{', '.join(f'{v:.0f}' for v in number[1:-1][:3])}, "
        f"from {run.t[a - 1]:g} s to {run.t[b + 1]:g} s of '{recording.name_of(run)}'."
    )
    part = slice(max(0, a - 20), b + 21)
    picture = Picture(
        f"psi in run {recording.name_of(run)}",
        "time [s]",
        "psi, as recorded",
        (Curve("psi", run.t[part], run.states[part, PSI], ".-"),),
    )
    todo = "Or resample the log again with the heading unwrapped first."
    return Finding(
        "north", "error", "interpolated across north", text, toml_line({"runs": fills}), todo, ("psi",), tuple(fills),
        {"places": total, "samples": samples}, picture,
    )  # fmt: skip
