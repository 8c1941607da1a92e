"""Whether "the smallest size that would have been named" is true: effects hidden at a share of that size and at more
than it. About 10 minutes.

    python benchmarks/diagnosis_smallest.py [--runs DRAWS] [--only SHIP ...] [--quick] [--json FILE]

A ship sails with nothing hidden, and the diagnosis says what it would have seen. Then she sails the same trials, with
the same noise, with one effect after another at half and at one and a half times that size (one amplitude of it; of a
wind or a current to the north; normal where each run has its own; of a bank, whose place would have to be drawn, none).
"""

from __future__ import annotations

from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from math import isfinite
from multiprocessing import get_context

import measure
import numpy as np
from seven_ships import SHIPS, particulars, trials

from shipbench.diagnosis.diagnose import diagnose
from shipbench.effects.base import EFFECTS
from shipbench.errors import InputError
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials

FACTORS = (0.5, 1.5)
LEFT_OUT = ("bank_suction",)


def smallest(ship: int, draw: int) -> dict[str, float]:
    """Size of the first amplitude of every effect from which on it would have been named; without those that could not
    have been."""
    found = diagnose(trials(ship, draw, draw), gain=False)
    sizes = {
        c.effect: next(iter(c.detectable.values()))
        for c in found.candidates
        if c.detectable and c.effect not in LEFT_OUT
    }
    return {name: size for name, size in sizes.items() if isfinite(size)}


def hidden(name: str, size: float, ship: int, draw: int) -> Hidden:
    """An effect whose first amplitude has a size, to the side that is typical."""
    effect = EFFECTS.get(name)
    first, *others = effect.sized(particulars(ship, draw).L)
    if effect.per_run:
        rng = np.random.default_rng(draw)
        return Hidden(effect, tuple(size * rng.standard_normal(Trials().runs) for _ in effect.parameters))
    return Hidden(effect, (float(np.copysign(size, first.typical)), *(p.typical if p.shape else 0.0 for p in others)))


def named(job: tuple[str, float, float], ship: int, draw: int) -> tuple[bool, list[str]] | None:
    """Whether (effect, size, factor) is named, and what is; None where this ship knows no such effect."""
    name, size, factor = job
    size = size / factor if name.endswith("_rate_limit") else size * factor
    try:
        data = trials(ship, draw, draw, [hidden(name, size, ship, draw)])
    except InputError:
        return None
    causes = [c.effect for c in diagnose(data, gain=False).causes if c.effect != "hull_derivatives"]
    return name in causes, causes


def main() -> None:
    """A line for each ship and factor, with the effects that go against what was said."""
    given = measure.options(__doc__, runs=1, cases=SHIPS)
    measure.header(given)
    total: dict[float, list[bool]] = defaultdict(list)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for ship in [SHIPS.index(s) for s in given.only or (SHIPS[1], SHIPS[2], SHIPS[5])]:
            for draw in range(given.runs):
                sizes = smallest(ship, draw)
                kept = dict(list(sizes.items())[:2]) if given.quick else sizes
                jobs = [(name, size, factor) for factor in FACTORS for name, size in kept.items()]
                outcomes = list(pool.map(partial(named, ship=ship, draw=draw), jobs))
                for factor in FACTORS:
                    here = [
                        (job, seen)
                        for job, seen in zip(jobs, outcomes, strict=True)
                        if job[2] == factor and seen is not None
                    ]
                    against = [
                        f"{job[0]} ({', '.join(seen[1]) or 'none'})" for job, seen in here if seen[0] != (factor > 1.0)
                    ]
                    total[factor] += [seen[0] for _, seen in here]
                    line = (
                        f"{SHIPS[ship]}, {factor:g} times the smallest size: named "
                        f"{sum(seen[0] for _, seen in here)} of {len(here)}"
                    )
                    measure.record(given, {"ship": SHIPS[ship], "factor": factor, "line": line, "against": against})
                    print(line, *against, sep="; ", flush=True)
    print(*(f"all, {factor:g} times: named {sum(seen)} of {len(seen)}" for factor, seen in total.items()), sep="; ")


if __name__ == "__main__":
    main()
