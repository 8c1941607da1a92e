"""Selection of causes: forward selection with nonlinear refits of the best candidates, and a backward pass."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product, takewhile

import numpy as np

from ...effects.base import EFFECTS, Effect
from ...estimation.baseline import REFIT_ITERATIONS, beside_noise_of
from ...estimation.budget import is_spent
from ...estimation.forward import Plant
from ...estimation.gauss_newton import Origin, fit, looking_at
from ...estimation.laplace import Fit, hull_evidence, settle
from ...estimation.linearisation import Linearisation
from ...estimation.robust_prior import widened
from ...estimation.term import Term
from ..thresholds import THRESHOLDS
from .applicable import why_not
from .backward import needed_only, wanted_only
from .requirements import ABOVE_ORDINARY, SAME_SHIP, SIGNIFICANT, SURE, Standard, first_unmet
from .screening import Score, changes, glance, overlap, screen

CONFUSED = THRESHOLDS.value("evidence")
"""Largest difference from the winner's score, 2 log Bayes factor, of candidates that are reported as confounded with
it."""


@dataclass(frozen=True)
class Step:
    """Candidate that was refitted in a round, its score at its own optimum (2 log Bayes factor over the model before),
    or its predicted score when it was given up, and the number of runs that are likelier there than by the model
    before."""

    round: int
    term: Term
    score: float
    supporters: int

    @classmethod
    def of(cls, number: int, tried: Fit, now: Fit, score: float) -> Step:
        return cls(number, tried.model.terms[-1], score, int(np.sum(tried.solution.per_run > now.solution.per_run)))

    def is_near(self, best: Step) -> bool:
        """Whether the data do not distinguish it from the selected step."""
        share = THRESHOLDS.value("minor_share") * push_alike(self.term.effect, best.term.effect)
        return self.round == best.round and self.score > best.score - max(CONFUSED, share * best.score)


@dataclass(frozen=True)
class Selection:
    """Result of the selection.

    null: the baseline model, with the noise model that fits the causes; plain: with its own; final: with the causes
    found; scores: of every candidate in the first round, and `last` beside the final model; off_form: further score
    required of a cause confounded with the form of a hull (`Standard.asked_besides`); unmet: effects above the
    threshold that are not identified, with the first requirement that they do not meet; small: the baseline model with
    those of them of which ordinary ships have as much, where nothing else was found.
    """

    null: Fit
    plain: Fit
    final: Fit
    first: list[Score]
    last: list[Score]
    steps: list[Step]
    off_form: float = 0.0
    unmet: Mapping[str, str] = field(default_factory=dict)
    small: Fit | None = None


def push_alike(one: Effect, other: Effect) -> bool:
    """Whether two effects of one group have different formulas, which alone distinguish them."""
    return (
        bool(one.traits.group) and one.traits.group == other.traits.group and type(one).force is not type(other).force
    )


def shows_in_record(effect: Effect) -> bool:
    """Whether it acts between command and actuator alone: where the actuator is recorded, it is looked for in the
    record, not in the motion."""
    return effect.enters == "gear" and not effect.unrecorded


def candidates_for(plant: Plant, names: Sequence[str] | None = None, settled: Sequence[str] = ()) -> list[Term]:
    """Candidates: every effect that could act on these data, less those that are `settled`, once per shape setting."""
    found = []
    for name in names if names is not None else EFFECTS.names():
        effect = EFFECTS.get(name)
        if (
            effect.traits.search != "screening"
            or name in settled
            or (not plant.seg.commanded and shows_in_record(effect))
        ):
            continue
        if why_not(effect, plant):
            continue
        ways = list(product(effect.fitted(plant.c.L), effect.settings(plant.seg.states[..., :2], plant.ship)))
        found += [Term(way, setting, effect.per_run, choices=len(ways)) for way, setting in ways]
    return found


@dataclass(frozen=True)
class Beginning:
    """Model and candidates at an `Origin`, where it has not been fitted yet: one linearisation `lin`, with their
    columns, from which a refit with any of them starts."""

    now: Fit
    origin: Origin
    lin: Linearisation
    seen: Fit

    @classmethod
    def of(cls, now: Fit, origin: Origin, terms: Sequence[Term]) -> Beginning:
        at = replace(origin.point, terms=now.model.terms, values=now.values)
        lin = Linearisation(now.plant, now.scales, at, origin.motion)
        return cls(now, origin, lin, settle(lin, now.model, origin.hyper, now.log_tau2, terms, far=True))

    def refit(self, score: Score, least: float = -np.inf, rival: float = -np.inf) -> Fit:
        """Fit of the model with one more term, given up where its predicted gain is below `least`, or below `rival`
        once the prediction is near (`gauss_newton.fit`)."""
        now, term, columns, candidates = self.now, score.term, self.seen.columns, self.seen.candidates
        place, shared = candidates.index(term), self.seen.products.shared
        at, inside = shared - sum(t.size for t in candidates[place:]), shared - sum(t.size for t in candidates)
        held = replace(
            self.seen, products=self.seen.products.only(np.append(np.arange(inside), at + np.arange(term.size))),
            candidates=(),
            columns=replace(columns, own=(*columns.own, columns.candidates[place]), candidates=()),
        )  # fmt: skip
        lin, model = self.lin.holding(place, term), replace(now.model, terms=(*now.model.terms, term))
        log_tau2 = now.log_tau2 | ({len(now.model.terms): score.log_tau2} if term.per_run else {})
        return fit(
            now.plant,
            now.scales,
            model,
            lin.point,
            self.origin.hyper,
            log_tau2,
            iterations=REFIT_ITERATIONS,
            hope=now.evidence + 0.5 * least,
            rival=now.evidence + 0.5 * rival,
            far=True,
            begun=(lin, held),
        )


def refits(
    now: Fit,
    scores: Sequence[Score],
    origin: Origin,
    threshold: float,
    worth: Callable[[Fit], float] = lambda _: -np.inf,
) -> list[tuple[Fit, float]]:
    """Refits of `now` with each of the candidates, and the score of each (2 log Bayes factor), or its predicted score
    when it was given up beside a better one above the threshold: one whose gain `worth` neither it nor what is
    reported as confounded with that could still be.

    They are in the order of their scores, the better one of that beside `now` and of that at `origin`, where refits
    begin: the first is mostly the best, beside which others are given up soon.
    """
    if not scores:
        return []
    start = Beginning.of(now, origin, [s.term for s in scores])
    ranks = [
        {s.term: rank for rank, s in enumerate(sorted(of, key=lambda s: -s.score))}
        for of in (glance(start.seen), scores)
    ]
    found, best, least, rival = list[tuple[Fit, float]](), threshold, -np.inf, -np.inf
    for score in sorted(scores, key=lambda s: min(rank[s.term] for rank in ranks)):
        if is_spent():
            break
        # the variance of values of single runs is still growing when the rest of a prediction is near
        tried = start.refit(score, least, -np.inf if score.term.per_run else rival)
        if threshold - THRESHOLDS.value("tie") < 2.0 * (tried.evidence - now.evidence) < threshold:
            tried = fit(
                tried.plant, tried.scales, tried.model, tried.point, tried.hyper, tried.log_tau2, guess=tried.motion
            )
        gained, promised = 2.0 * (tried.evidence - now.evidence), 2.0 * (tried.promise - now.evidence)
        found.append((tried, promised if promised < max(least, rival) else gained))
        if (beyond := worth(tried)) > threshold:
            rival = max(rival, beyond - max(CONFUSED, THRESHOLDS.value("minor_share") * beyond) - _FAR)
        if gained > best:
            best, least = gained, _least(tried, now)
    return found


_FAR = THRESHOLDS.value("unconverged_excess")
"""Amount by which a refit that has not converged may still gain."""


def _least(best: Fit, now: Fit) -> float:
    """Predicted gain that a refit needs beside the best one; less by the amount by which that one's prediction fell
    short."""
    share = THRESHOLDS.value("prediction_share")
    return 2.0 * (share * (best.evidence - now.evidence) - max(best.promise - best.early, 0.0)) - _FAR


def select(null: Fit, threshold: float) -> Selection:
    """Add the best candidate while it gains more than `threshold` and than what the causes found leave; drop what a
    later one has made needless.

    `null` must carry the candidates. Candidates are refitted if their linear score is among the best, or the best of
    their family. Where other noise suits the first cause than suits the plain model, this begins once more beside that.
    """
    plain, grown = null, _grown(null, threshold)
    if grown.again is not None:
        again = _grown(grown.again, threshold, again=True)
        null, grown = (null, grown) if is_spent() else (grown.again, again)
    now, scores, standard = grown.now, grown.scores, replace(grown.standard, null=null)
    pruned = needed_only(now, standard, spare_last=False)
    pruned, unsure = wanted_only(pruned, (*SURE, SAME_SHIP), standard)
    whole = pruned
    pruned, small = wanted_only(pruned, ABOVE_ORDINARY, standard)
    if pruned is not now:
        now = looking_at(pruned, null.candidates)
        sure, more = wanted_only(now, SURE, standard) if small else (now, {})  # without what is too small, too
        if more:
            now, unsure = looking_at(sure, null.candidates), unsure | more
        scores = screen(now)
    return Selection(
        null, plain, now, grown.first, scores, grown.steps, standard.off_form, grown.tiny | small | unsure,
        whole if small and not now.model.terms else None,
    )  # fmt: skip


@dataclass(frozen=True)
class _Grown:
    """Model `now` with every cause added to the baseline model, and the steps to it, as in `Selection`; again: the
    baseline model with another noise model, from which to begin once more; then `now` holds the first cause alone.
    tiny: effects without practical significance, and why."""

    now: Fit
    first: list[Score]
    scores: list[Score]
    steps: list[Step]
    tiny: dict[str, str]
    standard: Standard
    again: Fit | None = None

    def gain(self, tried: Fit) -> float:
        """Score of the last term of `tried` beyond that; one without practical significance gains nothing."""
        term = tried.model.terms[-1]
        # every ship is a little unequal, every run has a breath of wind, every record is a little late: what is too
        # small of that stays, and others are judged beside it
        spared = (
            not self.standard.careful or term.effect.breaks_symmetry or term.per_run or term.effect.enters == "gear"
        )
        if not (spared or SIGNIFICANT.check(tried, -1, self.standard).met):
            return -np.inf
        return 2.0 * (tried.evidence - self.now.evidence) - self.standard.asked_besides(
            term, np.max(np.abs(tried.values[-1]))
        )


def _grown(null: Fit, threshold: float, again: bool = False) -> _Grown:
    """Forward selection; again: do not ask for other noise once more."""
    first, careful = screen(null), threshold > 0.0  # who is told the names needs no such care
    off_form = THRESHOLDS.value("off_form") * max(hull_evidence(null), 0.0) if careful and not is_spent() else 0.0
    standard = Standard(null, threshold, off_form, careful)
    state = _Grown(null, first, first, [], {}, standard)
    origin = Origin.of(null.plant, null.scales)
    for round_ in takewhile(lambda _: not is_spent(), range(THRESHOLDS.count("causes"))):
        now = state.now
        tried = refits(now, worth_a_refit(state.scores, now, threshold), origin, threshold, state.gain)
        if not is_spent() and all(2.0 * (f.evidence - now.evidence) < threshold for f, _ in tried):
            tried += refits(now, absorbed([f for f, _ in tried], now, threshold, origin), origin, threshold, state.gain)
        state.steps.extend(Step.of(round_, f, now, score) for f, score in tried)
        for f, score in tried:
            if score > threshold and not (size := SIGNIFICANT.check(f, -1, standard)).met:
                state.tiny[f.model.terms[-1].label] = size.reason
        # of a round that is cut short the best is not known
        best = (
            None
            if is_spent()
            else _or_change(now, max((f for f, _ in tried), key=state.gain, default=None), origin, standard)
        )
        # what the causes found leave unexplained, because their formulas are not the ship's, passes for another cause
        left = THRESHOLDS.value("minor_share") * 2.0 * (now.evidence - null.evidence)
        imprecise = min(left, THRESHOLDS.value("evidence_beyond_library"))
        # what a fit that does not rest could still gain by itself is no gain of the next cause
        if best is None or state.gain(best) < threshold + imprecise + now.excess:
            break
        if best.model.terms[-1].since is not None:
            state.steps.append(Step.of(round_, best, now, 2.0 * (best.evidence - now.evidence)))
        now = widened(looking_at(needed_only(best, standard), null.candidates))
        if round_ == 0 and not again and (other := beside_noise_of(now, null)) is not None:
            return replace(state, now=now, again=other)
        state = state if is_spent() else replace(state, now=now, scores=screen(now))
    return state


def _or_change(now: Fit, best: Fit | None, origin: Origin, standard: Standard) -> Fit | None:
    """Best candidate, or one that begins at a later run, where that explains the runs better by the threshold."""
    if any(t.since is not None for t in now.model.terms):
        return best
    gain = 2.0 * (best.evidence - now.evidence) if best is not None else 0.0
    margin = THRESHOLDS.value("evidence")
    present, least = {t.label for t in now.model.terms}, max(margin, THRESHOLDS.value("minor_share") * gain)
    late = [s for s in changes(now) if s.score > least and s.term.label not in present]
    late = [s for s in late if not s.term.effect.traits.persistent][: THRESHOLDS.count("refits")]
    if not late:
        return best
    start = Beginning.of(now, origin, [s.term for s in late])
    for score in late:
        found = start.refit(score, _least(best, now) if best is not None and gain > margin else -np.inf)
        if 2.0 * (found.evidence - now.evidence) > gain + margin and first_unmet(SURE, found, -1, standard).met:
            best, gain = found, 2.0 * (found.evidence - now.evidence)
    return best


def worth_a_refit(scores: Sequence[Score], now: Fit, threshold: float) -> list[Score]:
    """The best, the best of each family, and whatever could stand in for the best: one way of each effect, or those
    that tie."""
    present, best = _beside(now), dict[str, Score]()
    for s in scores:
        if s.term.label not in present:
            best.setdefault(s.term.label, s)
    ranked = sorted(best.values(), key=lambda s: -s.score)
    worth, refitted = THRESHOLDS.value("prediction_share") * threshold, THRESHOLDS.count("refits")
    if not ranked or ranked[0].score < worth:
        return []
    least = max(worth, THRESHOLDS.value("minor_share") * ranked[0].score)
    chosen = [s for s in ranked[:refitted] if s.score > least]
    families = {s.term.effect.family for s in chosen}
    for s in ranked[refitted:]:
        if s.score > max(threshold, least) and s.term.effect.family not in families:
            chosen.append(s)
            families.add(s.term.effect.family)
    best_of_all = ranked[0].term.effect
    rivals = overlap(now, ranked[0].term, ranked[0].estimate)
    if (
        best_of_all.vector or best_of_all.per_run
    ):  # their sensitivities depend on the size too much for the linear overlap
        rivals |= {s.term.label: 1.0 for s in ranked if s.term.effect.vector or s.term.effect.per_run}
    share = THRESHOLDS.value("prediction_share")
    near = [s for s in ranked if rivals.get(s.term.label, 0.0) > share and s not in chosen]
    chosen += sorted(near, key=lambda s: -rivals[s.term.label])[: THRESHOLDS.count("refits")]
    return [
        s
        for s in scores
        if any(s is c or (s.term.label == c.term.label and s.score > c.score - _tie(c)) for c in chosen)
    ]


def _tie(best: Score) -> float:
    """Difference of score within which another form of an effect is refitted, too: a moment that grows with the square
    of a size has no slope at zero."""
    tie = THRESHOLDS.value("tie")
    if best.term.effect.vector and not best.term.per_run:
        return max(tie, (1.0 - THRESHOLDS.value("prediction_share")) * best.score)
    return tie


def _beside(now: Fit) -> set[str]:
    """Effects that are in the model, and those that cannot be named beside them."""
    present = {t.label for t in now.model.terms}
    groups = {t.effect.traits.group for t in now.model.terms} - {""}
    return present | {t.label for t in now.candidates if t.effect.traits.group in groups}


def absorbed(tried: Sequence[Fit], now: Fit, threshold: float, origin: Origin) -> list[Score]:
    """Vectors and values of single runs that deserve a refit as seen from `origin`, where the model has not been fitted
    yet: in few or short runs in calm weather latent force and parameters absorb a current so well that a converged fit
    shows none of it."""
    terms = [t for t in now.candidates if t.effect.vector or t.per_run]
    if not terms or np.isinf(threshold):
        return []
    best: dict[str, Score] = {}
    for s in screen(Beginning.of(now, origin, terms).seen):
        best.setdefault(s.term.label, s)
    least = max(threshold, THRESHOLDS.value("minor_share") * max(s.score for s in best.values()))
    seen = _beside(now) | {f.model.terms[-1].label for f in tried}
    return [s for label, s in best.items() if label not in seen and s.score > least][: THRESHOLDS.count("refits")]
