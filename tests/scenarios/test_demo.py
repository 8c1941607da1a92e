"""The command `demo`: from a trial with a hidden current to its name, its size, a better model and a page."""

from __future__ import annotations

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

from shipbench.cli.app import app
from shipbench.data import demo
from shipbench.data.demo import SPEED, TOWARDS


@pytest.mark.long
def test_a_trial_too_short_to_name_its_current_has_all_lines_and_files_too(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    monkeypatch.setattr(demo, "RUNS", 3)
    monkeypatch.setattr(demo, "SAMPLES", 61)
    done = CliRunner().invoke(app, ["demo", "-q"])
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert len(lines) == 5
    assert lines[0].endswith("Found: nothing.")
    assert re.fullmatch(r".*held-out runs: hold [\d.]+ m, physics [\d.]+ m(, calibrated [\d.]+ m)?\.", lines[1])
    assert json.loads((tmp_path / "demo" / "diagnosis" / "diagnosis.json").read_text())["causes"] == []
    assert 'href="./diagnosis/report.html"' in (tmp_path / "demo" / "report.html").read_text()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["demo"]


@pytest.mark.long
def test_demo_finds_the_current_and_says_so_in_five_lines(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    done = CliRunner().invoke(app, ["demo", "-q"])
    assert done.exit_code == 0, done.output
    lines = done.stdout.splitlines()
    assert len(lines) == 5
    found = json.loads((tmp_path / "demo" / "diagnosis" / "diagnosis.json").read_text())
    assert [cause["effect"] for cause in found["causes"]] == ["current"]
    size = found["causes"][0]["parameters"]
    assert abs(size["speed"]["value"] - SPEED) < 0.05
    assert abs(size["to"]["value"] - TOWARDS) < np.deg2rad(5.0)
    errors = {name: float(value) for name, value in re.findall(r"(\S+) ([\d.]+) m[,.]", lines[1])}
    assert errors["calibrated+current"] < 0.5 * errors["physics"]
    page = (tmp_path / "demo" / "report.html").read_text()
    assert "calibrated+current" in page
    assert sorted(path.name for path in tmp_path.iterdir()) == ["demo"]
