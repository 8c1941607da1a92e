"""A clock that is set back or ahead while the log goes on is named as that where the motion shows it; a gap and a jump
are not."""

from __future__ import annotations

import pandas as pd
import pytest

from shipbench.checking.base import check_path
from shipbench.checking.finding import Finding
from shipbench.suites.checks.clean_sets import base_set
from shipbench.suites.checks.faults import FAULTS
from shipbench.suites.checks.suite import write_planted

BY_NAME = {fault.name: fault for fault in FAULTS}


def found(name: str, folder) -> list[Finding]:
    return check_path(str(write_planted(base_set("container130", 311), BY_NAME[name], 311, folder)))[1]


def test_a_clock_set_back_in_a_turn_is_one_finding_with_its_seconds(tmp_path):
    (finding,) = [f for f in found("clock set back", tmp_path / "set") if f.kind == "clock step"]
    assert finding.evidence["seconds"] == pytest.approx(6.0, abs=1.0)
    assert "cut" in finding.line


def test_a_clock_set_ahead_in_a_gap_is_noted(tmp_path):
    (finding,) = [f for f in found("clock set ahead", tmp_path / "set") if f.kind == "clock step"]
    assert finding.evidence["seconds"] == pytest.approx(6.0, abs=1.0)
    assert (finding.severity, finding.line) == ("note", "")


@pytest.mark.long
@pytest.mark.parametrize("name", ["gaps", "jump of position", "jump of heading"])
def test_what_no_clock_did_is_not_put_down_to_it(name, tmp_path):
    assert "clock step" not in {f.kind for f in found(name, tmp_path / "set")}


def test_after_a_clock_that_was_set_back_nothing_is_sorted_into_the_rows_before(tmp_path):
    """Two recordings under one name, whose times overlap."""
    folder = write_planted(base_set("container130", 311), None, 311, tmp_path / "set")
    table = pd.read_parquet(folder / "trajectories.parquet")
    at = table.index[table["trajectory"] == "run03"]
    table.loc[at[60:], "t"] -= 10.0 * (table["t"][1] - table["t"][0])
    table.to_parquet(folder / "trajectories.parquet", index=False)
    kinds = [f.kind for f in check_path(str(folder))[1]]
    assert kinds[0] == "time runs back"
    assert not set(kinds) & {"outliers", "jump", "scale", "lag"}
