"""A simulation of another structure than shipbench's physics lacks one cause that the ship has: it must be named, and
the correction must help on runs that were not used.

`python tests/scenarios/test_own_simulation_lacks_a_cause.py FIRST LAST` prints the outcome of further draws.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

import pytest

sys.path.insert(0, str(Path(__file__).parents[1]))  # as a script
from foreign_ship import SIZES, simulate, trial

from shipbench.diagnosis.diagnose import diagnose
from shipbench.diagnosis.evaluation.own_simulation import OwnSimulation
from shipbench.predictors.physics_model.correction import Correction, correctable
from shipbench.specs import spec_of


def outcome(cause: str | None, seed: int) -> dict[str, Any]:
    """Causes named from 20 runs, and errors [m] on 8 others: of the simulation, corrected by coefficients alone, by the
    true cause's name, and by the causes named."""
    data, value = trial(cause, seed, runs=28)
    train, held = data.subset(range(20)), data.subset(range(20, 28))
    found = diagnose(train, gain=False, simulation=spec_of(simulate))
    own = OwnSimulation(spec_of(simulate), train)
    beside, named = own.beside(train), [c.effect for c in found.causes]

    def error(causes: list[str]) -> float:
        return float(own.corrected(held, Correction.fit(beside, correctable(causes))).errors.mean())

    alone = float(own.alone(held).errors.mean())
    known = error([cause]) if cause else None
    return {
        "cause": cause, "size": value, "verdict": found.verdict, "named": named, "alone": alone,
        "coefficients": error([]), "known": known, "found": error(named),
    }  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(("cause", "seed"), [("current", 1000), ("rudder_offset", 1002), ("heading_bias", 1007)])
def test_the_cause_that_a_simulation_lacks_is_named_and_its_correction_helps(cause, seed):
    found = outcome(cause, seed)
    assert found["named"][:1] == [cause]
    assert found["alone"] - found["found"] > 0.9 * (found["alone"] - found["known"])


@pytest.mark.long
def test_what_other_coefficients_of_the_ship_do_as_well_gets_no_name_and_is_corrected_all_the_same():
    found = outcome("thrust_gain", 1004)
    assert found["named"] == []
    assert found["alone"] - found["found"] > 0.9 * (found["alone"] - found["known"])


@pytest.mark.long
def test_nothing_is_named_where_the_simulation_lacks_nothing():
    assert outcome(None, 1012)["named"] == []


def main(first: int, last: int) -> None:
    """Print one line a draw: 12 causes and 8 without, over and over."""
    drawn = [*SIZES, *[None] * 8]
    for seed in range(first, last):
        row = outcome(drawn[seed % len(drawn)], 1000 + seed)
        print(json.dumps(row, default=float), flush=True)


if __name__ == "__main__":
    main(*(int(v) for v in sys.argv[1:3]))
