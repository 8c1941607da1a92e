"""Check for held fixes: a receiver or compass gives a value now and then, and a faster record repeats it until the
next.

Each value is correct when it arrives and late until the next. It counts as held if the ship moves on, by the other
channels, further than the resolution of the record, and if that holds for most values.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..data.corrections import between_fixes
from ..records import Run
from ..signals import PSI, STATES, R, U, V, X, Y
from .finding import Curve, Finding, Picture, labelled, toml_line
from .recording import Recording
from .statistics import stretches
from .thresholds import THRESHOLDS


def _digit(changes: np.ndarray) -> float:
    """Resolution of a record: the least of its changes and of their differences (close to zero for numbers in full
    precision)."""
    size = np.unique(np.abs(changes[changes != 0.0]))
    size = size[np.concatenate([[True], np.diff(size) > 1e-6 * size[-1]])]
    return float(np.min(np.concatenate([size[:1], np.diff(size)])))


def _moved(run: Run, dt: float) -> dict[int, np.ndarray]:
    """Displacement and turn by the rates (samples,)."""
    S = run.states
    way = np.cumsum((S[:, U] + 1j * S[:, V]) * np.exp(1j * S[:, PSI])) * dt
    return {X: way.real, Y: way.imag, PSI: np.cumsum(S[:, R]) * dt}


def _held(recording: Recording, channel: int) -> int:
    """Number of samples for which most values are held; 0 where they are not."""
    changes = np.concatenate([np.diff(run.states[:, channel]) for run in recording.runs])
    if np.sum(changes != 0.0) < THRESHOLDS.count("occurrences"):
        return 0
    digit, lengths, values = _digit(changes), [], 0
    for run in recording.runs:
        moved = _moved(run, recording.dt)[channel]
        holds = stretches(np.diff(run.states[:, channel]) == 0.0)
        lengths += [b - a + 1 for a, b in holds if abs(moved[b] - moved[a]) > THRESHOLDS.value("hidden_steps") * digit]
        values += int(np.sum(np.diff(run.states[:, channel]) != 0.0))
    return round(float(np.median(lengths))) if len(lengths) > max(0.5 * values, THRESHOLDS.count("occurrences")) else 0


def correct_held(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Recording with linear interpolation from fix to fix, and one finding."""
    made = (
        {PSI} if "r" in recording.dataset.derived else {X, Y} if {"u", "v"} & set(recording.dataset.derived) else set()
    )
    held = {channel: length for channel in (X, Y, PSI) if channel not in made and (length := _held(recording, channel))}
    if not held:
        return recording, []
    runs = []
    for run in recording.runs:
        states = run.states.copy()
        for channel in held:
            states[:, channel] = between_fixes(states[:, channel])
        runs.append(replace(run, states=states))
    return recording.with_dataset(recording.dataset.with_runs(runs)), [_finding(recording, held, runs)]


def _finding(recording: Recording, held: dict[int, int], runs: list[Run]) -> Finding:
    names, dt = tuple(STATES[c] for c in held), recording.dt
    late = ", ".join(f"{STATES[c]} {0.5 * (length - 1) * dt:.2g} s" for c, length in held.items())
    text = (
        f"{', '.join(names)} hold{'s' * (len(names) == 1)} each value for {max(held.values())} samples while the "
        "ship moves on: the sensor gives one "
        f"every {max(held.values()) * dt:.3g} s, the record has one every {dt:g} s. It is late by {late} on average."
    )
    given = [c for c in recording.given.get("held", []) if c not in names]
    run, after = recording.runs[0], runs[0]
    channel, part = next(iter(held)), slice(0, 8 * max(held.values()))
    curves = (
        Curve("as recorded", run.t[part], run.states[part, channel], ".-"),
        Curve("from fix to fix", after.t[part], after.states[part, channel]),
    )  # fmt: skip
    picture = Picture(
        f"{STATES[channel]} in run {recording.name_of(run)}", "time [s]", labelled(STATES[channel]), curves
    )
    return Finding(
        "held", "warning", "held fixes", text, toml_line({"held": [*given, *names]}), "", names,
        evidence={"samples": max(held.values()), "seconds": max(held.values()) * dt}, picture=picture,
    )  # fmt: skip
