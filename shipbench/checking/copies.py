"""Check for runs that hold the same samples as another (copies, parts), and runs that continue another: neither may
straddle a fold.

Windows of rounded samples of u, v, r are hashed, so that the cost grows with the number of samples and shifted
positions do not hide a copy.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from ..records import Run
from ..signals import PSI, R, U, V, X, Y
from .finding import Curve, Finding, Picture, toml_line
from .recording import Recording
from .statistics import some, spread, stretches
from .thresholds import THRESHOLDS

_WINDOW = 8
"""Samples of a hashed window, fewer than `copied_samples`."""


def _hashes(run: Run, size: np.ndarray) -> np.ndarray:
    """Hash (windows,), 64 bits, of each window of samples; 0 for windows in which nothing changes (ships at rest are
    all alike)."""
    rounded = np.round(run.states[:, [U, V, R]] / size).astype(np.int64).astype(np.uint64)
    with np.errstate(over="ignore"):
        sample = (
            rounded * np.array([0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9], dtype=np.uint64)
        ).sum(axis=1, dtype=np.uint64)
        sample ^= sample >> np.uint64(29)
        windows = np.lib.stride_tricks.sliding_window_view(sample, _WINDOW)
        weights = np.array([pow(0x100000001B3, i, 2**64) for i in range(_WINDOW)], dtype=np.uint64)
        hashes = (windows * weights).sum(axis=1, dtype=np.uint64)
    still = np.all(windows == windows[:, :1], axis=1)
    return np.where(still, np.uint64(0), hashes)


def overlaps(recording: Recording) -> dict[tuple[int, int], tuple[int, int]]:
    """Pairs (i, j) of runs, i < j -> (equal samples, start of the equal part in i less that in j)."""
    runs = [(i, run) for i, run in enumerate(recording.runs) if len(run) >= _WINDOW]
    if len(runs) < 2:
        return {}
    S = np.concatenate([run.states[:, [U, V, R]] for _, run in runs])
    floor = 1e-9 * np.max(np.abs(S), axis=0) + 1e-12  # of a channel that never changes, too
    size = np.maximum(S.std(axis=0) * THRESHOLDS.value("equal_within"), floor)
    hashes = [(i, _hashes(run, size)) for i, run in runs]
    value = np.concatenate([h for _, h in hashes])
    owner = np.concatenate([np.full(len(h), i) for i, h in hashes])
    place = np.concatenate([np.arange(len(h)) for _, h in hashes])
    order = np.argsort(value, kind="stable")
    value, owner, place = value[order], owner[order], place[order]
    same = np.flatnonzero(
        (value[1:] == value[:-1]) & (value[1:] != 0) & (owner[1:] != owner[:-1])
    )  # neighbours: copies of copies chain up
    pairs = np.column_stack([owner[same], owner[same + 1], place[same] - place[same + 1]])
    found: dict[tuple[int, int], tuple[int, int]] = {}
    for (a, b, shift), count in zip(*np.unique(pairs, axis=0, return_counts=True), strict=True):
        i, j, offset = (int(a), int(b), int(shift)) if a < b else (int(b), int(a), -int(shift))
        samples = int(count) + _WINDOW - 1
        if samples >= THRESHOLDS.count("copied_samples") // 2 and samples > found.get((i, j), (0, 0))[0]:
            found[i, j] = (samples, offset)
    alike = {
        pair: (_alike(recording.runs[pair[0]], recording.runs[pair[1]], offset, size), offset)
        for pair, (_, offset) in found.items()
    }
    return {pair: part for pair, part in alike.items() if part[0] >= THRESHOLDS.count("copied_samples")}


def _alike(a: Run, b: Run, offset: int, size: np.ndarray) -> int:
    """Number of samples that are equal to rounding where `a` begins `offset` samples before `b` (a hash breaks where
    rounding falls on an edge).

    0 where no unbroken part of them holds enough changes: coarsely quantised records agree here and there by chance.
    """
    i, j = max(offset, 0), max(-offset, 0)
    n = min(len(a) - i, len(b) - j)
    mine, other = a.states[i : i + n, [U, V, R]], b.states[j : j + n, [U, V, R]]
    same = np.all(np.abs(mine - other) <= 2.0 * size, axis=1)
    changes = np.any(np.abs(np.diff(mine, axis=0)) > 2.0 * size, axis=1)
    most = max((int(changes[start : stop - 1].sum()) for start, stop in stretches(same)), default=0)
    return int(same.sum()) if most >= THRESHOLDS.count("copied_samples") - 1 else 0


def check(recording: Recording) -> list[Finding]:
    """Find copies and parts, then logs that were cut; runs that share a group already are not reported. All connected
    runs get one group."""
    shared = {pair: part for pair, part in overlaps(recording).items() if _apart([recording.runs[i] for i in pair])}
    chains = [chain for chain in _chains(recording) if _apart(chain) and not _cut_by_import(chain)]
    families = _families(recording, [*([recording.runs[i] for i in pair] for pair in shared), *chains])
    together: dict[tuple[str, ...], list[tuple[int, int]]] = {}
    for pair in shared:
        together.setdefault(families[recording.name_of(recording.runs[pair[0]])], []).append(pair)
    return [_cluster(recording, pairs, shared, families) for pairs in together.values()] + [
        _log(recording, chain, families) for chain in chains
    ]


def _apart(runs: list[Run]) -> bool:
    return len({run.group for run in runs}) > 1


def _cut_by_import(chain: list[Run]) -> bool:
    """Whether the runs are windows that import cut from one recording, as its description states: their owner chose
    so."""
    files = {run.meta.file for run in chain}
    return len(files) == 1 and None not in files and all(None not in (run.meta.from_, run.meta.to) for run in chain)


def _cluster(
    recording: Recording,
    pairs: list[tuple[int, int]],
    shared: dict[tuple[int, int], tuple[int, int]],
    families: dict[str, tuple[str, ...]],
) -> Finding:
    """Finding on runs that share samples with one another, with the pair that shares most."""
    i, j = max(pairs, key=lambda pair: shared[pair][0])
    finding = _copy(recording, (i, j), shared[i, j], families)
    names = recording.names(recording.runs[k] for k in sorted({k for pair in pairs for k in pair}))
    if len(names) == len(finding.runs):
        return finding
    text = f"{len(names)} runs share samples with one another ({some(names)}). The most: {finding.text}"
    kind = finding.kind if len({_kind(recording, pair, shared[pair]) for pair in pairs}) == 1 else "overlapping runs"
    return replace(finding, kind=kind, text=text, runs=names, evidence={**finding.evidence, "runs": len(names)})


def _families(recording: Recording, sets: list[list[Run]]) -> dict[str, tuple[str, ...]]:
    """Names of all runs that are connected with a run by these sets and by the given groups, in the order of the data
    set, by name."""
    family: dict[str, set[str]] = {}
    given: dict[str, list[Run]] = {}
    for run in recording.runs:
        given.setdefault(run.group, []).append(run)
    for runs in [*given.values(), *sets]:
        names = set(recording.names(runs)).union(*(family.get(recording.name_of(run), ()) for run in runs))
        family |= dict.fromkeys(names, names)
    order = recording.names(recording.runs)
    return {name: tuple(n for n in order if n in names) for name, names in family.items()}


def _lines(family: tuple[str, ...]) -> str:
    return toml_line({"runs": {name: {"group": family[0]} for name in family}})


def _kind(recording: Recording, pair: tuple[int, int], part: tuple[int, int]) -> str:
    longest, shortest = sorted((len(recording.runs[i]) for i in pair), reverse=True)
    whole = part[0] / 0.98  # the ends of a copy may differ
    return "duplicate run" if whole >= longest else "piece of a run" if whole >= shortest else "overlapping runs"


def _copy(
    recording: Recording, pair: tuple[int, int], part: tuple[int, int], families: dict[str, tuple[str, ...]]
) -> Finding:
    a, b = (recording.runs[i] for i in pair)
    samples, offset = part
    names = (recording.name_of(a), recording.name_of(b))
    longer, shorter = (a, b) if len(a) >= len(b) else (b, a)
    start = offset if longer is a else -offset
    kind = _kind(recording, pair, part)
    if kind == "duplicate run":
        text = f"runs '{names[0]}' and '{names[1]}' hold the same {samples} samples"
    elif kind == "piece of a run":
        where = max(start, 0) * recording.dt
        text = (
            f"run '{recording.name_of(shorter)}' ({samples} samples) is a piece of '{recording.name_of(longer)}' "
            f"({len(longer)} samples), from "
            f"{where:g} s to {where + (samples - 1) * recording.dt:g} s of it"
        )
    else:
        text = f"runs '{names[0]}' ({len(a)} samples) and '{names[1]}' ({len(b)}) share {samples} samples"
    i, j = max(offset, 0), max(-offset, 0)
    n = min(len(a) - i, len(b) - j)
    t = np.arange(n) * recording.dt
    picture = Picture("u of both runs in the part that they share", "time [s]", "u [m/s]", (
        Curve(names[0], t, a.states[i : i + n, U], "-"), Curve(names[1], t, b.states[j : j + n, U], "--"),
    ))  # fmt: skip
    return Finding(
        "copies", "error", kind, f"{text}: one in training and the other in test would leak.",
        _lines(families[names[0]]), "Or remove one of them.",
        runs=names, evidence={"samples": samples}, picture=picture,
    )  # fmt: skip


def _chains(recording: Recording) -> list[list[Run]]:
    """Chains of runs, each of which continues the one before."""
    runs = [run for run in recording.runs if len(run) >= 4]
    after = {i: j for i in range(len(runs)) if (j := _next(recording, runs, i)) is not None}
    starts = set(after) - set(after.values())
    found = []
    for start in sorted(starts):
        chain = [start]
        while chain[-1] in after and after[chain[-1]] not in chain:
            chain.append(after[chain[-1]])
        found.append([runs[i] for i in chain])
    return found


def _next(recording: Recording, runs: list[Run], i: int) -> int | None:
    """Index of the run that begins where run i ends, within a few samples: state extrapolated by its rates, to within
    noise and a sample's change."""
    end, dt = runs[i].states[-1], recording.dt
    rates = end[[U, V]] @ np.array([[np.cos(end[PSI]), np.sin(end[PSI])], [-np.sin(end[PSI]), np.cos(end[PSI])]])
    noise = _noise(recording)
    best, nearest = None, np.inf
    at_rest = THRESHOLDS.value("speed_at_rest") * (9.81 * recording.dataset.ship.L) ** 0.5
    if np.hypot(end[U], end[V]) < max(0.1 * recording.speed, at_rest):
        return None  # many runs end and begin at rest at one berth
    for j, run in enumerate(runs):
        S = run.states[0]
        if j == i or abs(S[X] - end[X]) > 3.0 * noise[0] + 5.0 * dt * recording.speed + 1e-9:
            continue
        for steps in (1, 2, 3, 0):
            off = S[[X, Y]] - end[[X, Y]] - rates * steps * dt
            turned = (S[PSI] - end[PSI] - end[R] * steps * dt + np.pi) % (2.0 * np.pi) - np.pi
            error = np.array([np.hypot(*off), abs(turned), abs(S[U] - end[U]), abs(S[V] - end[V]), abs(S[R] - end[R])])
            worst = float(np.max(error / noise))
            if worst < 1.0 and worst < nearest:
                best, nearest = j, worst
    return best


def _noise(recording: Recording) -> np.ndarray:
    """Tolerances (5,) of position, heading, u, v, r: six standard deviations of the change of slope within runs; of the
    rates a tenth of the typical value."""
    second = np.concatenate(
        [run.states[2:] - 2.0 * run.states[1:-1] + run.states[:-2] for run in recording.runs if len(run) >= 4]
    )
    own = THRESHOLDS.value("beyond_noise") * np.array(
        [np.hypot(spread(second[:, X]), spread(second[:, Y])), *(spread(second[:, c]) for c in (PSI, U, V, R))]
    )
    step, turn = recording.speed * recording.dt, recording.turning * recording.dt
    return np.maximum(
        own, [0.6 * step, 0.6 * turn, 0.1 * recording.speed, 0.1 * recording.speed, 0.1 * recording.turning]
    )


def _log(recording: Recording, pieces: list[Run], families: dict[str, tuple[str, ...]]) -> Finding:
    names = recording.names(pieces)
    gaps = [float(b.t[0] - a.t[-1]) for a, b in pairwise(pieces)]
    clock = f", {min(gaps):g} to {max(gaps):g} s later by their own t" if min(gaps) > 0.0 else ""
    text = (
        f"runs {some(names, 8)} follow one another: each begins where the one before ends{clock}. They are "
        "pieces of one log."
    )
    family = families[names[0]]
    alone = len(family) == len(recording.runs)
    todo = (
        "Nothing: it is the only log, and as one group nothing of it could be held out. What is held out has the "
        "same day, weather and load."
    )
    curves = tuple(Curve(recording.name_of(run), run.states[:, Y], run.states[:, X]) for run in pieces)
    return Finding(
        "copies", "note" if alone else "warning", "pieces of one log", text, "" if alone else _lines(family),
        todo if alone else "", runs=names,
        evidence={"pieces": len(pieces)}, picture=Picture("Tracks", "y [m]", "x [m]", curves),
    )  # fmt: skip


CHECK = check
