"""The diagnosis: from a data set to a verdict with its evidence, its size and what it is worth."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import dataclass
from functools import partial
from multiprocessing import get_context

import numpy as np
from threadpoolctl import threadpool_limits

from ..checking.standing import standing
from ..checking.units import check_units, corrected, merged
from ..errors import InputError
from ..records import Dataset
from . import misread
from .analysis import HULL_THRESHOLD, THRESHOLD, Analysis, analyse, causes_of, plain_model
from .causes import describe_candidates, describe_causes, remaining, unknown_part, what_is_left
from .clocks import NAMES, check_clocks
from .derived import faults, has_speeds, marked, said
from .felt_wind import with_true_wind
from .fit import Fit
from .gain import FoldGain, fold_gain, summarise
from .model import NUM_BASE, PLACES
from .ordinary import STRANGE, needed
from .other_size import better_size
from .outcome import Diagnosis, Gain
from .over_ground import over_ground
from .plant import FOLD_STEPS, MOST_STEPS, THOROUGH_STEPS, Plant
from .strange import left_out
from .trace import trace_of
from .turned import turned_actuators
from .wrong import what_is_wrong

FOLDS = 5
FEW_RUNS, FEW_SAMPLES = 5, 300
STRANGE_SUM, STRANGE_SIZE = 160.0, 3.0
"""Sum of squares of the fit's parameters, in units of what ships differ by, beside the causes; and the size of a cause in typical sizes.
(Sums with right ship files: 15 to 63 on MMG ships, up to 148 on ships of the literature and on the Esso Osaka; with wrong ones from 18 on; what
is not seen here may be seen by `better_size`.)"""
ORDINARY_SUM = 20.0
"""Sum of squares below which no other size is tried, which takes as long as the first fit. (With the files of ships of less than 0.6 or more than 1.7
times the length: 22 and more.)"""
_MOST = 100.0
STRANGE_THRUST = 4.0
"""Of the thrust the fit asks for, in units of what the ship file leaves open of it (of kt a factor of 1.2, of the diameter 2.2 besides)."""
ODD_THRUST = 1.3
"""Factor of the thrust of an estimated propeller from which it is spoken of."""
NOT_A_MODEL = ("unit_or_sign_error", "change_point")
"""They describe the data, not the ship: correct the data, or fit the runs before and after the change apart."""


@threadpool_limits.wrap(limits=1)  # its matrices are small: the threads of two processes on two cores wait for each other (24 runs: 81 s, now 36 s)
def diagnose(
    dataset: Dataset, *, gain: bool = True, seed: int = 0, only: Sequence[str] | None = None, workers: int = 1, thorough: bool = False
) -> Diagnosis:
    """Show what the plain physics model gets wrong on measured runs, name the causes, and measure what naming them is worth.

    Args:
        gain: cross-validate (everything is repeated on every training part); without, gains are None, and the hull is not named: that it lies off
            the regressions is named only where fitting it pays on runs that were not fitted.
        seed: of the bootstrap and of the folds.
        only: effects to consider (an oracle that knows what is hidden); default all.
        workers: processes for the folds; from two on, a script that calls this needs `if __name__ == "__main__":`.
        thorough: use up to twice as much of a long record (the folds use half); 90 runs of 120 s are used whole either way.

    Raises:
        InputError: the ship never moves, there are too few samples for any fit, or `workers` is less than one.
    """
    if workers < 1:
        raise InputError(f"workers: {workers}; accepted: whole numbers from 1.")
    began, fingerprint = time.perf_counter(), dataset.fingerprint
    warnings = _check(dataset)
    units = check_units(dataset) if only is None else []
    dataset = corrected(dataset, units)
    dataset, drift = over_ground(marked(dataset)) if only is None else (dataset, [])
    dataset, wind = with_true_wind(dataset) if only is None else (dataset, [])
    dataset = _in_time(dataset)
    late = check_clocks(dataset) if only is None and has_speeds(dataset) else None
    if late is not None:
        dataset = late.mended
    settled = (*(NAMES if late is not None else ()), *faults(dataset))
    steps = THOROUGH_STEPS if thorough else MOST_STEPS
    cautious = len(dataset) < FEW_RUNS or sum(map(len, dataset.runs)) < FEW_SAMPLES
    apart = len({run.group for run in dataset.runs}) > 1
    if not apart and len(dataset) > 1:
        warnings.append("all runs are one group (pieces of one log, say): no gain can be measured on runs that are held out.")
    wanted = gain and apart and not cautious
    work = partial(_one_fold, dataset=dataset, seed=seed, only=only, settled=settled)
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) if wanted and workers > 1 else nullcontext() as pool:
        # the first part is fitted beside the whole, which takes longer: the other cores would be idle until it is known whether anything is measured
        ahead = pool.submit(work, 0, THRESHOLD, True) if pool and only is None else None
        null = plain_model(Plant.of(dataset, steps), only, settled)
        if only is None and not cautious and (turned := turned_actuators(dataset, null)):
            units, dataset = merged([*units, *turned]), corrected(dataset, turned)
            null = plain_model(Plant.of(dataset, steps), settled=settled)
            ahead, work = None, partial(_one_fold, dataset=dataset, seed=seed, only=only, settled=settled)
        found = analyse(null, only=only, seed=seed, cautious=cautious)
        if wrong := [e for e in found.misread if e.contradicted]:
            dataset = misread.read_rightly(dataset, wrong)
            found = analyse(plain_model(Plant.of(dataset, steps), settled=settled), seed=seed, misread=wrong)
            ahead, work = None, partial(_one_fold, dataset=dataset, seed=seed, only=only, settled=settled)
        doubts = _doubts(found) if only is None else []
        worth = _cross_validated(dataset, found, seed, work, pool, ahead) if wanted and not doubts else Worth()
    warnings += [text for text, _ in standing(dataset).values()]
    warnings += said(dataset) + drift + wind + doubts + _own_propeller(found) + left_out(found.selection.null.plant, dataset.runs)
    warnings += misread.said(found.misread)
    causes = describe_causes(found, units, late, worth.gain, worth.hull, bool(doubts), [r.id for r in dataset.runs])
    warnings += [f"change_point: {c.evidence}. Fit the runs before and from there apart." for c in causes if c.effect == "change_point"]
    warnings += what_is_left(found) if causes and not doubts else []
    trace = trace_of(dataset, found, worth.hull)
    unknown = (bool(doubts) and not causes) or (found.unknown is not None and not units)
    verdict = "unknown" if unknown else "found" if causes else "none"
    names = [c.effect for c in causes if c.effect not in NOT_A_MODEL]
    return Diagnosis(
        dataset=dataset.name, verdict=verdict, causes=tuple(causes),
        candidates=tuple(describe_candidates(found, [c.effect for c in causes], worth.gain is not None)),
        what_is_wrong=what_is_wrong(trace), unexplained_after=remaining(found), extended_model="+".join(["physics", *names]),
        fingerprint=fingerprint, seconds=time.perf_counter() - began, warnings=tuple(warnings), gain=worth.gain if causes else None,
        unknown=unknown_part(found), gain_per_run=worth.per_run if causes else (), trace=trace,
    )  # fmt: skip


@dataclass(frozen=True)
class Worth:
    """Held-out gain, ED of every run before and after [m], and whether the hull's derivatives are worth naming."""

    gain: Gain | None = None
    per_run: tuple[tuple[str, float, float], ...] = ()
    hull: bool = False


def _runs(dataset: Dataset) -> str:
    return "1 run" if len(dataset) == 1 else f"{len(dataset)} runs"


def _check(dataset: Dataset) -> list[str]:
    """Refuse what cannot be fitted; warn of what cannot be trusted."""
    samples = sum(len(r) for r in dataset.runs)
    if samples < 20:
        raise InputError(
            f"data set '{dataset.name}' has {samples} samples in {_runs(dataset)}; a diagnosis needs at least 20, better 24 runs of 120 s."
        )
    states = np.concatenate([r.states for r in dataset.runs])
    L = dataset.ship.L
    if np.max(np.hypot(states[:, 3], states[:, 4])) < 0.01 * L**0.5:
        raise InputError(
            f"data set '{dataset.name}': the ship never moves faster than {0.01 * L**0.5:.2f} m/s; check the columns u and v and their units."
        )
    warnings = []
    if len(dataset) < FEW_RUNS or samples < FEW_SAMPLES:
        warnings.append(
            f"{_runs(dataset)} and {samples} samples are too few to name a cause (at least {FEW_RUNS} runs and {FEW_SAMPLES} samples): "
            "candidates are ranked, none is named."
        )
    if np.std(states[:, 7]) < 1e-3 and np.std(states[:, 5]) < 1e-5:
        warnings.append("the rudder is never used and the ship never turns: nothing can be said about rudder and hull.")
    return warnings


def _doubts(found: Analysis) -> list[str]:
    """Signs that the model does not belong to the data: the fit leaves what is ordinary, hull or propeller would be another ship's, or a ship of
    another size explains the runs better. Causes in whose place something unknown is told raise none."""
    fit = found.final if found.unknown is None else found.selection.null
    z = needed(fit)
    signs = []
    if np.max(np.abs(z)) > STRANGE or np.sum(z**2) > STRANGE_SUM:
        largest, together = (f"more than {_MOST:.0f}" if x > _MOST else f"{x:.1f}" for x in (np.max(np.abs(z)), np.sum(z**2) ** 0.5))
        signs.append(f"the fit moves a parameter by {largest} times its ordinary spread (all together {together} times)")
    if abs(z[PLACES["log_thrust"]]) > STRANGE_THRUST:
        signs.append(f"the propeller would have to give {_thrust_factor(fit):.2g} times the thrust that the ship file makes likely")
    for term, value in zip(fit.model.terms, fit.values, strict=True):
        if term.effect.family in ("hull", "propulsion") and np.max(np.abs(value)) > STRANGE_SIZE:
            signs.append(f"{term.label} would have to be {np.max(np.abs(value)):.1f} times its typical size")
    if not signs and np.sum(z**2) > ORDINARY_SUM:
        signs = better_size(found.selection.null)
    if not signs:
        return []
    text = "; ".join(signs)
    return [
        f"{text}. Is the ship file that of this ship (L, B, T, displacement, propeller, rudder, units)? Until that is sure, nothing is named but "
        "what shows whatever the ship is (faults of sensors, delay and play of gears seen in their own record, those slow for any ship, and forces "
        "that know port from starboard or a direction of the earth, with their sizes on the ship of the file); the candidates below are ranked as "
        "if it were."
    ]


def _own_propeller(found: Analysis) -> list[str]:
    """What the runs say of a propeller that the ship file leaves open."""
    factor, ship = _thrust_factor(found.final), found.final.plant.ship
    if max(factor, 1.0 / factor) < ODD_THRUST:
        return []
    what = "diameter, kt" if ship.lacks("propeller") else "kt"
    return [
        f"the ship file does not give the propeller's {what}: the runs suggest {factor:.2g} times the thrust of the estimate, by which the model "
        f"`physics` goes; give [propeller] {what}. Causes are judged with the thrust that suits the runs."
    ]


def _thrust_factor(fit: Fit) -> float:
    at = PLACES["log_thrust"]
    return float(np.exp(fit.scales.structure[at - NUM_BASE] * fit.solution.mean[at]))


def _in_time(dataset: Dataset) -> Dataset:
    """Runs in the order in which they were sailed, where all say when they began: a change begins with one of them."""
    began = {run.id: run.began for run in dataset.runs}
    known = {name: moment for name, moment in began.items() if moment is not None}
    return dataset.with_runs(sorted(dataset.runs, key=lambda run: known[run.id])) if len(known) == len(began) else dataset


@threadpool_limits.wrap(limits=1)  # a process of its own
def _one_fold(
    fold: int, threshold: float, hull: bool, *, dataset: Dataset, seed: int, only: Sequence[str] | None, settled: Sequence[str]
) -> FoldGain:
    """Selection and fits on the training part of one fold."""
    test = _folds(dataset, seed)[fold]
    train = [r for i, r in enumerate(dataset.runs) if i not in set(test.tolist())]
    plant = Plant.of(dataset.with_runs(train), FOLD_STEPS)
    extension, plain = causes_of(plant, threshold, only, settled)
    return fold_gain(dataset, test, extension, plain, hull)


def _folds(dataset: Dataset, seed: int) -> list[np.ndarray]:
    """Places of the runs of each fold: groups in random order, whole, each where its middle run falls among equal parts."""
    members: dict[str, list[int]] = {}
    for i, run in enumerate(dataset.runs):
        members.setdefault(run.group, []).append(i)
    groups = [*members.values()]
    groups = [groups[i] for i in np.random.default_rng(seed).permutation(len(groups))]
    size = np.array([len(g) for g in groups])
    part = np.repeat(np.arange(FOLDS), [len(p) for p in np.array_split(np.arange(len(dataset)), FOLDS)])[np.cumsum(size) - 1 - size // 2]
    return [np.sort(np.concatenate([g for g, k in zip(groups, part, strict=True) if k == fold])) for fold in np.unique(part)]


def _cross_validated(
    dataset: Dataset, found: Analysis, seed: int, work: Callable[..., FoldGain], pool: Executor | None, ahead: Future[FoldGain] | None
) -> Worth:
    """Held-out gain of the causes, and of the hull's derivatives beside them; ahead: the first part, as it is with the usual threshold."""
    hull = found.hull > HULL_THRESHOLD
    if not (found.final.model.terms or found.gears or hull) or found.unknown is not None:
        return Worth()
    ready = [ahead] if ahead is not None and found.threshold == THRESHOLD else []
    rest = range(len(ready), len(_folds(dataset, seed)))
    parts = list((pool.map if pool else map)(partial(work, threshold=found.threshold, hull=hull), rest))
    parts += [part.result() for part in ready]
    before, after, with_hull = (np.zeros(len(dataset)) for _ in range(3))
    for part in parts:
        before[part.test], after[part.test], with_hull[part.test] = part.before, part.after, part.with_hull
    groups = [run.group for run in dataset.runs]
    name_hull = hull and summarise(after, with_hull, seed, groups).ci95[0] > 0.0
    if name_hull:
        after = with_hull
    rows = tuple((run.id, float(b), float(a)) for run, b, a in zip(dataset.runs, before, after, strict=True))
    return Worth(summarise(before, after, seed, groups), rows, name_hull)
