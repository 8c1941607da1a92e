"""The search for causes in 24 runs beside one with a full refit of every candidate: the same plain fit, candidates,
evidence and causes.

    python benchmarks/diagnosis_refits.py [--runs N] [--quick] [--json FILE]

Both sides start from the fitted plain model and add causes until none gains more than the threshold. Ours is the whole
`select` of a diagnosis: the sensitivities of all candidates at once, the score of each on the one Gram matrix, refits
of the few that are worth one, given up where they promise far less than the best, beginnings at single runs, and the
backward pass. Peer: in every round the same refit for each candidate in turn, as one would do without the Gram matrix;
nothing else is looked for. The target is 20 times.
"""

from __future__ import annotations

import measure

from shipbench.diagnosis.selection.screening import screen
from shipbench.diagnosis.selection.stepwise import Beginning, candidates_for, select
from shipbench.effects.base import EFFECTS
from shipbench.estimation.baseline import null_fit
from shipbench.estimation.forward import Plant
from shipbench.estimation.gauss_newton import Origin, looking_at
from shipbench.estimation.laplace import Fit
from shipbench.estimation.linearisation import Scales
from shipbench.physics.mmg import load_mmg_ship
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials

THRESHOLD = 10.0
QUICK = ("current", "heading_bias", "speed_scale")


def refit_everything(plain: Fit) -> Fit:
    """The plain model with causes, each the best of all candidates after a refit of every one."""
    now, origin = plain, Origin.of(plain.plant, plain.scales)
    while True:
        inside = {term.label for term in now.model.terms}
        tried = [Beginning.of(now, origin, [s.term]).refit(s) for s in screen(now) if s.term.label not in inside]
        best = max(tried, key=lambda found: found.evidence)
        if 2.0 * (best.evidence - now.evidence) < THRESHOLD:
            return now
        now = looking_at(best, plain.candidates)


def compare(title: str, hidden: tuple[Hidden, ...], given: measure.Options) -> None:
    """Time both ways to the causes in the trials of a ship with `hidden` effects; stop where they do not agree."""
    trials = Trials(runs=6, samples=60) if given.quick else Trials(runs=24, samples=120)
    plant = Plant.of(sea_trials(load_mmg_ship("kcs"), 3, hidden, trials))
    candidates = candidates_for(plant, QUICK if given.quick else None)
    plain = select(
        null_fit(plant, Scales(plant), candidates), THRESHOLD
    ).null  # beside the noise that suits the causes, too
    best: dict[str, Fit] = {}

    def ours() -> None:
        best["ours"] = select(plain, THRESHOLD).final

    def peer() -> None:
        best["peer"] = refit_everything(plain)

    print(
        f"{len(candidates)} candidates (shapes counted), {len(plant.seg.run)} pieces of {trials.runs} runs of "
        f"{trials.samples} s"
    )
    measure.compare(
        title, measure.Side("select(plain fit, threshold)", ours),
        measure.Side("refit of every candidate in every "
                     "round", peer), given, target=20.0,
        warm=False,
    )  # fmt: skip
    named = {side: [term.label for term in found.model.terms] for side, found in best.items()}
    if named["ours"] != named["peer"]:
        raise SystemExit(f"the sides do not agree: {named['ours']} and {named['peer']}.")
    measure.agree(
        f"log evidence of {named['ours'] or 'the plain model'}", abs(best["ours"].evidence - best["peer"].evidence), 0.5
    )


def main() -> None:
    """A ship with a hidden cause, one with two, and one with nothing hidden."""
    given = measure.options(__doc__, runs=3)
    measure.header(given)
    # a few short runs hardly show a current before it is fitted; a compass error they do
    compass = Hidden(EFFECTS.get("heading_bias"), (0.05,))
    cause = compass if given.quick else Hidden(EFFECTS.get("current"), (0.25, -0.2))
    compare(f"causes of a diagnosis, {cause.effect.name} hidden", (cause,), given)
    if not given.quick:
        compare(
            "causes of a diagnosis, heading_bias and rudder_offset hidden",
            (compass, Hidden(EFFECTS.get("rudder_offset"), (0.03,))),
            given,
        )
    compare("causes of a diagnosis, nothing hidden", (), given)


if __name__ == "__main__":
    main()
