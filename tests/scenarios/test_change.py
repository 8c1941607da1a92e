"""A cause that begins with a run: runs in the order in which they were sailed, and not where other manoeuvres begin
with it."""

from __future__ import annotations

from dataclasses import replace
from datetime import UTC, date, datetime

import numpy as np
import pytest

from shipbench.diagnosis.diagnose import diagnose
from shipbench.effects.base import EFFECTS
from shipbench.physics.mmg import load_mmg_ship
from shipbench.records import Dataset, Run
from shipbench.simulate.hidden import Hidden
from shipbench.simulate.trials import Trials, sea_trials

RUNS, BEGINS = 12, 6


def changed(**meta: object) -> Dataset:
    """A compass error from the seventh run on; meta: key of the runs' metadata, and its value for each."""
    values = np.where(np.arange(RUNS) >= BEGINS, 0.04, 0.0)
    data = sea_trials(
        load_mmg_ship("kcs"), 3, (Hidden(EFFECTS.get("heading_bias"), (values,)),), Trials(runs=RUNS, samples=90)
    )
    return data.with_runs(
        [replace(r, meta={**r.meta.as_dict(), **{k: v[i] for k, v in meta.items()}}) for i, r in enumerate(data.runs)]
    )


@pytest.mark.long
def test_runs_are_taken_in_the_order_in_which_they_were_sailed():
    data = changed(**{"from": [f"2026-05-0{1 + i // 4} 1{i % 4}:30:00+02:00" for i in range(RUNS)]})
    shuffled = data.with_runs([data.runs[i] for i in np.random.default_rng(0).permutation(RUNS)])
    cause = diagnose(shuffled, gain=False).causes[0]
    assert (cause.effect, cause.parameters["from_run"].value) == ("change_point", BEGINS)
    assert f"begins with run {data.runs[BEGINS].id}" in cause.evidence


@pytest.mark.long
def test_a_change_is_named_among_mixed_manoeuvres_and_not_where_other_manoeuvres_begin():
    mixed, apart = changed(manoeuvre=["turn", "zigzag"] * 6), changed(manoeuvre=["turn"] * BEGINS + ["zigzag"] * BEGINS)
    assert [c.effect for c in diagnose(mixed, gain=False).causes] == ["change_point"]
    verdict = diagnose(apart, gain=False)
    assert "change_point" not in [c.effect for c in verdict.causes]
    assert (
        "not looked for at 7 of 7 places"
        in next(c for c in verdict.candidates if c.effect == "change_point").rejected_because
    )


@pytest.mark.parametrize(
    ("given", "began"),
    [
        ("2026-05-01T10:30:00Z", datetime(2026, 5, 1, 10, 30, tzinfo=UTC)),
        ("2026-05-01 10:30", datetime(2026, 5, 1, 10, 30, tzinfo=UTC)),
        (datetime(2026, 5, 1), datetime(2026, 5, 1, tzinfo=UTC)),
        (date(2026, 5, 1), datetime(2026, 5, 1, tzinfo=UTC)), (12.5, None), (None, None),
    ],
)  # fmt: skip
def test_when_a_run_began_is_read_from_its_metadata(given: object, began: datetime | None):
    run = Run("a", np.arange(2.0), np.zeros((2, 10)), np.zeros((2, 4)), meta={"from": given})
    assert run.began == began
