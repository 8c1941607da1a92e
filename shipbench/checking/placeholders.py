"""Check for placeholder values of "not available" (a heading of 511, a position of 0, 0): a channel jumps to one, holds
it exactly, and jumps back.

No motion does that: a sensor that freezes keeps its value, and a ship that stops comes to rest. These samples are cut
before other checks.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..importing.north import LEAP
from ..signals import DELTA, PSI, STATES, R, U, V, X, Y
from .finding import Curve, Finding, Picture, labelled, toml_line
from .recording import Recording
from .statistics import stretches, times
from .thresholds import THRESHOLDS


def _blocks(z: np.ndarray, limit: float) -> list[tuple[int, int]]:
    """First and last samples of the blocks in z (samples,): equal values between two jumps, out and back, with the
    samples between on the slopes."""
    steps, found = np.abs(np.diff(z)), []
    for a, b in stretches(steps == 0.0):
        while a > 1 and steps[a - 1] > limit and steps[a - 2] > limit:
            a -= 1
        while b < len(z) - 2 and steps[b] > limit and steps[b + 1] > limit:
            b += 1
        if (
            a > 0
            and b < len(z) - 1
            and min(steps[a - 1], steps[b]) > limit
            and abs(z[b + 1] - z[a - 1]) < 0.5 * abs(z[b] - z[a - 1])
        ):
            found.append((a, b))
    return found


def _channel(recording: Recording, channels: Sequence[int]) -> dict[str, list[tuple[int, int]]]:
    """Blocks by run id."""
    z = {
        run.id: run.states[:, channels[0]] + (1j * run.states[:, channels[1]] if len(channels) > 1 else 0.0)
        for run in recording.runs
    }
    steps = np.concatenate([np.abs(np.diff(values)) for values in z.values()])
    if not np.any(steps > 0.0):
        return {}
    usual = float(np.median(steps[steps > 0.0]))
    found = {name: _blocks(values, LEAP * usual) for name, values in z.items()}
    return {name: blocks for name, blocks in found.items() if blocks}


def _impossible(recording: Recording, found: dict[str, list[tuple[int, int]]]) -> dict[str, list[tuple[int, int]]]:
    """Blocks of rudder angles that no rudder reaches, unless the record has such angles elsewhere too: then the unit is
    another one."""
    kept = {}
    for run in recording.runs:
        beyond = np.abs(run.states[:, DELTA]) > THRESHOLDS.value("largest_rudder_angle")
        explained = np.zeros(len(run), dtype=bool)
        blocks = [(a, b) for a, b in found.get(run.id, []) if beyond[a : b + 1].any()]
        for a, b in blocks:
            explained[a : b + 1] = True
        if np.any(beyond & ~explained):
            return {}
        kept[run.id] = blocks
    return {name: blocks for name, blocks in kept.items() if blocks}


def correct_placeholders(recording: Recording) -> tuple[Recording, list[Finding]]:
    """Recording without such samples, and one finding for each channel."""
    findings, bad = [], {run.id: np.zeros(len(run), dtype=bool) for run in recording.runs}
    for channels in ((X, Y), (PSI,), (U,), (V,), (R,), (DELTA,)):
        found = (
            _impossible(recording, _channel(recording, channels))
            if channels == (DELTA,)
            else _channel(recording, channels)
        )
        if found:
            findings.append(_finding(recording, channels, found))
        for name, blocks in found.items():
            for a, b in blocks:
                bad[name][a : b + 1] = True
    return (recording.without(bad), findings) if findings else (recording, [])


def _finding(recording: Recording, channels: Sequence[int], found: dict[str, list[tuple[int, int]]]) -> Finding:
    runs = {run.id: run for run in recording.runs if run.id in found}
    keys = tuple(STATES[c] for c in channels)
    cuts: dict[str, dict[str, list[list[float]]]] = {}
    for name, blocks in found.items():
        cuts.setdefault(recording.name_of(runs[name]), {"cut": []})["cut"].extend(
            [float(runs[name].t[a]), float(runs[name].t[b])] for a, b in blocks
        )
    run = next(iter(runs.values()))
    a, b = found[run.id][0]
    middle = (a + b) // 2
    value = ", ".join(f"{run.states[middle, c]:.6g}" for c in channels)
    total, samples = sum(map(len, found.values())), sum(b - a + 1 for blocks in found.values() for a, b in blocks)
    text = (
        f"{', '.join(keys)} leap{'s' * (len(keys) == 1)} to a constant and back {times(total, len(cuts))}, in "
        f"{samples} samples. "
        f"The first is {value} from {run.t[a]:g} s to {run.t[b]:g} s of '{recording.name_of(run)}': a value that "
        "stands for 'not available'."
    )
    part = slice(max(0, a - 20), b + 21)
    curves = tuple(Curve(key, run.t[part], run.states[part, c], ".-") for key, c in zip(keys, channels, strict=True))
    picture = Picture(f"{', '.join(keys)} in run {recording.name_of(run)}", "time [s]", labelled(*keys), curves)
    return Finding(
        "placeholders",
        "warning",
        "placeholder",
        text,
        toml_line({"runs": cuts}),
        "",
        keys,
        tuple(cuts),
        {"blocks": total, "samples": samples},
        picture,
    )
