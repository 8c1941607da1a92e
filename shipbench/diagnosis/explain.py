"""Explanation of an analysis in lines of the verdict: causes with sizes and intervals, and the unexplained
remainder."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..checking.units import UnitFinding
from ..effects.base import EFFECTS, Effect, aliases_of, searched_by
from ..estimation.coefficients import HULL
from ..estimation.laplace import Fit
from ..estimation.term import Term
from .actuators.kinds import GearFinding
from .evaluation.forces import force_of_hull, force_of_term
from .evaluation.run_values import goes_with, of_runs
from .preparation.time_offsets import LateVelocities, late_effects, late_velocities_effect
from .result import Cause, Estimate, Gain, what_it_is
from .selection.agreement import covariance
from .selection.analysis import Analysis
from .selection.ship_file import whatever_the_ship
from .selection.stepwise import CONFUSED
from .selection.unknown import Dependence


def describe_causes(
    found: Analysis,
    units: Sequence[UnitFinding],
    late: LateVelocities | None,
    gain: Gain | None,
    own: Gain | None,
    doubt: bool,
    runs: Sequence[str],
) -> list[Cause]:
    """Identified causes: first those corrected before the fit (units, late velocities), then by score; the hull last,
    because most ships differ from the regressions.

    No cause is listed in whose place an unknown one is reported. In doubt about the ship file an unknown force may be
    due to that; causes that do not depend on the ship file are then listed. gain: of the causes on held-out runs; own:
    of the ship's own coefficients, None where these are no cause; runs: their names.
    """
    causes = [_unit_cause(i + 1, u) for i, u in enumerate(units)]
    if late is not None:
        causes.append(_late_cause(len(causes) + 1, found, late))
    if found.unknown is not None and (found.unknown.of_sensor or not doubt):
        return causes
    seen = [_gear_cause(found, g, gain) for g in found.gears]
    felt = [_term_cause(found, index, term, gain, runs) for index, term in enumerate(found.final.model.terms)]
    named = [c for c in felt if c.effect not in {s.effect for s in seen}] + [
        _with_motion(s, [c for c in felt if c.effect == s.effect]) for s in seen
    ]
    named.sort(key=lambda c: -c.score)
    if named and found.rival is not None:
        other = (
            f"{what_it_is(_described(found.rival))} explains the runs about as well (log Bayes factor "
            f"{0.5 * found.rival.score:.0f})"
        )
        named[0] = replace(named[0], evidence=_sentences([named[0].evidence, other]))
    if doubt:
        named = [c for c in named if whatever_the_ship(c.effect, found)]
    if own is not None:
        named.append(_hull_cause(found, own))
    return causes + [replace(c, rank=len(causes) + i + 1) for i, c in enumerate(named)]


def p_of(found: Analysis, score: float) -> float:
    """p-value of a score under the null, for the greatest score of all candidates."""
    return float((1 + np.sum(found.null_draws >= score)) / (1 + len(found.null_draws)))


def _term_cause(found: Analysis, index: int, term: Term, gain: Gain | None, runs: Sequence[str]) -> Cause:
    fit, effect = found.final, term.effect
    score, supporters, compared = found.score(index)
    rivals = rivals_of(found, term)
    notes = [f"The log Bayes factor compares the models {compared}", effect.way]
    notes += [goes_with(fit.plant.seg, of_runs(fit, index))] if term.per_run else []
    notes += (
        [f"{effect.name} begins with run {runs[term.since]} (number {term.since}, the first is 0)"]
        if term.since is not None
        else []
    )
    name = effect.name if term.since is None else searched_by("change")[0].name
    parameters = _parameters(fit, index, term)
    if term.since is not None:
        parameters = {"from_run": Estimate(float(term.since), "1", (np.nan, np.nan))} | parameters
    return Cause(
        name, 0, score, p_of(found, score), parameters, rivals, effect.separate if rivals else "", gain,
        _sentences(notes),
        f"{supporters} of {fit.plant.seg.runs} runs", force_of_term(fit, index),
        "" if term.per_run or term.since is not None else effect.correction({k: e.value for k,
                e in parameters.items()}),
    )  # fmt: skip


def _sentences(texts: Iterable[str]) -> str:
    """Texts as sentences, without empty ones."""
    return " ".join(
        f"{t[0].upper()}{t[1:].rstrip('.')}." if t.split()[0] not in EFFECTS else f"{t.rstrip('.')}."
        for t in texts
        if t
    )


def rivals_of(found: Analysis, term: Term) -> tuple[str, ...]:
    """Effects with which the cause is confounded: refitted in its place when it was added, with nearly its score."""
    steps = found.selection.steps
    own = max((s for s in steps if s.term.label == term.label), key=lambda s: (s.round, s.score), default=None)
    near = [s.term.label for s in steps if own is not None and s.is_near(own)]
    near += aliases_of(term.effect.name)
    present = {t.label for t in found.final.model.terms}
    return tuple(dict.fromkeys(n for n in near if n not in present))


def _parameters(fit: Fit, index: int, term: Term) -> dict[str, Estimate]:
    """Sizes with 95 % intervals: the wider of the model's and of the sandwich clustered by run; none for shape
    parameters, chosen among a few."""
    from scipy.stats import chi2, t

    effect = term.effect
    unit = fit.scales.amplitudes(term, fit.plant.c.L)
    value = fit.values[index] * unit
    num = fit.plant.seg.runs
    if term.per_run:
        rms = np.sqrt(np.mean(of_runs(fit, index) ** 2, axis=0))
        low, high = np.sqrt(num / chi2.ppf(0.975, num)), np.sqrt(num / chi2.ppf(0.025, num))
        names = [p.name for p in effect.parameters if not p.shape]
        return {
            f"{n}_rms": Estimate(float(r), effect.parameters[0].unit, (float(r * low), float(r * high)))
            for n, r in zip(names, rms, strict=True)
        }
    cov = covariance(fit, index) * np.outer(unit, unit)
    half = float(t.ppf(0.975, max(num - 1, 1)))
    q = (*value, *term.setting)
    reported, units = effect.public(q), effect.units()
    found = {}
    for name, shown in reported.items():
        shape = [p for p in effect.parameters if p.name == name and p.shape]
        spread = np.nan if shape else half * _spread(effect, q, name, cov, len(value))
        found[name] = Estimate(shown, units[name], (shown - spread, shown + spread))
    return found


def _spread(effect: Effect, q: Sequence[float], name: str, cov: np.ndarray, num: int) -> float:
    """Standard deviation of a reported value by the delta method (angles on the circle)."""
    slopes = np.empty(num)
    for i in range(num):
        step = 1e-4 * max(cov[i, i] ** 0.5, 1e-12)
        moved = list(q)
        moved[i] += step
        change = effect.public(moved)[name] - effect.public(q)[name]
        if effect.vector and name == effect.vector[1]:
            change = (change + np.pi) % (2.0 * np.pi) - np.pi
        slopes[i] = change / step
    return float(np.sqrt(max(slopes @ cov @ slopes, 0.0)))


def _gear_cause(found: Analysis, g: GearFinding, gain: Gain | None) -> Cause:
    effect = EFFECTS.get(g.effect)
    parameter = effect.parameters[0]
    near = tuple(
        x.effect
        for x in found.all_gears
        if x.actuator == g.actuator and x.effect != g.effect and x.score > g.score - CONFUSED
    )
    runs = int(np.sum(g.per_run > 0))
    return Cause(
        g.effect, 0, g.score, p_of(found, g.score), {parameter.name: Estimate(g.value, parameter.unit, g.ci95)}, near,
        effect.separate if near else
        "", gain,
        "It is detected between command and record of the actuator. The ship's motion is not used.",
        f"{runs} of {len(g.per_run)} runs",
    )  # fmt: skip


def _with_motion(gear: Cause, motion: Sequence[Cause]) -> Cause:
    """Cause of an actuator record combined with the evidence of the motion: a record as late as the motion is early is
    late alone."""
    for c in motion:
        sizes = ", ".join(
            f"{n} {e.value:.2g} {e.unit} (95 %: {e.ci95[0]:.2g} to {e.ci95[1]:.2g})" for n, e in c.parameters.items()
        )
        late = (
            "A negative value means that the record is late"
            if any(e.value < 0.0 for e in c.parameters.values())
            else ""
        )
        seen = f"Between record and motion it is {sizes}, supported by {c.support}"
        gear = replace(gear, evidence=_sentences([gear.evidence, seen, late, c.evidence]))
    return gear


def _hull_cause(found: Analysis, gain: Gain | None) -> Cause:
    """Cause without sizes: runs do not identify single coefficients (docs/calibration.md#sizes-of-calibration)."""
    evidence = (
        "A hull within 30 % of the regressions explains the runs better than one within 3 %. These runs do not "
        "identify single coefficients."
    )
    score, force = found.hull, force_of_hull(found.final)
    return Cause(HULL.name, 0, score, p_of(found, score), {}, (), "", gain, evidence, force=force)


def _unit_cause(rank: int, u: UnitFinding) -> Cause:
    parameters = {f"{u.channel}_factor": Estimate(float(u.factor), "1", (float(u.factor), float(u.factor)))}
    return Cause(
        searched_by("units")[0].name,
        rank,
        np.inf,
        0.0,
        parameters,
        (),
        "",
        None,
        f"{u.channel}: {u.kind}. {u.evidence}",
    )


def _late_cause(rank: int, found: Analysis, late: LateVelocities) -> Cause:
    half = 1.96 * late.sd
    parameters = {
        "delay": Estimate(late.delay, "s", (late.delay - half, late.delay + half)),
        "earth_axes": Estimate(1.0, "1", (np.nan, np.nan)),
    }  # fmt: skip
    how = " behind a first-order filter" if late.filtered else ""
    evidence = (
        f"The velocity vector in earth axes follows the track {late.delay:.2g} s late{how}. "
        "The comparison of track and velocities shows it, and it is corrected before the fit. "
        f"The plain model agrees: the log Bayes factor is {0.5 * late.score:.0f} against the runs as recorded. "
        f"Against an early position it is {0.5 * late.over_position:.0f}."
    )
    if late.over_position < 0.0:
        evidence += " The runs do not agree on an early position."
    effect = late_velocities_effect()
    confused = tuple(name for name in late_effects() if name != effect.name) if late.over_position < 0.0 else ()
    line = effect.correction({k: e.value for k, e in parameters.items()})
    return Cause(
        effect.name,
        rank,
        late.score,
        p_of(found, late.score),
        parameters,
        confused,
        "",
        None,
        evidence,
        correction=line,
    )


def remaining(found: Analysis) -> dict[str, Any]:
    """Share of the latent force that the causes explain, and the dependence of the remainder."""
    null, final = found.selection.null, found.final
    share = 1.0 - np.exp(final.hyper.log_force - null.hyper.log_force)
    force = np.exp(0.5 * final.hyper.log_force) * null.scales.w
    best = found.generic[0] if found.generic else None
    return {
        "force_variance_explained": {a: float(v) for a, v in zip(("surge", "sway", "yaw"), share, strict=True)},
        "force_sd": {
            a: float(v) for a, v in zip(("surge [m/s^2]", "sway [m/s^2]", "yaw [rad/s^2]"), force, strict=True)
        },
        "best_dependence": None if best is None else _described(best),
    }


def what_is_left(found: Analysis) -> list[str]:
    """Warning on the unexplained part beside the identified causes."""
    if found.left is None:
        return []
    detected = f"{what_it_is(_described(found.left))} (log Bayes factor {0.5 * found.left.score:.0f})"
    return [
        (
            f"besides the named causes the runs show {detected}. No effect of the library covers it. It may bias the "
            "sizes of the causes."
        )
    ]


def unknown_part(found: Analysis) -> dict[str, Any] | None:
    """Axis, variable and form of the dependence that no identified cause covers."""
    return None if found.unknown is None else _described(found.unknown)


def _described(d: Dependence) -> dict[str, Any]:
    return {"axis": d.axis, "variable": d.variable, "form": d.form, "score": d.score, "share": d.share}
