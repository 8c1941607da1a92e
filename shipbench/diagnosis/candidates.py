"""Effects of the library as candidates: the reason why each was not identified, and its detection limit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..effects.base import EFFECTS, searched_by
from ..estimation.laplace import Fit
from .actuators.kinds import GearFinding
from .explain import p_of
from .preparation.time_offsets import late_velocities_effect
from .result import Candidate
from .selection.analysis import HULL_THRESHOLD, Analysis
from .selection.applicable import why_not
from .selection.requirements import detection_limit
from .selection.screening import Score, other_kinds_from, places
from .selection.stepwise import shows_in_record

_DOUBT = "in the model, but not named while the ship file is in doubt"


def describe_candidates(found: Analysis, named: Sequence[str], measured: bool) -> list[Candidate]:
    """Candidates, one for each effect of the library, best first, with the reason why it was not identified and its
    detection limit; measured: whether held-out gains were measured."""
    lines: dict[str, Candidate] = {}
    last = {s.term.label: s for s in reversed(found.selection.last)}
    refits = {s.term.label: s.score for s in sorted(found.selection.steps, key=lambda s: s.score)}
    for s in found.selection.first:
        label = s.term.label
        if label in lines:
            continue
        score = max(s.score, refits.get(label, -np.inf))
        lines[label] = Candidate(
            label, float(score), p_of(found, score), _reason(found, s, last.get(label), named),
            _shown(s, found.selection.null),
            _detectable(found, s),
            s.term.effect.units(), s.term.effect.family,
        )  # fmt: skip
    for g in found.all_gears:
        lines[g.effect] = _gear_candidate(found, g, named, lines.get(g.effect))
    for name in EFFECTS.names():
        if name not in lines:
            lines[name] = _not_screened(found, name, named, measured)
    return sorted(lines.values(), key=lambda c: -c.score if np.isfinite(c.score) else np.inf)


def _gear_candidate(found: Analysis, g: GearFinding, named: Sequence[str], motion: Candidate | None) -> Candidate:
    """Candidate of an effect on an actuator; motion: the candidate from the ship's motion."""
    name, unit = EFFECTS.get(g.effect).parameters[0].name, EFFECTS.get(g.effect).parameters[0].unit
    sizes = [g.detectable, motion.detectable[name]] if motion else [g.detectable]
    detectable = {name: float(np.fmin.reduce(sizes))}
    if motion and motion.score >= g.score:
        return replace(motion, detectable=detectable)
    reason = "named" if g.effect in named else f"score {g.score:.0f} below the threshold {found.threshold:.0f}"
    if g.effect not in named and g.score > found.threshold:
        best = next(x for x in found.all_gears if x.actuator == g.actuator)
        reason = (
            f"{best.effect} explains the same actuator better ({best.score:.0f} against {g.score:.0f})"
            if best is not g
            else _DOUBT
        )
    family = EFFECTS.get(g.effect).family
    return Candidate(g.effect, g.score, p_of(found, g.score), reason, {name: g.value}, detectable, {name: unit}, family)


def _reason(found: Analysis, s: Score, last: Score | None, named: Sequence[str]) -> str:
    """Reason why a screened candidate is not identified; last: its score beside the causes found."""
    label, steps, inside = s.term.label, found.selection.steps, [t.label for t in found.final.model.terms]
    odd = found.standard.asked_besides(s.term)
    asked, score = found.threshold + odd, max([s.score, *(x.score for x in steps if x.term.label == label)])
    if label in named:
        return "named"
    if found.unknown is not None and score > found.threshold:
        own = max(
            (x.score for x in steps if x.term.label == label), default=score
        )  # once fitted: it may have promised more
        return f"a dependence on {found.unknown.variable} explains more ({found.unknown.score:.0f} against {own:.0f})"
    if label in inside:
        late = any(t.label == label and t.since is not None for t in found.final.model.terms)
        change = searched_by("change")[0].name
        return f"named as a {change}" if late and change in named else _DOUBT
    if label in found.selection.unmet:
        return f"score {score:.0f}, but {found.selection.unmet[label]}"
    if not s.term.per_run and float(np.trace(s.information)) < 1.0:
        return "these data cannot separate it from the fitted coefficients"
    if score <= found.threshold:
        return f"score {score:.1f} below the threshold {found.threshold:.0f}"
    if score <= asked:
        return (
            f"score {score:.1f} below {asked:.1f}: the threshold is {odd:.1f} higher for effects in which ships differ"
        )
    if inside and (last is None or last.score <= asked):
        left = f", {last.score:.0f} beside it" if last is not None else ""
        return f"explained by {next((n for n in named if n in inside), inside[0])} ({score:.0f} alone{left})"
    fitted = [x.score for x in steps if x.term.label == label and x.round == steps[-1].round]
    what = "but the better candidates gain nothing once they are fitted"
    if fitted:
        what = f"{f'{fitted[0]:.0f}' if fitted[0] > 0.0 else 'below zero'} once it is fitted"
    return f"score {s.score if last is None else last.score:.0f}{' beside the causes found' if inside else ''}, {what}"


def _shown(s: Score, fit: Fit) -> dict[str, float]:
    unit = fit.scales.amplitudes(s.term, fit.plant.c.L)
    return s.term.effect.public((*(s.estimate * unit), *s.term.setting)) if not s.term.per_run else {}


def _detectable(found: Analysis, s: Score) -> dict[str, float]:
    """Detection limit along each amplitude; of values of single runs the root mean square. NaN beyond the bounds."""
    null, effect = found.selection.null, s.term.effect
    term, unit, least = s.term, null.scales.amplitudes(s.term, null.plant.c.L), detection_limit(s, found.standard)
    values = {}
    for size, p in zip(unit * least, [p for p in effect.sized(null.plant.c.L) if not p.shape], strict=True):
        seen = effect.public((size, 0.0))[effect.vector[0]] if effect.vector else float(size)
        values[f"{p.name}_rms" if term.per_run else p.name] = (
            seen if size <= max(abs(p.low), abs(p.high)) else float("nan")
        )
    return values


def _not_screened(found: Analysis, name: str, named: Sequence[str], measured: bool) -> Candidate:
    effect, plant = EFFECTS.get(name), found.final.plant
    if name in named:
        reason = "named"
    elif effect.traits.search == "hull":
        unpaid = (
            "not shown to pay on held-out runs"
            if measured
            else "named only where it pays on held-out runs, which was not measured"
        )
        reason = (
            f"evidence {found.hull:.0f} below the threshold {HULL_THRESHOLD:.0f}"
            if found.hull <= HULL_THRESHOLD
            else unpaid
        )
    elif effect.late:
        put_right = "the clocks of position and velocities were corrected before the fit"
        reason = (
            put_right
            if late_velocities_effect().name in named
            else "by the track, position and velocities are recorded at the same time"
        )
    elif why := why_not(effect, plant):
        reason = why
    elif effect.traits.search == "change" and (barred := other_kinds_from(plant.seg.kinds)):
        where = f"{len(barred)} of {len(places(plant.seg.runs))} places"
        reason = f"no sign of it; not looked for at {where} where another kind of manoeuvre follows"
    elif effect.traits.describes_data:
        reason = "no sign of it"
    elif not plant.seg.commanded and shows_in_record(effect):
        reason = "this actuator is not commanded in these runs"
    elif shows_in_record(effect):
        reason = "only commands are recorded: the actuator dynamics are fitted"
    elif effect.traits.search == "never":
        reason = f"not looked for; fit it with physics+{name}"
    else:
        reason = "not considered"
    score = found.hull if effect.traits.search == "hull" else float("nan")
    return Candidate(name, score, float("nan"), reason, family=effect.family)
