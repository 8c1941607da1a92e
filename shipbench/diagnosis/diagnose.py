"""Diagnosis of a data set: a verdict with its evidence, effect sizes and held-out gain."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future
from contextlib import nullcontext
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from threadpoolctl import threadpool_limits

from ..checking.standing import standing
from ..checking.units import UnitFinding, corrected
from ..effects.base import EFFECTS, searched_by
from ..errors import InputError, option
from ..estimation.budget import Budget, is_spent, limited
from ..estimation.forward import FOLD_STEPS, MOST_STEPS, THOROUGH_STEPS, Plant, least_depth
from ..estimation.gauss_newton import Fit
from ..estimation.noise_selection import noise_in_words
from ..estimation.outliers import left_out
from ..predictors.physics_model.correction import correctable
from ..processes import process_pool
from ..records import Dataset
from ..specs import Spec
from ..steps import step, within
from .candidates import describe_candidates
from .evaluation.held_out_gain import FoldErrors, fold_errors, of_runs, on_fitted_runs, summarise
from .evaluation.moved import moved
from .evaluation.noise_floor import noise_floor
from .evaluation.own_simulation import Judged, OwnSimulation, its_own, simulation_fold_errors
from .evaluation.residuals import what_is_wrong
from .evaluation.series import trace_of
from .explain import describe_causes, remaining, unknown_part, what_is_left
from .preparation import actuator_readings as misread
from .preparation.actuator_signs import turned_actuators
from .preparation.base import prepare
from .preparation.passes import GIVEN, PASSES
from .preparation.plant import plant_of
from .preparation.record_errors import joined
from .preparation.splitting import is_too_little
from .preparation.time_offsets import ruled_out
from .result import Calibrated, Cause, Diagnosis, Gain
from .selection.analysis import HULL_THRESHOLD, THRESHOLD, Analysis, analyse, causes_of, plain_model
from .selection.ship_file import doubts_of, odd_for, own_propeller
from .thresholds import THRESHOLDS

_WHOLE = 0.2
"""Share of the time for the baseline model of all runs, and for the search, where the gain is measured (progress)."""


@threadpool_limits.wrap(limits=1)  # its matrices are small: threads of several processes would wait for each other
def diagnose(
    dataset: Dataset, *, gain: bool = True, seed: int = 0, only: Sequence[str] | None = None, workers: int = 1,
    thorough: bool = False,
    budget: Budget | None = None, simulation: Spec | None = None,
) -> Diagnosis:  # fmt: skip
    """Identify the causes of the plain physics model's errors on measured runs, and measure their held-out gain.

    Args:
        gain: cross-validate (everything is repeated on every training part); without, gains are None, and the hull is
            not named: its difference from the regressions is named only where fitting it improves held-out runs.
        seed: of the bootstrap and of the folds.
        only: effects to consider (an oracle that knows the hidden causes); default all.
        workers: processes for the folds; 1: everything runs in this one.
        thorough: use up to twice as much of a long record (the folds use a quarter); 90 runs of 120 s are used whole
            either way.
        budget: limits of work and memory of the whole; default that of `Budget`. A warning states where it has acted.
        simulation: model that is judged in place of the ship file's physics; see `evaluation.own_simulation`.

    Raises:
        InputError: the ship never moves, there are too few samples for any fit, the record contradicts itself,
            `workers` is less than one, or it would take too much memory.
        WorkError: a process of the folds was ended.
    """
    if workers < 1:
        raise InputError(f"workers: {workers}; accepted: whole numbers from 1.")
    with limited(budget or Budget()) as used:
        steps = THOROUGH_STEPS if thorough else MOST_STEPS
        try:
            return _diagnosed(dataset, gain, seed, only, workers, steps, used, simulation)
        except np.linalg.LinAlgError as error:
            if simulation is None:
                raise
            raise InputError(
                f"the accelerations of the simulation '{simulation.text}' are too far from those of a ship to be "
                f"diagnosed ({error}). Score it first: shipbench run --model {simulation.text} --model hold"
            ) from error


def _diagnosed(
    dataset: Dataset, gain: bool, seed: int, only: Sequence[str] | None, workers: int, steps: int, used: Budget,
    judged: Spec | None,
) -> Diagnosis:  # fmt: skip
    """Diagnosis within a budget that is counted, see `diagnose`."""
    step("read the record", 0.0, 0.02)
    began, fingerprint = time.perf_counter(), dataset.fingerprint
    ready = prepare(dataset, PASSES if only is None else GIVEN)
    dataset, units, settled, warnings = ready.dataset, list(ready.errors), ready.excluded, list(ready.notes)
    simulation = None if judged is None else OwnSimulation(judged, dataset)
    if simulation is not None:
        step("step the simulation from every measured state", 0.01, 0.02)
        dataset, settled = simulation.beside(dataset), (*settled, *its_own())
    cautious = is_too_little(dataset)
    apart = len({run.group for run in dataset.runs}) > 1
    if not apart and len(dataset) > 1:
        warnings.append(
            "all runs are one group (pieces of one log, say): no gain can be measured on runs that are held out."
        )
    wanted = gain and apart and not cautious
    whole, folds = _WHOLE if wanted else 0.48, THRESHOLDS.count("folds")
    work = partial(
        _one_fold,
        dataset=dataset,
        seed=seed,
        only=only,
        settled=settled,
        budget=used.part(folds),
        simulation=simulation,
    )
    alone = f"Fit all here: {option('--workers 1', 'workers=1')}."
    several = wanted and workers > 1 and (judged is None or judged.given is None)
    with process_pool(workers, alone) if several else nullcontext() as pool:
        # the first part is fitted beside the whole, which takes longer: the other cores would be idle until it is known
        # whether anything is measured
        ahead = pool.submit(work, 0, THRESHOLD) if pool and only is None else None
        step("fit the plain model", 0.02, whole)
        null = plain_model(plant_of(dataset, steps), only, settled)
        step("look for causes", whole, 2.0 * whole)
        rests = not is_spent()
        if only is not None or cautious or not rests or simulation is not None:
            found = analyse(null, only=only, seed=seed, cautious=cautious or not rests)
            found = found if simulation is None else replace(found, gears=())
        else:
            as_recorded = dataset
            found, dataset, turned, no_cause = _as_it_must_be_read(dataset, null, steps, settled, seed)
            units = joined([*units, *turned])
            if dataset is not as_recorded or no_cause != settled:
                ahead, work = None, partial(work, dataset=dataset, settled=no_cause)
        by_file = only is None and simulation is None
        doubts = doubts_of(found, simulation is not None) if only is None and rests else []
        share = used.part(folds)
        worth = Worth()
        if wanted and not is_spent():
            worth = _cross_validated(dataset, found, bool(doubts), seed, partial(work, budget=share), pool, ahead)
    lines = warnings + used.said(nothing=not rests) + list(worth.told)
    lines += [text for text, _ in standing(dataset).values()] + _of_depth(dataset, null.plant) + doubts
    lines += (
        (own_propeller(found) if by_file else [])
        + left_out(found.selection.null.plant, dataset.runs)
        + misread.said(found.misread)
    )
    causes = describe_causes(
        found, units, ready.late, worth.gain, worth.own if worth.hull else None, bool(doubts),
        [r.id for r in dataset.runs],
    )  # fmt: skip
    changes = {e.name for e in searched_by("change")}
    lines += [
        f"{c.effect}: {c.evidence} Fit the runs before it and from it on separately."
        for c in causes
        if c.effect in changes
    ]
    behind = _behind_its_record(found, causes)
    lines += [f"{name}: {text}" for name, text in behind.items()]
    lines += what_is_left(found) if causes and not doubts else []
    lines += odd_for(found, [c.effect for c in causes]) if by_file and not doubts else []
    step("predict every run", 0.96, 1.0)
    of_all = None if simulation is None else Judged.of(dataset, simulation, [c.effect for c in causes])
    lines += [] if of_all is None else of_all.alone.said(dataset.ship)
    trace = trace_of(dataset, found, None if of_all is None else (of_all.alone.motion, of_all.corrected.motion))
    unknown = (bool(doubts) and not causes) or (found.unknown is not None and not units)
    verdict = "unknown" if unknown else "found" if causes else "none"
    own = worth.calibration or (_on_fitted(dataset, simulation, of_all, found, seed) if rests else None)
    if own is not None:
        differs = moved(found.selection.null if unknown else found.final, causes)
        own = replace(own, moved=differs, noise_floor=noise_floor(dataset, found.selection.null, seed))
    gained = worth.own if worth.hull and len(causes) == 1 else worth.gain
    proposed = _proposed([c.effect for c in causes if c.effect not in behind], own) if judged is None else judged.text
    return Diagnosis(
        dataset=dataset.name, verdict=verdict, causes=tuple(causes),
        candidates=tuple(describe_candidates(found, [c.effect for c in causes], worth.own is not None)),
        what_is_wrong=what_is_wrong(trace),
        unexplained_after=remaining(found) | {"taken_as_noise": noise_in_words(found.final)},
        extended_model=proposed, fingerprint=fingerprint, seconds=time.perf_counter() - began,
        warnings=tuple(lines), gain=gained if causes else None, unknown=unknown_part(found),
        gain_per_run=worth.per_run if causes else (), trace=trace,
        calibration=own, simulation="" if judged is None else judged.text,
        correction=None if of_all is None else of_all.correction,
    )  # fmt: skip


@dataclass(frozen=True)
class Worth:
    """Errors on held-out runs as statements.

    Attributes:
        calibration: errors of the ship file's model and of the calibrated ship.
        gain: of the causes beside the calibrated ship; None where there are none.
        own: of calibrating the ship, over the ship file's model.
        per_run: ED of every run before and after that gain [m].
        hull: whether naming the ship's own coefficients as a cause is justified.
        told: lines for the reader.
    """

    calibration: Calibrated | None = None
    gain: Gain | None = None
    own: Gain | None = None
    per_run: tuple[tuple[str, float, float], ...] = ()
    hull: bool = False
    told: tuple[str, ...] = ()


def _proposed(causes: Sequence[str], calibration: Calibrated | None) -> str:
    """Spec of the model that is proposed: the calibrated ship with the causes that a predictor can have, or `physics`
    where there are none and calibrating the ship does not pay.

    The coefficients of the hull are calibrated already, and errors of the record are to be corrected.
    """
    traits = {name: EFFECTS.get(name).traits for name in causes}
    names = [name for name, t in traits.items() if not t.describes_data and t.search != "hull"]
    pays = calibration is not None and calibration.after < calibration.before
    return "+".join(["calibrated", *names]) if names or pays else "physics"


def _on_fitted(
    dataset: Dataset, simulation: OwnSimulation | None, judged: Judged | None, found: Analysis, seed: int
) -> Calibrated:
    """Errors before and after the ship's own coefficients are calibrated, on the runs that were fitted."""
    if simulation is not None and judged is not None:
        return judged.calibrated(dataset, simulation, seed)
    return on_fitted_runs(dataset, found.selection.null, seed)


def _as_it_must_be_read(
    dataset: Dataset, null: Fit, steps: int, settled: Sequence[str], seed: int
) -> tuple[Analysis, Dataset, list[UnitFinding], Sequence[str]]:
    """Analysis of runs of which `null` is the baseline model, with sign errors and errors of actuator records
    corrected.

    Returns the analysis, the corrected runs, the sign errors (which the model cannot distinguish from another ship than
    that of the file), and the effects that are excluded: `settled`, and delays that the track rules out.
    """

    def plain(read: Dataset) -> Fit:
        return plain_model(plant_of(read, steps), settled=settled)

    turned = turned_actuators(dataset, null)
    turned = [] if is_spent() else turned  # fits that were stopped are not to be compared
    read = corrected(dataset, turned)
    found = analyse(plain(read) if turned else null, seed=seed)
    if turned and not is_spent() and doubts_of(found):
        turned, read, found = [], dataset, analyse(null, seed=seed)
    if wrong := [e for e in found.misread if e.contradicted]:
        read = misread.read_rightly(read, wrong)
        found = analyse(plain(read), seed=seed, misread=wrong)
    if not is_spent() and (late := ruled_out(read, found.final)):
        settled = (*settled, *late)
        found = analyse(plain(read), seed=seed, misread=wrong)
    return found, read, turned, settled


def _of_depth(dataset: Dataset, plant: Plant) -> list[str]:
    """Lines on the use of a recorded depth."""
    if plant.seg.depth is not None:
        draughts = plant.seg.depth / plant.ship.T
        return [
            f"the depth is recorded ({np.min(draughts):.2g} to {np.max(draughts):.2g} draughts): what it does to "
            "hull and added masses is in the "
            "fitted model, by the formulas of `shallow_water`. The models of `shipbench run` do not know it."
        ]
    least = least_depth(dataset)
    if least > plant.ship.T:
        return []
    return [
        f"the recorded depth falls to {least:.3g} m, and the ship draws {plant.ship.T:.3g} m: it is not used. A "
        "depth counts from the surface; "
        "to one below the keel add the draught."
    ]


@threadpool_limits.wrap(limits=1)  # a process of its own
def _one_fold(
    fold: int,
    threshold: float | None,
    *,
    dataset: Dataset,
    seed: int,
    only: Sequence[str] | None,
    settled: Sequence[str],
    budget: Budget,
    simulation: OwnSimulation | None = None,
) -> FoldErrors:
    """Selection (none where the threshold is None) and fits on the training part of one fold, within a part of the
    budget of the whole."""
    test = _folds(dataset, seed)[fold]
    train = dataset.with_runs(r for i, r in enumerate(dataset.runs) if i not in set(test.tolist()))
    if simulation is not None:
        simulation, train = simulation.of_training(dataset, train)
    plant = plant_of(train, FOLD_STEPS)
    with limited(Budget(budget.iterations, budget.seconds, budget.gigabytes)) as used:
        null = plain_model(plant, only, settled)
        final, gears = (null, {}) if threshold is None else causes_of(null, threshold, only)
        if simulation is not None:
            causes = correctable([t.effect.name for t in final.model.terms])
            return replace(simulation_fold_errors(dataset, test, simulation, train, causes), stopped=used.is_spent)
        return replace(fold_errors(dataset, test, null, final, gears), stopped=used.is_spent)


def _folds(dataset: Dataset, seed: int) -> list[np.ndarray]:
    """Indices of the runs of each fold: groups in random order, whole, each where its middle run falls among equal
    parts."""
    members: dict[str, list[int]] = {}
    for i, run in enumerate(dataset.runs):
        members.setdefault(run.group, []).append(i)
    groups = [*members.values()]
    groups = [groups[i] for i in np.random.default_rng(seed).permutation(len(groups))]
    size = np.array([len(g) for g in groups])
    folds = THRESHOLDS.count("folds")
    parts = [len(p) for p in np.array_split(np.arange(len(dataset)), folds)]
    part = np.repeat(np.arange(folds), parts)[np.cumsum(size) - 1 - size // 2]
    return [
        np.sort(np.concatenate([g for g, k in zip(groups, part, strict=True) if k == fold])) for fold in np.unique(part)
    ]


def _behind_its_record(found: Analysis, causes: Sequence[Cause]) -> dict[str, str]:
    """Advice on an actuator whose motion differs from its record, by the name of the cause.

    The actuator dynamics of the predictors end at the record, so the record has to be corrected.
    """
    if found.final.plant.seg.commanded:
        return {}
    in_record, told = {g.effect for g in found.gears}, {}
    for c in causes:
        effect = EFFECTS.get(c.effect)
        if not effect.unrecorded or c.effect in in_record:
            continue
        (size,) = c.parameters.values()
        what, channel = ("rudder", "delta") if effect.family == "rudder" else ("shaft", "n")
        how, advice = f"with a play of {math.degrees(size.value):.2g} deg behind", "Measure behind that play."
        if size.unit == "s":
            how = f"{abs(size.value):.2g} s {'later' if size.value > 0.0 else 'sooner'} than"
            near = ", which comes near" if effect.traits.gear_field == "T" else ""
            advice = f"Correct the record first, by [delay] {channel} = {-size.value:.2g} in dataset.toml{near}."
        told[c.effect] = (
            f"the motion shows the {what} {how} its record, to which predictors fit the actuator dynamics. {advice}"
        )
    return told


def _cross_validated(
    dataset: Dataset,
    found: Analysis,
    doubts: bool,
    seed: int,
    work: Callable[..., FoldErrors],
    pool: Executor | None,
    ahead: Future[FoldErrors] | None,
) -> Worth:
    """Errors on held-out runs; ahead: the first part, as it is with the usual threshold.

    Where nothing is named, or the ship file is in doubt, nothing is looked for in the training parts either.
    """
    named = bool(found.final.model.terms or found.gears) and found.unknown is None and not doubts
    ready = [ahead] if ahead is not None and (not named or found.threshold == THRESHOLD) else []
    folds, rest = THRESHOLDS.count("folds"), range(len(ready), len(_folds(dataset, seed)))
    parts: list[FoldErrors] = []
    step(f"fit {folds} training parts, score the runs left out", 2.0 * _WHOLE, 0.96)
    for part in (pool.map if pool else map)(partial(work, threshold=found.threshold if named else None), rest):
        parts.append(part)
        within(len(parts) / (len(rest) + len(ready)))
    parts += [part.result() for part in ready]
    if stopped := sum(part.stopped for part in parts):
        return Worth(
            told=(f"no gain is measured: {stopped} of {len(parts)} training parts were stopped by the limit on work.",)
        )
    order = np.argsort(np.concatenate([part.test for part in parts]))
    file, own, after, on_regressions, own_hull = (
        np.concatenate([getattr(part, name) for part in parts])[order]
        for name in ("file", "calibrated", "with_causes", "on_regressions", "own_hull")
    )
    groups = [run.group for run in dataset.runs]
    of_ship, hulls = (summarise(*pair, seed, groups) for pair in ((file, own), (on_regressions, own_hull)))
    calibration = of_runs(dataset, file, own, seed)
    if doubts:
        told = "no gain is measured while the ship file is in doubt: correct it, or confirm it, and diagnose again."
        return Worth(calibration, told=(told,))
    name_hull = found.hull > HULL_THRESHOLD and found.unknown is None and hulls.ci95[0] > 0.0
    before, after = (own, after) if named else (file, own)
    rows = tuple((run.id, float(b), float(a)) for run, b, a in zip(dataset.runs, before, after, strict=True))
    gain = summarise(own, after, seed, groups) if named else None
    return Worth(calibration, gain, of_ship, rows if named or name_hull else (), name_hull)
