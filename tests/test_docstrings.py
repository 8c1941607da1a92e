"""Docstrings of the package begin with a noun or a verb, and each public function has one (CONTRIBUTING.md)."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parent.parent / "shipbench"
BAD_BEGINNING = re.compile(
    r"\s*(\(|(as|because|beside|but|by|for|from|how|likewise|of|so|that|then|there|what|when|where|which|who|whose"
    r"|why|with|without)\b)",
    re.IGNORECASE,
)
"""First words, or a bare shape, that leave open what thing is described."""


@pytest.fixture(scope="module")
def trees() -> dict[str, ast.Module]:
    return {
        str(path.relative_to(PACKAGE)): ast.parse(path.read_text("utf-8")) for path in sorted(PACKAGE.rglob("*.py"))
    }


def docstrings(tree: ast.Module) -> Iterator[ast.Constant]:
    """Docstrings of the module and of its classes, functions and attributes: texts that are statements."""
    for node in ast.walk(tree):
        match node:
            case ast.Expr(ast.Constant(str()) as text):
                yield text


def test_docstrings_begin_with_the_thing_they_describe(trees: dict[str, ast.Module]):
    found = [
        f"{name}:{text.lineno}: {text.value.strip()[:60]}"
        for name, tree in trees.items()
        for text in docstrings(tree)
        if BAD_BEGINNING.match(text.value)
    ]
    assert not found, "\n".join(found)


def test_each_public_function_has_a_docstring(trees: dict[str, ast.Module]):
    without = [
        f"{name}:{node.lineno}: {node.name}"
        for name, tree in trees.items()
        for node in tree.body
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_") and not ast.get_docstring(node)
    ]
    assert not without, "\n".join(without)
