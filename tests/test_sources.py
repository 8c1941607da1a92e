"""Every source that the code names is something a reader can open."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from markdown.extensions.toc import slugify

from shipbench.effects.base import EFFECTS

ROOT = Path(__file__).parents[1]
ANCHORS = {
    slugify(line.lstrip("# "), "-")
    for line in (ROOT / "docs" / "theory.md").read_text("utf-8").splitlines()
    if line.startswith("#")
}
CITED = re.compile(r"docs/theory\.md#([\w-]+)")
LITERATURE = re.compile(r"\(\d{4}\)|SOLAS|source paper")


@pytest.mark.parametrize("name", EFFECTS.names())
def test_an_effect_names_a_section_of_the_theory_or_literature(name: str) -> None:
    source = EFFECTS.get(name).source
    assert CITED.search(source) or LITERATURE.search(source), source


def test_every_section_that_the_code_cites_exists() -> None:
    cited = {
        (path.name, anchor)
        for path in (ROOT / "shipbench").rglob("*.py")
        for anchor in CITED.findall(path.read_text("utf-8"))
    }
    assert {anchor for _, anchor in cited} <= ANCHORS, sorted(c for c in cited if c[1] not in ANCHORS)
    assert len(cited) > 20


def test_no_source_is_a_document_that_is_not_published() -> None:
    texts = [*(ROOT / "shipbench").rglob("*.py"), *(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    assert not [p for p in texts if re.search(r"physics reference|diagnosis methods", p.read_text("utf-8"))]
