"""Check for outliers (single samples away from their neighbours) and jumps (lasting steps of position or heading).

An outlier differs from the mean of its neighbours by eight robust standard deviations of all such differences of the
channel, while the neighbours agree among themselves. Position and heading are examined after their integrals (of the
speeds, of the yaw rate) are subtracted. A jump is a step of that difference that lasts, when outliers are filled.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..records import Run
from ..signals import DELTA, PSI, STATES, N, R, U, V, X, Y
from .actuators import check as command_like
from .clock_steps import clock_finding
from .clock_steps import set_back as clock_set_back
from .finding import Curve, Finding, Picture, labelled, toml_line
from .recording import Recording
from .statistics import some, spread, times
from .thresholds import THRESHOLDS

_PLACES = ((X, Y), (PSI,))


def _levels(recording: Recording, run: Run, actuators: bool = False) -> dict[int, np.ndarray]:
    """Channels to examine (samples,), slow parts of position and heading subtracted."""
    S, dt = run.states, recording.dt
    velocity = (S[:, U] + 1j * S[:, V]) * np.exp(1j * S[:, PSI])
    way = np.concatenate([[0.0], np.cumsum(0.5 * (velocity[1:] + velocity[:-1]) * dt)])
    turned = np.concatenate([[0.0], np.cumsum(0.5 * (S[1:, R] + S[:-1, R]) * dt)])
    found = {X: S[:, X] - way.real, Y: S[:, Y] - way.imag, PSI: S[:, PSI] - turned, U: S[:, U], V: S[:, V], R: S[:, R]}
    if actuators:
        found |= {N: S[:, N], DELTA: S[:, DELTA]}
    return found


def _least(recording: Recording, channel: int, values: list[np.ndarray]) -> float:
    """Size of the smallest outlier: more than one step of a quantised record, which may alternate between two of
    them."""
    if channel in (X, Y):
        own = THRESHOLDS.value("least_distance") * recording.dataset.ship.L
    elif channel == PSI:
        own = float(np.deg2rad(THRESHOLDS.value("least_angle")))
    else:
        reach = float(np.ptp(np.concatenate([np.quantile(v, [0.02, 0.98]) for v in values])))
        own = THRESHOLDS.value("least_share") * reach
    return max(own, 1.5 * float(recording.steps[channel]))


def _off(values: np.ndarray) -> np.ndarray:
    """Differences (samples - 4,) of samples 2 .. -3 from the mean of their neighbours."""
    return values[2:-2] - 0.5 * (values[1:-3] + values[3:-1])


def find_spikes(recording: Recording) -> dict[int, dict[str, np.ndarray]]:
    """Indices of the outliers: channel -> run id -> samples."""
    measured = recording.dataset.actuators == "measured" and not command_like(
        recording
    )  # commands may well come for one sample only
    levels = {run.id: _levels(recording, run, measured) for run in recording.runs if len(run) >= 7}
    states = {run.id: run.states for run in recording.runs}
    found: dict[int, dict[str, np.ndarray]] = {}
    for channel in (X, Y, PSI, U, V, R, N, DELTA):
        values = {name: each[channel] for name, each in levels.items() if channel in each}
        if not values:
            continue
        usual = spread(np.concatenate([_off(v) for v in values.values()]))
        limit = max(THRESHOLDS.value("outlier_size") * usual, _least(recording, channel, list(values.values())))
        for name, v in values.items():
            d = np.abs(np.diff(v))
            near = np.maximum(
                np.maximum(d[:-3], d[3:]), np.abs(v[3:-1] - v[1:-3])
            )  # neighbours among themselves, without the sample
            off = np.abs(_off(v))
            at = np.flatnonzero((off > limit) & (off > THRESHOLDS.value("beyond_noise") * near)) + 2
            at = at[~_held(states[name], channel)[at]]
            if len(at):
                found.setdefault(channel, {})[name] = at
    return found


def _held(S: np.ndarray, channel: int) -> np.ndarray:
    """Mask (samples,) where the sample or a neighbour is a repeated one, which `samples` reports."""
    same = S[1:, channel] == S[:-1, channel]
    near = np.zeros(len(S), dtype=bool)
    near[1:] |= same
    near[:-1] |= same
    return near if channel in (X, Y, PSI) else np.zeros(len(S), dtype=bool)


def _without(recording: Recording, found: dict[int, dict[str, np.ndarray]]) -> Recording:
    """Recording with outliers replaced by the mean of their neighbours."""
    runs = []
    for run in recording.runs:
        states = run.states.copy()
        for channel, by_run in found.items():
            at = by_run.get(run.id, np.array([], dtype=int))
            states[at, channel] = 0.5 * (states[at - 1, channel] + states[at + 1, channel])
        runs.append(replace(run, states=states))
    return recording.with_dataset(recording.dataset.with_runs(runs))


def check(recording: Recording) -> list[Finding]:
    """Find outliers of every channel, then jumps of position and heading."""
    spikes = find_spikes(recording)
    return [_spikes(recording, channel, by_run) for channel, by_run in spikes.items()] + _jumps(
        _without(recording, spikes)
    )


def _spikes(recording: Recording, channel: int, by_run: dict[str, np.ndarray]) -> Finding:
    name = STATES[channel]
    runs = {run.id: run for run in recording.runs}
    sizes = {
        k: float(np.max(np.abs(_off(_levels(recording, runs[k], True)[channel])[at - 2]))) for k, at in by_run.items()
    }
    worst = max(sizes, key=lambda k: sizes[k])
    run, at = runs[worst], by_run[worst]
    total, names = sum(len(v) for v in by_run.values()), recording.names(runs[k] for k in by_run)
    text = (
        f"{name} stands off its neighbours {times(total, len(names))} ({some(names)}); "
        f"the greatest outlier stands {sizes[worst]:.3g} off its neighbours, in '{recording.name_of(run)}'."
    )
    fills: dict[str, dict] = {}
    for k, samples in by_run.items():
        intervals = fills.setdefault(recording.name_of(runs[k]), {"fill": {name: []}})["fill"][name]
        intervals.extend([float(runs[k].t[i]), float(runs[k].t[i])] for i in samples)
    part = slice(max(0, int(at[0]) - 20), int(at[0]) + 21)
    picture = Picture(
        f"{name} in run {recording.name_of(run)}", "time [s]", labelled(name),
        (Curve(name, run.t[part], run.states[part, channel], ".-"),
            Curve("outlier", run.t[at[:1]], run.states[at[:1], channel], "o")),
    )  # fmt: skip
    return Finding(
        "spikes",
        "warning",
        "outliers",
        text,
        toml_line({"runs": fills}),
        "",
        (name,),
        tuple(fills),
        {"samples": total, "greatest": sizes[worst]},
        picture,
    )


def _jumps(recording: Recording) -> list[Finding]:
    """Findings on lasting steps of position less integrated speeds, and of heading less integrated yaw rate; both at
    once along the motion are the clock's."""
    levels = {run.id: _levels(recording, run) for run in recording.runs if len(run) >= 9}
    combined = {channels: {k: _combined(each, channels) for k, each in levels.items()} for channels in _PLACES}
    at = {channels: _places(recording, channels, combined[channels]) for channels in _PLACES if levels}
    set_back: dict[tuple[str, int], float] = {}
    for run in recording.runs if at else ():
        for k in set.intersection(*(set(places.get(run.id, ())) for places in at.values())):
            leap, turned = (_level_change(combined[channels][run.id], k) for channels in _PLACES)
            if (seconds := clock_set_back(run, k, leap, turned.real)) is not None:
                set_back[run.id, k] = seconds
    found = [clock_finding(recording, set_back)] if set_back else []
    for channels, places in at.items():
        left = {name: rest for name, ks in places.items() if (rest := [k for k in ks if (name, k) not in set_back])}
        found += [_jump(recording, channels, left, combined[channels])] if left else []
    return found


def _combined(each: dict[int, np.ndarray], channels: tuple[int, ...]) -> np.ndarray:
    return np.asarray(each[X] + 1j * each[Y] if X in channels else each[PSI] + 0j)


def _places(recording: Recording, channels: tuple[int, ...], levels: dict[str, np.ndarray]) -> dict[str, list[int]]:
    """Last samples before the jumps of position or heading, by run id."""
    steps = np.concatenate([np.diff(v) for v in levels.values()])
    noise = float(np.hypot(spread(steps.real), spread(steps.imag)))
    limit = max(THRESHOLDS.value("outlier_size") * noise, 2.0 * _least(recording, channels[0], []))
    made = {"u", "v"} if X in channels else {"r"}
    found = {}
    for run in recording.runs:
        if run.id not in levels:
            continue
        v, size = levels[run.id], _steps(levels[run.id], run.states, channels[0])
        if made & set(
            recording.dataset.derived
        ):  # rates smoothed of this very record lag behind a sharp turn: a jump stands out by itself
            size = np.minimum(size, _beside(run.states, channels))
        places = [int(k) for k in np.flatnonzero(size > limit) if abs(_level_change(v, int(k))) > 0.6 * limit]
        if places:
            found[run.id] = places
    return found


def _beside(S: np.ndarray, channels: tuple[int, ...]) -> np.ndarray:
    """Difference (samples - 1,) of each step of the record from the nearer of its neighbouring steps; 0 at the ends."""
    d = np.diff(S[:, list(channels)], axis=0)
    off = np.minimum(*(np.linalg.norm(d[1:-1] - other, axis=1) for other in (d[:-2], d[2:])))
    return np.concatenate([[0.0], off, [0.0]])


def _steps(v: np.ndarray, S: np.ndarray, channel: int) -> np.ndarray:
    """Sizes (samples - 1,) of the steps; 0 after a repeated sample, where a sensor that stood still catches up."""
    held = np.concatenate([[False], S[1:-1, channel] == S[:-2, channel]])
    return np.where(held | (S[1:, channel] == S[:-1, channel]), 0.0, np.abs(np.diff(v)))


def _level_change(v: np.ndarray, k: int) -> complex:
    """Median of four samples after step k less that of four before."""
    before, after = v[max(0, k - 3) : k + 1], v[k + 1 : k + 5]
    change = complex(np.median(after.real) - np.median(before.real), np.median(after.imag) - np.median(before.imag))
    return change


def _jump(
    recording: Recording, channels: tuple[int, ...], at: dict[str, list[int]], levels: dict[str, np.ndarray]
) -> Finding:
    """Finding on the jumps (run id -> last sample before each) of position or heading in all runs."""
    runs = {run.id: run for run in recording.runs}
    sizes = {
        (name, k): float(abs(levels[name][k + 1] - levels[name][k])) for name, places in at.items() for k in places
    }
    names = recording.names(runs[r] for r in at)
    name, k = max(sizes, key=lambda place: sizes[place])
    run, v, keys, unit = runs[name], levels[name], tuple(STATES[c] for c in channels), "m" if X in channels else "rad"
    text = (
        f"{', '.join(keys)} jump{'s' * (len(keys) == 1)} {times(len(sizes), len(names))} ({some(names)}); "
        f"the greatest by {sizes[name, k]:.3g} {unit}, from {run.t[k]:g} s to {run.t[k + 1]:g} s of "
        f"'{recording.name_of(run)}'."
    )
    cuts: dict[str, dict[str, list[list[float]]]] = {}
    for other, i in sizes:
        t = float(runs[other].t[i + 1])
        cuts.setdefault(recording.name_of(runs[other]), {"cut": []})["cut"].append([t, t])
    part = slice(max(0, k - 20), k + 22)
    curves = tuple(
        Curve(STATES[c], run.t[part], f(v)[part] - f(v)[part][0], ".-")
        for c, f in zip(channels, (np.real, np.imag), strict=False)
    )
    picture = Picture(
        f"{', '.join(keys)} less the integral of its rate, run {recording.name_of(run)}",
        "time [s]",
        f"[{unit}]",
        curves,
    )
    figures = {"greatest": sizes[name, k], "jumps": len(sizes)}
    return Finding(
        "spikes", "warning", "jump", text, toml_line({"runs": cuts}), "", keys, tuple(cuts), figures, picture
    )


CHECK = check
