"""The diagnosis with the ship file of another ship, which may be a slip of the user: what it says of it, and what it names. About 6 minutes.

    python benchmarks/diagnosis_wrong_file.py [--runs DRAWS] [--only SHIP ...] [--quick] [--json FILE]

Seven ships sail with nothing hidden (drawn variants of KCS and KVLCC2; Mariner, a tanker, S175 and a navy ship in their authors' equations) and are
diagnosed with the file of each of the six others.
"""

from __future__ import annotations

from collections import Counter
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import measure
from seven_ships import SHIPS, particulars, trials

from shipbench.diagnosis.diagnose import diagnose


def outcome(job: tuple[int, int, int]) -> tuple[bool, list[str]]:
    """Whether the ship file is doubted, and what is named, for (ship, file, draw)."""
    sails, file, draw = job
    found = diagnose(replace(trials(sails, draw, draw), ship=particulars(file, draw)), gain=False)
    return any("Is the ship file" in w for w in found.warnings), [c.effect for c in found.causes if c.effect != "hull_derivatives"]


def main() -> None:
    """One line a ship, and the sum."""
    given = measure.options(__doc__, runs=1, cases=SHIPS)
    measure.header(given)
    total: Counter[str] = Counter()
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for ship in given.only or (SHIPS[:1] if given.quick else SHIPS):
            jobs = [(SHIPS.index(ship), file, draw) for draw in range(given.runs) for file in range(len(SHIPS)) if SHIPS[file] != ship]
            found = dict(zip(jobs, pool.map(outcome, jobs), strict=True))
            doubted, silent = sum(d for d, _ in found.values()), sum(not names for _, names in found.values())
            said = [f"file of {SHIPS[j[1]]}{', doubted' if doubt else ''}: {', '.join(names)}" for j, (doubt, names) in found.items() if names]
            measure.record(given, {"ship": ship, "doubted": doubted, "silent": silent, "of": len(jobs), "named": said})
            total.update(doubted=doubted, silent=silent, of=len(jobs))
            print(f"{ship}: of {len(jobs)} doubted {doubted}, nothing named {silent}", *said, sep="; ", flush=True)
    print(f"all: of {total['of']} doubted {total['doubted']}, nothing named {total['silent']}")


if __name__ == "__main__":
    main()
