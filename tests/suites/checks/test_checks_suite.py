"""`shipbench suite check`: the page counts what was found, what was not, and the false findings."""

from __future__ import annotations

from dataclasses import replace

import pytest
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.suites.checks import suite as check_suite
from shipbench.suites.checks.clean_sets import base_set
from shipbench.suites.checks.faults import FAULTS, Fault


@pytest.fixture
def small(monkeypatch):
    """Two faults, one of which is none, in one set; two clean sets, one of which is not clean."""
    rudder = next(f for f in FAULTS if f.name == "rudder sign")
    nothing = Fault("heading sign", lambda planting: None, [("sign", None)])
    data = base_set("kcs", 311)
    copied = data.with_runs([*data.runs, replace(data.runs[3], id="copy")])
    monkeypatch.setattr(check_suite, "FAULTS", (rudder, nothing))
    monkeypatch.setattr(check_suite, "sources_of", lambda wind: ("kcs",))
    monkeypatch.setattr(check_suite, "clean_sets", lambda seeds: [("good", lambda: data), ("bad", lambda: copied)])


@pytest.mark.long
def test_the_page_holds_the_counts(small, tmp_path):
    result = CliRunner().invoke(app, ["suite", "check", "--seeds", "1", "--out", str(tmp_path), "--quiet"])
    assert result.exit_code == 0, result.output
    page = (tmp_path / "check.md").read_text()
    rows = {cells[1]: cells[2:-1] for line in page.splitlines() if (cells := [c.strip() for c in line.split("|")])[1:]}
    assert rows["rudder sign"][1] == "1 of 1"
    assert rows["rudder sign"][4] == "1 of 1"
    assert rows["heading sign"][1] == "0 of 1"
    assert "Found 1 of 2 (50.0%" in page
    assert rows["good"][:2] == ["1", "0"]
    assert rows["bad"][:2] == ["1", "1"]
    assert not list(tmp_path.glob(".*"))


def test_no_seeds_are_refused(tmp_path):
    result = CliRunner().invoke(app, ["suite", "check", "--seeds", "0", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "--seeds 0" in result.stderr
    assert not list(tmp_path.iterdir())
