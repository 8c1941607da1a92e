"""Numbers that decide stand in one table per package, with unit, meaning and evidence."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import pytest
from markdown.extensions.toc import slugify

from shipbench.checking.reading import read_recording
from shipbench.checking.thresholds import THRESHOLDS as CHECKING
from shipbench.diagnosis.thresholds import THRESHOLDS
from shipbench.estimation.thresholds import THRESHOLDS as ESTIMATION
from shipbench.importing.thresholds import THRESHOLDS as IMPORTING
from shipbench.replay.thresholds import THRESHOLDS as REPLAY
from shipbench.suites.checks.clean_sets import base_set
from shipbench.suites.checks.faults import FAULTS
from shipbench.suites.checks.suite import write_planted
from shipbench.thresholds import Thresholds

ROOT = Path(__file__).parents[1]
ANCHORS = {
    slugify(line.lstrip("# "), "-")
    for line in (ROOT / "docs" / "calibration.md").read_text("utf-8").splitlines()
    if line.startswith("#")
}
TABLES = {
    "checking": CHECKING,
    "diagnosis": THRESHOLDS,
    "estimation": ESTIMATION,
    "importing": IMPORTING,
    "replay": REPLAY,
}
MOST = {"checking": 50, "diagnosis": 80}
"""Rows of a table at most: a new number takes the place of another one, or is one that stands already."""


@pytest.mark.parametrize("package", TABLES)
def test_every_number_says_what_it_is_and_rests_on_a_section_of_the_calibration(package: str) -> None:
    for row in TABLES[package].rows.values():
        assert row.unit, row
        assert len(row.meaning) > 10, row
        assert row.evidence in ANCHORS, row


@pytest.mark.parametrize("package", TABLES)
def test_every_number_is_used(package: str) -> None:
    folder = ROOT / "shipbench" / package
    code = "".join(p.read_text("utf-8") for p in folder.rglob("*.py") if p.name != "thresholds.py")
    own = TABLES[package].rows.keys() - (ESTIMATION.rows.keys() if package == "diagnosis" else set())
    assert not [name for name in own if f'("{name}")' not in code]


@pytest.mark.parametrize("package", MOST)
def test_few_numbers_decide(package: str) -> None:
    assert len(TABLES[package].rows) <= MOST[package]


@pytest.mark.long
def test_halving_and_doubling_a_number_shows_which_findings_it_decides(tmp_path: Path) -> None:
    path = ROOT / "benchmarks" / "threshold_effects.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    number = next(i for i, fault in enumerate(FAULTS) if fault.name == "yaw rate late")
    folder = write_planted(base_set("container130", script.SEED), FAULTS[number], script.SEED, tmp_path / "set")
    found = script.effects(("late", number, read_recording(str(folder))[0]), ["most", "chance", "wind_change"])
    assert found["most", 0.5] == (1, 0, "late: +[] -[('lag', ('r',))]")
    assert [found["chance", factor][0] for factor in script.FACTORS] == [0, 0]
    assert ("wind_change", 0.5) not in found  # no wind is recorded
    assert CHECKING.value("most") == script.ROWS["most"].value


def test_a_count_is_whole() -> None:
    with pytest.raises(KeyError):
        Thresholds().value("missing")
