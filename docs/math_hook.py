"""Turns formulas between dollar signs into MathML when the site is built, so that a page needs no script and no
network."""

from __future__ import annotations

import re
from html import escape
from typing import Any

_FENCED = re.compile(r"(^```.*?^```$|`[^`\n]*`)", re.DOTALL | re.MULTILINE)
_FORMULA = re.compile(r"\$\$(?P<display>.+?)\$\$|\$(?P<inline>[^$\n]+?)\$", re.DOTALL)


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Called by mkdocs for every page; code is left as it is."""
    parts = _FENCED.split(markdown)
    return "".join(part if i % 2 else _FORMULA.sub(_mathml, part) for i, part in enumerate(parts))


def _mathml(found: re.Match[str]) -> str:
    from latex2mathml.converter import convert

    display = found["display"] is not None
    formula = (found["display"] or found["inline"]).strip()
    made = convert(formula, display="block" if display else "inline")
    made = made.replace("<math ", f'<math alttext="{escape(formula, quote=True)}" ', 1)
    return (
        f"\n\n<div>{made}</div>\n\n" if display else f"<span>{made}</span>"
    )  # a line that begins with <math> would be a block of its own
