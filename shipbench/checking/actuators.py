"""Check for actuator columns that are commands, not measurements: they change by much of their range inside one sample,
or repeat their command exactly."""

from __future__ import annotations

import numpy as np

from ..signals import COMMANDS, DELTA, N
from .finding import Curve, Finding, Picture, labelled, toml_line
from .recording import Recording
from .thresholds import THRESHOLDS

_NAMES = ("n", "delta", "F_b", "F_s")


def check(recording: Recording) -> list[Finding]:
    """Find actuators that look like commands, as one finding; none where the data set says that they are commands.

    Every rudder has a steering gear with a finite rate, so its jumps alone are a sign; those of shafts and thrusters
    count only beside such a rudder.
    """
    if recording.dataset.actuators != "measured":
        return []
    exact: dict[str, str] = {}
    sudden: dict[str, str] = {}
    figures: dict[str, float] = {}
    for i, name in enumerate(_NAMES):
        if name not in recording.recorded:
            continue
        share, changes = _exact(recording, i) if COMMANDS[i] in recording.recorded else (0.0, 0)
        if changes >= THRESHOLDS.count("occurrences") and share > 0.98:
            exact[name] = f"{name} equals its command at {share:.1%} of {changes} changes"
        jumps, greatest = _sudden(recording, N + i)
        if jumps >= THRESHOLDS.count("occurrences"):
            sudden[name] = (
                f"{name} changes {jumps} times within one sample of {recording.dt:g} s, by up to {greatest:.4g} "
                f"{_unit(name)}"
            )
        figures |= {f"{name}_exact": share, f"{name}_jumps": jumps, f"{name}_greatest": greatest}
    if (
        "delta" not in sudden and "n" in sudden and figures.get("delta_jumps") and _held(recording) > 0.5
    ):  # few leaps, beside those of the shaft
        sudden["delta"] = (
            f"delta changes within one sample of {recording.dt:g} s by {figures['delta_greatest']:.4g} rad"
        )
    said = exact | ({k: v for k, v in sudden.items() if k not in exact} if "delta" in sudden else {})
    if not said:
        return []
    suspect = [name for name in _NAMES if name in said]
    text = (
        f"{', '.join(suspect)} behave{'s' * (len(suspect) == 1)} like commands, not like measured positions: "
        f"{'; '.join(said[k] for k in suspect)}."
    )
    channel = N + _NAMES.index(suspect[-1])
    run = max(recording.runs, key=lambda r: float(np.max(np.abs(np.diff(r.states[:, channel])))))
    at = int(np.argmax(np.abs(np.diff(run.states[:, channel]))))
    part = slice(max(0, at - 30), at + 32)
    curves = (Curve(suspect[-1], run.t[part], run.states[part, channel], ".-"),)
    picture = Picture(f"{suspect[-1]} in run {recording.name_of(run)}", "time [s]", labelled(suspect[-1]), curves)
    return [
        Finding(
            "actuators",
            "warning",
            "commands",
            text,
            toml_line({"actuators": "commanded"}),
            "",
            tuple(suspect),
            evidence=figures,
            picture=picture,
        )
    ]


def _held(recording: Recording) -> float:
    """Share of the samples at which the rudder angle is exactly that of the sample before."""
    return float(np.mean(np.concatenate([np.diff(run.states[:, DELTA]) == 0.0 for run in recording.runs])))


def _unit(name: str) -> str:
    return {"n": "rpm", "delta": "rad"}.get(name, "N")


def _exact(recording: Recording, i: int) -> tuple[float, int]:
    """Share of the command's changes at which the actuator takes exactly the new value, in the same sample or the next;
    and their number."""
    same = changes = 0
    for run in recording.runs:
        command, actuator = run.inputs[:, i], run.states[:, N + i]
        at = np.flatnonzero(np.diff(command) != 0.0) + 1
        at = at[at < len(command) - 1]
        same += int(np.sum((actuator[at] == command[at]) | (actuator[at + 1] == command[at])))
        changes += len(at)
    return (same / changes if changes else 0.0), changes


def _sudden(recording: Recording, channel: int) -> tuple[int, float]:
    """Number of lasting steps within one sample, at a rate that sweeps the range in `sudden_sweep`; and the
    greatest."""
    values = np.concatenate([run.states[:, channel] for run in recording.runs])
    reach = float(np.ptp(np.quantile(values, [0.001, 0.999])))
    sweep = THRESHOLDS.value("sudden_sweep") * recording.froude
    least = reach * max(THRESHOLDS.value("large_share"), recording.dt / sweep)
    if reach <= 0.0 or least > reach:
        return 0, 0.0
    steps = [0.0]
    for run in recording.runs:
        v = run.states[:, channel]
        for k in np.flatnonzero(np.abs(np.diff(v)) > least):
            after = v[k + 1 : k + 4]
            if len(after) == 3 and np.all(
                np.abs(after - v[k]) > 0.7 * least
            ):  # one sample that comes back is an outlier
                steps.append(float(abs(v[k + 1] - v[k])))
    return len(steps) - 1, max(steps)


CHECK = check
