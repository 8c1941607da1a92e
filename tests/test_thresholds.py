"""Numbers that decide stand in one table per package, with unit, meaning and evidence."""

from __future__ import annotations

from pathlib import Path

import pytest
from markdown.extensions.toc import slugify

from shipbench.checking.thresholds import THRESHOLDS as CHECKING
from shipbench.diagnosis.thresholds import THRESHOLDS
from shipbench.importing.thresholds import THRESHOLDS as IMPORTING
from shipbench.thresholds import Thresholds

ROOT = Path(__file__).parents[1]
ANCHORS = {
    slugify(line.lstrip("# "), "-")
    for line in (ROOT / "docs" / "calibration.md").read_text("utf-8").splitlines()
    if line.startswith("#")
}
TABLES = {"checking": CHECKING, "diagnosis": THRESHOLDS, "importing": IMPORTING}


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
    assert not [name for name in TABLES[package].rows if f'("{name}")' not in code]


def test_the_diagnosis_decides_by_few_numbers() -> None:
    """A new number takes the place of another one, or is one that stands already: same question, same number."""
    assert len(THRESHOLDS.rows) <= 80


def test_a_count_is_whole() -> None:
    with pytest.raises(KeyError):
        Thresholds().value("missing")
