"""The words of README and documentation: sentences that are understood at first sight, in the written pages and in the
generated ones."""

from __future__ import annotations

import importlib.util
import json
import re
import sys
from pathlib import Path
from statistics import median
from types import SimpleNamespace

import pytest

from shipbench.effects.base import EFFECTS

pytest.importorskip("yaml", reason="mkdocs is not installed (extra `docs`)")
ROOT = Path(__file__).parents[1]
PAGES = [
    ROOT / "README.md",
    *sorted((ROOT / "docs").glob("*.md")),
    *sorted((ROOT / "docs" / "notebooks").glob("*.ipynb")),
]
LONGEST, MEDIAN = 35, 18
"""Most words of a sentence, and of the median of a page (CONTRIBUTING.md)."""
_NO_PROSE = re.compile(
    r"^```[\s\S]*?^```$|<svg[\s\S]*?</svg>|<!--[\s\S]*?-->|</?[a-z][^>]*>|^#.*$|^ *\|.*$|^:::.*$|^    "
    r".*$|\$\$[\s\S]+?\$\$|^\s*\[!\[.*$",
    re.MULTILINE,
)
_WORDS_OF_ONE = re.compile(r"`[^`]*`|\$[^$\n]+\$|https?://\S+")
_FORMULA = re.compile(r"\S+ = .*?(?=[,;:]|\.(?:\s|$))", re.DOTALL)
_WORD = re.compile(r"(?!\W*(?:sin|cos|exp|sqrt)\W*$)[\W_]*(?:a|A|I|\d|[\w'.,%°/-]{2,}(?:\([\w ]*\))?)[\W_]*")
"""A word or number; a symbol of one letter, an operator and a function are of a formula."""
_ABBREVIATION = re.compile(r"\b([Ee]q|al|vs|No|Fig|ch|sec|e\.g|i\.e|approx|[A-Z])\.")


def sentences(markdown: str) -> list[str]:
    """The sentences of a page, without code, tables, formulas, headings; code and a formula inside a sentence count as
    one word."""
    text = _NO_PROSE.sub("", markdown.replace("\r", ""))
    text = _WORDS_OF_ONE.sub("code", re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", text))
    text = _FORMULA.sub("", text)
    blocks = re.split(r"\n\s*\n|\n\s*(?:[-*]|\d+\.) +", f"\n{text}")
    found = (
        part
        for block in blocks
        for part in re.split(r"(?<=[.!?])[*)\"]*\s+", _ABBREVIATION.sub(r"\1", block.strip(" \n-*")))
    )
    return [" ".join(part.split()) for part in found if len(_words(part)) > 1]


def _words(sentence: str) -> list[str]:
    return [word for word in sentence.split() if _WORD.fullmatch(word)]


def _hooks():
    """The hooks of the site that write tables and pictures into pages."""
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        for path in sorted((ROOT / "docs").glob("*_hook.py")):
            if path.stem != "math_hook":  # formulas are left out here
                spec = importlib.util.spec_from_file_location(path.stem, path)
                module = importlib.util.module_from_spec(spec)
                spec.loader.exec_module(module)
                if hasattr(module, "on_page_markdown"):
                    vars(module)["_picture"] = lambda effect: None  # only words are read here
                    yield module
    finally:
        sys.path.remove(str(ROOT / "docs"))


HOOKS = list(_hooks())


def generated(page: Path) -> str:
    """The page as the site has it, before it becomes HTML."""
    text = page.read_text("utf-8")
    if page.suffix == ".ipynb":
        return "\n\n".join(
            "".join(cell["source"]) for cell in json.loads(text)["cells"] if cell["cell_type"] == "markdown"
        )
    for hook in HOOKS:
        text = hook.on_page_markdown(text, SimpleNamespace(file=SimpleNamespace(src_path=page.name)), None, None)
    return text


@pytest.mark.parametrize("page", PAGES, ids=lambda p: p.stem)
def test_sentences_are_short(page: Path) -> None:
    counts = {sentence: len(_words(sentence)) for sentence in sentences(generated(page))}
    assert not [f"{count} words: {sentence}" for sentence, count in counts.items() if count > LONGEST]
    assert not counts or median(counts.values()) <= MEDIAN


def test_sentences_are_parted_and_counted() -> None:
    text = (
        "# Head\n\nOne `a b c` two, see [three four](x.md). Eq. (2) of Wakita et al. (2022) holds: y = a x b c.\n"
        "\n| a | b |\n"
    )
    text += "\n- five six\n- seven $x + y$ eight\n"
    assert [len(_words(s)) for s in sentences(text)] == [6, 8, 2, 3]


def test_the_catalogue_of_causes_has_a_picture_of_each() -> None:
    sys.path.insert(0, str(ROOT / "docs"))
    try:
        import effects_hook
    finally:
        sys.path.remove(str(ROOT / "docs"))
    assert effects_hook._picture(EFFECTS.get("current")).startswith('<svg role="img" aria-label="current: tracks')
    assert effects_hook._picture(EFFECTS.get("unit_or_sign_error")) is None


def test_readme_has_no_commit_and_no_date() -> None:
    text = (ROOT / "README.md").read_text("utf-8")
    assert not re.findall(
        r"\b(?=[0-9a-f]*\d)(?=[0-9a-f]*[a-f])[0-9a-f]{7,40}\b|\b(?:19|20)\d\d-\d\d-\d\d\b|\b\d{1,2}\.\d{1,2}\.20\d\d\b",
        text,
    )
