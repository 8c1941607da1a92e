"""Names and texts of users inside source code."""

from __future__ import annotations

import re

import casadi as ca
import pytest

from shipbench.errors import InputError
from shipbench.exporting.language import ARITHMETIC, LONGEST, comment, identifier, statements


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("container130_physics", "container130_physics"), ("Esso Osaka", "Esso_Osaka"), ("3 masts", "m_3_masts"),
        ("", "m"), ("while", "m_while"), ("a__b_", "a_b"), ("x; system('rm')", "x_system_rm"), ("Ærø é", "r_e"),
        ("日本丸", "m"), ("../../etc", "etc"), ("a" * 99, "a" * LONGEST),
    ],
)  # fmt: skip
def test_any_text_becomes_a_legal_name(text, name):
    assert identifier(text) == name
    assert re.fullmatch(r"[A-Za-z][A-Za-z0-9_]{0,62}", name)
    assert identifier(name) == name


@pytest.mark.parametrize(
    "text", ["*/ x", "**//", "a\n*/", "/*", "??/", "???/", "end\\", "\x1b[2J", "\u2028*/", "½ · √"]
)
def test_a_comment_holds_nothing_that_ends_it(text):
    found = comment(text, " * ")
    assert found.isascii()
    for line in found.splitlines():
        assert line.startswith(" *")
        inside = line[2:]
        assert not any(bad in inside for bad in ("*/", "/*", "??", "\\", "\x1b"))


def test_long_lines_of_a_comment_are_wrapped():
    assert max(map(len, comment("word " * 100, "%").splitlines())) < 120


def test_an_operation_that_the_language_has_not_is_refused():
    x = ca.SX.sym("x")
    with pytest.raises(InputError, match=r"holds the operation ERF.*--format casadi"):
        statements(ca.Function("f", [x], [ca.erf(x)]), ARITHMETIC, ["x[{}]"], ["y[{}]"])
    with pytest.raises(InputError, match="holds the number inf"):
        statements(ca.Function("f", [x], [x + ca.SX.inf()]), ARITHMETIC, ["x[{}]"], ["y[{}]"])
    assert statements(ca.Function("f", [x], [x + 2]), ARITHMETIC, ["x({})"], ["y({})"], first=1)[-1] == "y(1) = a0;"
