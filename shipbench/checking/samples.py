"""Check for repeated, frozen and quantised samples: values exactly equal to the one before while the ship moves."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..records import Run
from ..signals import DELTA, PSI, STATES, N, R, U, V, X, Y
from .finding import Curve, Finding, Picture, labelled, toml_line
from .recording import Recording
from .statistics import spread, stretches, times
from .thresholds import THRESHOLDS

_CHANNELS = {"x, y": (X, Y), "psi": (PSI,), "u": (U,), "v": (V,), "r": (R,)}


def _equal(run: Run, channels: Sequence[int]) -> np.ndarray:
    """Mask (samples - 1,) of samples that repeat the one before in all channels."""
    return np.all(np.diff(run.states[:, list(channels)], axis=0) == 0.0, axis=1)


def _moving(recording: Recording, run: Run, channels: Sequence[int]) -> np.ndarray:
    """Mask (samples - 1,) of steps in which the channel should change: the ship makes way, and for psi, v and r turns
    (by r, or by psi)."""
    S = run.states
    way = (
        np.hypot(np.diff(S[:, X]), np.diff(S[:, Y])) / recording.dt
        if X not in channels
        else np.hypot(S[1:, U], S[1:, V])
    )
    wide = max(3, round(THRESHOLDS.value("averaging_time") * recording.froude / recording.dt)) | 1
    way = _averaged(way, wide)
    large = THRESHOLDS.value("large_share")
    ahead = way > large * recording.speed
    if PSI in channels or V in channels:  # on a straight course v is zero to the last bit where there is no noise
        ahead &= np.abs(S[1:, R]) > large * recording.turning
    if R in channels:
        rate = _averaged(np.diff(S[:, PSI]) / recording.dt, wide)
        ahead &= np.abs(rate) > large * recording.turning
    return ahead


def _averaged(values: np.ndarray, wide: int) -> np.ndarray:
    """Moving mean over `wide` samples, of the same length."""
    return np.convolve(values, np.ones(wide) / wide)[wide // 2 :][: len(values)]


def check(recording: Recording) -> list[Finding]:
    """Find single repeats and standstills of motion channels, stuck actuators and coarse rudders."""
    found = []
    for name, channels in _CHANNELS.items():
        found += _channel(recording, name, channels)
    if recording.dataset.actuators == "measured":
        found += _stuck(recording, N) + _stuck(recording, DELTA)
    return found + _quantised(recording)


def _channel(recording: Recording, name: str, channels: Sequence[int]) -> list[Finding]:
    repeats = [_equal(run, channels) for run in recording.runs]
    moving = [_moving(recording, run, channels) for run in recording.runs]
    steps = sum(int(m.sum()) for m in moving)
    if not steps:
        return []
    needed = _needed(recording, THRESHOLDS.value("standstill_time"))
    still = [_standstills(r, m, needed) for r, m in zip(repeats, moving, strict=True)]
    single, shares = 0, {}
    for run, r, m, stops in zip(recording.runs, repeats, moving, still, strict=True):
        alone = r & m
        for a, b in stops:
            alone[a:b] = False
        single += int(alone.sum())
        if m.sum() >= 20:
            shares[recording.name_of(run)] = float(alone.sum() / m.sum())
    usual = single / steps
    rare = np.log(THRESHOLDS.value("chance"))
    allowed = max(needed, int(np.ceil(rare / np.log(usual))) if 0.0 < usual < 1.0 else 0)
    frozen = {
        run.id: [(a, b) for a, b in stops if b - a >= allowed and _visible(recording, run, channels, a, b)]
        for run, stops in zip(recording.runs, still, strict=True)
    }
    findings = _frozen(recording, name, channels, frozen)
    if usual > THRESHOLDS.value("repeated_share") and name == "x, y":
        worst = max(shares, key=lambda k: shares[k]) if shares else ""
        text = (
            f"{usual:.1%} of the samples of {name} repeat the one before while the ship moves"
            + (f" ({min(shares.values()):.1%} to {shares[worst]:.1%} of a run, most in {worst})" if shares else "")
            + f": the sensor is slower than the grid of {recording.dt:g} s or out of step with it."
        )
        findings.append(Finding(
            "samples", "note", "repeated samples", text,
            todo="Nothing for fits over seconds; do not differentiate "
                 "the position sample by sample.",
            channels=tuple(STATES[c] for c in channels), evidence={"share": usual},
            picture=_repeats_picture(recording, channels, repeats),
        ))  # fmt: skip
    return findings


def _needed(recording: Recording, seconds: float) -> int:
    """Least number of repeats of a standstill of `seconds` at 130 m."""
    return max(THRESHOLDS.count("occurrences"), round(seconds * recording.froude / recording.dt))


def _standstills(repeated: np.ndarray, moving: np.ndarray, needed: int) -> list[tuple[int, int]]:
    """Standstills of at least `needed` repeats, most of them while the ship moves."""
    most = THRESHOLDS.value("most")
    return [(a, b) for a, b in stretches(repeated) if b - a >= needed and np.mean(moving[a:b]) > most]


def _visible(recording: Recording, run: Run, channels: Sequence[int], a: int, b: int) -> bool:
    """Whether the motion from sample a to b, by the other channels, exceeds the resolution of the record."""
    S, dt, step = run.states, recording.dt, float(np.max(recording.steps[list(channels)]))
    hides, sure = THRESHOLDS.value("hidden_steps"), THRESHOLDS.value("beyond_noise")
    if X in channels:
        return float(np.sum(np.hypot(S[a:b, U], S[a:b, V])) * dt) > hides * step
    if PSI in channels:
        return float(np.ptp(np.cumsum(S[a:b, R]) * dt)) > hides * step
    if not recording.rounded(channels[0]):
        return True
    way = np.diff(S[:, X] + 1j * S[:, Y]) * np.exp(-1j * S[:-1, PSI])
    moved = {U: way.real, V: way.imag, R: np.diff(S[:, PSI])}[channels[0]]
    rounding = float(recording.steps[PSI] if R in channels else np.hypot(*recording.steps[[X, Y]]))
    apart = np.concatenate([[0.0], np.cumsum(moved - dt * 0.5 * (S[1:, channels[0]] + S[:-1, channels[0]]))])
    first, last = max(a - (b - a), 0), min(b + (b - a), len(S) - 1)
    beside = last - b + a - first
    usual = float(apart[last] - apart[b] + apart[a] - apart[first]) / max(beside, 1)  # of a current, of a bias
    ends = 1.0 + 2.0 * (b - a) / max(beside, 1)
    hidden = hides * step * (b - a) * dt + ends * (rounding + sure * spread(np.diff(apart, 2)) / np.sqrt(6.0))
    return abs(float(apart[b] - apart[a]) - (b - a) * usual) > hidden


def _frozen(
    recording: Recording, name: str, channels: Sequence[int], stops: dict[str, list[tuple[int, int]]]
) -> list[Finding]:
    """Finding on the standstills (run id -> first and last sample) of a channel in all runs."""
    runs = [run for run in recording.runs if stops.get(run.id)]
    if not runs:
        return []
    keys = tuple(STATES[c] for c in channels)
    worst = max(runs, key=lambda run: max(b - a for a, b in stops[run.id]))
    a, b = max(stops[worst.id], key=lambda s: s[1] - s[0])
    total, seconds = sum(len(stops[run.id]) for run in runs), float(worst.t[b] - worst.t[a])
    cuts: dict[str, dict[str, list[list[float]]]] = {}
    for run in runs:
        intervals = cuts.setdefault(recording.name_of(run), {"cut": []})["cut"]
        intervals.extend([float(run.t[i]), float(run.t[j])] for i, j in stops[run.id])
    text = (
        f"{name} stand{'s' * (len(keys) == 1)} still at one value while the ship moves on, "
        f"{times(total, len(cuts))}; longest for "
        f"{seconds:.3g} s, from {worst.t[a]:g} s to {worst.t[b]:g} s of '{recording.name_of(worst)}'."
    )
    part = slice(max(0, a - 3 * (b - a)), min(len(worst), b + 3 * (b - a)))
    curves = tuple(Curve(STATES[c], worst.t[part], worst.states[part, c] - worst.states[a, c], ".-") for c in channels)
    picture = Picture(
        f"{name} in run {recording.name_of(worst)}, less the frozen value", "time [s]", labelled(*keys), curves
    )
    line, figures = toml_line({"runs": cuts}), {"times": total, "longest_s": seconds}
    return [Finding("samples", "warning", "frozen", text, line, "", keys, tuple(cuts), figures, picture)]


def _repeats_picture(recording: Recording, channels: Sequence[int], repeats: list[np.ndarray]) -> Picture:
    """Picture of the channel's steps around the first repeats of the run that has most."""
    i = max(range(len(repeats)), key=lambda k: repeats[k].sum())
    run = recording.runs[i]
    first = int(np.argmax(repeats[i]))
    part = slice(max(0, first - 30), first + 60)
    step = np.hypot(*np.diff(run.states[:, list(channels)], axis=0).T)
    return Picture(
        f"Steps of x, y in run {recording.name_of(run)}",
        "time [s]",
        "step [m]",
        (Curve("step", run.t[1:][part], step[part], ".-"),),
    )


def _stuck(recording: Recording, channel: int) -> list[Finding]:
    """Find an actuator that keeps one value while its command is far from it, or while noise would move its record."""
    values = np.concatenate([run.states[:, channel] for run in recording.runs])
    reach = float(np.ptp(values))
    needed = _needed(recording, THRESHOLDS.value("standstill_time"))
    noisy = _noisy(recording, channel)
    stops: dict[str, list[tuple[int, int]]] = {}
    for run in recording.runs if reach > 0.0 else ():
        far = np.abs(run.inputs[:-1, channel - N] - run.states[1:, channel]) > THRESHOLDS.value("large_share") * reach
        stops[run.id] = [(a, b) for a, b in stretches(_equal(run, (channel,)) & (far | noisy)) if b - a >= needed]
    return _frozen(recording, STATES[channel], (channel,), stops)


def _noisy(recording: Recording, channel: int) -> bool:
    """Whether noise moves the record at every sample."""
    steps = [np.diff(run.states[:, channel]) for run in recording.runs]
    back = np.concatenate([s[1:] * s[:-1] < 0.0 for s in steps])
    repeats = np.mean(np.concatenate(steps) == 0.0)
    rarely, often = THRESHOLDS.value("least_share"), THRESHOLDS.value("noisy_reversals")
    return bool(repeats < rarely and len(back) and np.mean(back) > often)


def _quantised(recording: Recording) -> list[Finding]:
    """Find a rudder that is recorded in coarse steps."""
    if "delta" not in recording.recorded:
        return []
    values = np.concatenate([run.states[:, DELTA] for run in recording.runs])
    levels = np.unique(np.round(values, 7))
    gaps = np.diff(levels)
    if not 5 <= len(levels) <= 0.2 * len(values):
        return []
    step = float(np.median(gaps))
    whole = gaps / step
    if np.mean(np.abs(whole - np.round(whole)) < 0.1) < 0.8 or np.mean(np.round(whole) == 1.0) < 0.5:
        return []
    text = f"delta is recorded in steps of {np.rad2deg(step):.2f} deg: {len(levels)} values in {len(values)} samples."
    counts = np.array([np.sum(np.abs(values - level) < 0.5 * step) for level in levels])
    picture = Picture(
        "Values of delta", "delta [deg]", "samples", (Curve("samples", np.rad2deg(levels), counts.astype(float), "."),)
    )
    return [Finding(
        "samples", "note", "quantised", text, todo="Nothing; a rudder offset below half a step cannot be detected.",
        channels=("delta",),
        evidence={"step_rad": step, "levels": len(levels)}, picture=picture,
    )]  # fmt: skip


CHECK = check
