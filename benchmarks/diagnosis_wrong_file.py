"""The diagnosis with the ship file of another ship, which may be a slip of the user: what it says of it, and what it
names. About 6 minutes.

    python benchmarks/diagnosis_wrong_file.py [--runs DRAWS] [--only SHIP ...] [--quick] [--json FILE]

Seven ships sail with nothing hidden (drawn variants of KCS and KVLCC2; Mariner, a tanker, S175 and a navy ship in their
authors' equations) and are diagnosed with the file of each of the six others.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import measure
from seven_ships import SHIPS, particulars, trials

from shipbench.diagnosis.diagnose import diagnose


def outcome(job: tuple[int, int, int]) -> tuple[str, list[str]]:
    """What the verdict says of the ship file, and what it names, for (ship, file, draw)."""
    sails, file, draw = job
    found = diagnose(replace(trials(sails, draw, draw), ship=particulars(file, draw)), gain=False)
    asks = [w for w in found.warnings if "Is the ship file" in w]
    said = "no word" if not asks else "doubted" if "nothing is named but" in asks[0] else "a warning"
    return said, [c.effect for c in found.causes if c.effect != "hull_derivatives"]


def summary(found: Sequence[tuple[str, list[str]]]) -> str:
    """The counts in words."""
    of = Counter(said for said, _ in found)
    unsaid = sum(said == "no word" and bool(names) for said, names in found)
    silent = sum(not names for _, names in found)
    return (
        f"of {len(found)} files doubted {of['doubted']}, warned of {of['a warning']}; nothing named {silent}, "
        f"named without a word {unsaid}"
    )


def main() -> None:
    """One line a ship, and the sum."""
    given = measure.options(__doc__, runs=1, cases=SHIPS)
    measure.header(given)
    total: list[tuple[str, list[str]]] = []
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        for ship in given.only or (SHIPS[:1] if given.quick else SHIPS):
            jobs = [
                (SHIPS.index(ship), file, draw)
                for draw in range(given.runs)
                for file in range(len(SHIPS))
                if SHIPS[file] != ship
            ]
            found = list(pool.map(outcome, jobs))
            named = [
                f"file of {SHIPS[job[1]]}, {said}: {', '.join(names)}"
                for job, (said, names) in zip(jobs, found, strict=True)
                if names
            ]
            measure.record(given, {"ship": ship, "summary": summary(found), "named": named})
            total += found
            print(f"{ship}: {summary(found)}", *named, sep="; ", flush=True)
    print(f"all: {summary(total)}")


if __name__ == "__main__":
    main()
