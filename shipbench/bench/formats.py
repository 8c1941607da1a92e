"""A leaderboard as Markdown, LaTeX, CSV and one static HTML page."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError, unknown_name
from .tables import Table

if TYPE_CHECKING:
    from .leaderboard import Board

FORMATS = {"md": ".md", "latex": ".tex", "csv": ".csv", "html": ".html"}
"""Name of a format -> suffix of its file."""

_LATEX = {
    "\\": r"\textbackslash{}", "{": r"\{", "}": r"\}", "$": r"\$", "&": r"\&", "#": r"\#", "%": r"\%", "_": r"\_", "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}", "<": "$<$", ">": "$>$", "|": "$|$", "\u03bc": r"$\mu$", "\u03c3": r"$\sigma$",
}  # fmt: skip


def check_formats(formats: Sequence[str]) -> None:
    """Refuse a format that is not known.

    Raises:
        InputError: as said, or none is given.
    """
    if not formats:
        raise InputError(f"--format: no format is given; accepted: {', '.join(FORMATS)}, several with commas between.")
    for name in formats:
        if name not in FORMATS:
            raise unknown_name("format", name, list(FORMATS))


def render(board: Board, name: str, command: str, images: Sequence[Path], folder: Path) -> tuple[str, str]:
    """Suffix and text of `board` in the format `name`; `images` are its plots, `folder` is where the page will lie."""
    if name == "md":
        text = board.markdown(command, [path.relative_to(folder).as_posix() for path in images])
    elif name == "latex":
        text = latex(board, command)
    elif name == "csv":
        text = csv(board)
    else:
        text = html(board, command, images)
    return FORMATS[name], text


def latex_text(text: str) -> str:
    """Any text with what LaTeX would take as a command escaped; `code` in typewriter."""
    parts = re.split(r"`([^`]*)`", text)
    escaped = ["".join(_LATEX.get(c, c) for c in part) for part in parts]
    return "".join(rf"\texttt{{{part}}}" if i % 2 else part for i, part in enumerate(escaped))


def latex(board: Board, command: str) -> str:
    """Tables for `\\input`; they need the packages booktabs and graphicx."""
    parts = [f"% {board.title}. Rendered by: {command}", *[f"% {line}" for line in board.head], r"% \usepackage{booktabs,graphicx}", ""]
    for table in board.tables:
        parts += [
            r"\begin{table}[tbp]", r"\centering", rf"\caption{{{latex_text(f'{board.dataset}: {table.title}')}}}", r"\resizebox{\textwidth}{!}{%",
            _latex_tabular(table) + "}", *[rf"\par\footnotesize {latex_text(note)}" for note in table.notes], r"\end{table}", "",
        ]  # fmt: skip
    return "\n".join(parts)


def _latex_tabular(table: Table) -> str:
    import pandas as pd

    def cell(column: Any, row: dict[str, Any]) -> str:
        text, between = latex_text(column.text(row)), latex_text(column.interval_text(row))
        text = rf"\textit{{{text}}}" if row.get("_reference") and text else text
        return rf"\shortstack[r]{{{text}\\{{\scriptsize {between}}}}}" if between else text

    frame = pd.DataFrame([[cell(c, row) for c in table.columns] for row in table.rows], columns=[latex_text(c.header) for c in table.columns])
    layout = "".join("r" if c.format else "l" for c in table.columns)
    return frame.to_latex(index=False, escape=False, column_format=layout).rstrip()


def csv(board: Board) -> str:
    """One line per figure: data set, table, row (its text cells), figure, value (not rounded), ends of the 95 % interval."""
    import pandas as pd

    lines = []
    for table in board.tables:
        names = [c for c in table.columns if c.format is None]
        for row in table.as_json()["rows"]:
            label = {
                "dataset": board.dataset,
                "table": table.title,
                "row": " | ".join(str(row[c.key]) for c in names if row[c.key] not in (None, "")),
            }
            for column in (c for c in table.columns if c.format is not None):
                ends = {end: row.get(f"{column.key}_{end}") for end in ("low", "high")}
                lines.append(label | {"figure": column.header, "value": row[column.key], **ends})
    return pd.DataFrame(lines, columns=["dataset", "table", "row", "figure", "value", "low", "high"]).to_csv(index=False, lineterminator="\n")


def html(board: Board, command: str, images: Sequence[Path]) -> str:
    """One page that needs no network and no other file."""
    from jinja2 import Environment, FileSystemLoader
    from markupsafe import Markup

    def marked(text: str) -> Markup:
        return Markup(re.sub(r"`([^`]*)`", r"<code>\1</code>", escape(text)))

    pages = Environment(loader=FileSystemLoader(Path(__file__).with_name("templates")), autoescape=True, trim_blocks=True)
    pages.filters["marked"] = marked
    drawn = [{"name": p.stem.replace("-", " "), "source": f"data:image/png;base64,{base64.b64encode(p.read_bytes()).decode()}"} for p in images]
    about = [*board.head, f"Rendered by `{command}`."]
    return pages.get_template("leaderboard.html").render(title=board.title, about=about, tables=board.tables, images=drawn) + "\n"
