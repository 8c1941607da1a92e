"""Escaping of user text on a page, one function for each format. HTML: `html.escape`; terminals: `names.shown`."""

from __future__ import annotations

import re

from ..names import shown

_LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}", "<": "$<$", ">": "$>$", "|": "$|$", "\u03bc": r"$\mu$", "\u03c3": r"$\sigma$",
}  # fmt: skip
_HTML_IN_MARKDOWN = re.compile(r"<(?=[A-Za-z/!?])|&(?=#|[A-Za-z][A-Za-z0-9]*;)")
"""Text that Markdown would take for a tag, a comment or an entity; "<0.001" is none."""
_LINK_IN_MARKDOWN = re.compile(r"\](?=[(\[])")
_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""First characters of a formula in spreadsheets, also in their full-width forms."""


def one_line(text: str) -> str:
    """Text in one line, without unseen characters."""
    return shown(" ".join(text.splitlines()))


def markdown_text(text: str) -> str:
    """Text in one line of Markdown: no HTML, no links or images."""
    plain = _HTML_IN_MARKDOWN.sub(lambda match: "&lt;" if match[0] == "<" else "&amp;", one_line(text))
    return _LINK_IN_MARKDOWN.sub(r"]\\", plain)


def latex_text(text: str) -> str:
    """Text in one line of LaTeX with commands escaped; `code` in typewriter."""
    parts = re.split(r"`([^`]*)`", one_line(text))
    escaped = ["".join(_LATEX.get(c, c) for c in part) for part in parts]
    line = "".join(rf"\texttt{{{part}}}" if i % 2 else part for i, part in enumerate(escaped))
    return (
        f"{{}}{line}" if line.startswith(("[", "*")) else line
    )  # at the beginning of a row they would belong to the \\ before


def csv_text(text: str) -> str:
    """Text of a CSV cell that no spreadsheet computes: an apostrophe precedes text that begins like a formula and is no
    number."""
    if not text.lstrip().startswith(_FORMULA) or len(text.strip()) == 1:
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text
