"""Names and words of others as text of a page, one function for each format, and the pages' policy. HTML: `html.escape`; terminals: `names.shown`."""

from __future__ import annotations

import base64
import hashlib
import re
from collections.abc import Sequence

from ..names import shown

_LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_", "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}", "<": "$<$", ">": "$>$", "|": "$|$", "\u03bc": r"$\mu$", "\u03c3": r"$\sigma$",
}  # fmt: skip
_HTML_IN_MARKDOWN = re.compile(r"<(?=[A-Za-z/!?])|&(?=#|[A-Za-z][A-Za-z0-9]*;)")
"""What Markdown would take for a tag, a comment or an entity; "<0.001" is none."""
_LINK_IN_MARKDOWN = re.compile(r"\](?=[(\[])")
_FORMULA = ("=", "+", "-", "@", "\uff1d", "\uff0b", "\uff0d", "\uff20")
"""First characters of a formula in spreadsheets, also in their full-width forms."""


def one_line(text: str) -> str:
    """Text in one line, without unseen characters."""
    return shown(" ".join(text.splitlines()))


def markdown_text(text: str) -> str:
    """Any text in one line of Markdown: no HTML, no links or images."""
    plain = _HTML_IN_MARKDOWN.sub(lambda match: "&lt;" if match[0] == "<" else "&amp;", one_line(text))
    return _LINK_IN_MARKDOWN.sub(r"]\\", plain)


def latex_text(text: str) -> str:
    """Any text in one line of LaTeX, with what it would take as a command escaped; `code` in typewriter."""
    parts = re.split(r"`([^`]*)`", one_line(text))
    escaped = ["".join(_LATEX.get(c, c) for c in part) for part in parts]
    line = "".join(rf"\texttt{{{part}}}" if i % 2 else part for i, part in enumerate(escaped))
    return f"{{}}{line}" if line.startswith(("[", "*")) else line  # at the beginning of a row they would belong to the \\ before


def csv_text(text: str) -> str:
    """Any text as a cell of CSV that no spreadsheet computes: an apostrophe before what begins like a formula and is no number."""
    if not text.lstrip().startswith(_FORMULA) or len(text.strip()) == 1:
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text


def content_policy(style: str, script: str = "", *, images: bool = False, style_attributes: bool = False) -> str:
    """The content security policy of a page: it fetches nothing and runs nothing but this style and script.

    Args:
        style, script: the content of the page's style and script elements, each by its digest.
        images: whether it holds pictures (`data:`).
        style_attributes: whether its drawings have attributes `style`, which cannot fetch anything.
    """
    rules = ["default-src 'none'", "base-uri 'none'", "form-action 'none'"]
    if style_attributes:
        rules += [f"style-src-elem {_digests([style])}", "style-src-attr 'unsafe-inline'"]
    else:
        rules.append(f"style-src {_digests([style])}")
    rules += [f"script-src {_digests([script])}"] if script else []
    rules += ["img-src data:"] if images else []
    return "; ".join(rules)


def _digests(contents: Sequence[str]) -> str:
    """Digests by which a browser knows what it may use, whatever a name in the page may hold."""
    return " ".join(f"'sha256-{base64.b64encode(hashlib.sha256(content.encode()).digest()).decode()}'" for content in contents)
