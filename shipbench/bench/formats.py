"""A leaderboard as Markdown, LaTeX, CSV and one static HTML page."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError, unknown_name
from ..names import shown
from ..render.html import content_policy
from .escaping import csv_text, latex_text, one_line
from .tables import Table

if TYPE_CHECKING:
    from .leaderboard import Board

FORMATS = {"md": ".md", "latex": ".tex", "csv": ".csv", "html": ".html"}
"""Name of a format -> suffix of its file."""


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


def latex(board: Board, command: str) -> str:
    """Tables for `\\input`; they need the packages booktabs and graphicx."""
    about = [f"{board.title}. Rendered by: {command}", *board.head]
    parts = [*[f"% {one_line(line)}" for line in about], r"% \usepackage{booktabs,graphicx}", ""]
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
            words = [str(row[c.key]) for c in names if row[c.key] not in (None, "")]
            label = {"dataset": csv_text(board.dataset), "table": csv_text(table.title), "row": csv_text(" | ".join(words))}
            for column in (c for c in table.columns if c.format is not None):
                ends = {end: row.get(f"{column.key}_{end}") for end in ("low", "high")}
                lines.append(label | {"figure": csv_text(column.header), "value": row[column.key], **ends})
    return pd.DataFrame(lines, columns=["dataset", "table", "row", "figure", "value", "low", "high"]).to_csv(index=False, lineterminator="\n")


def html(board: Board, command: str, images: Sequence[Path]) -> str:
    """One page that needs no network and no other file."""
    from jinja2 import Environment, FileSystemLoader
    from markupsafe import Markup

    def marked(text: str) -> Markup:
        return Markup(re.sub(r"`([^`]*)`", r"<code>\1</code>", escape(shown(text))))

    templates = Path(__file__).with_name("templates")
    style = (templates / "leaderboard.css").read_text(encoding="utf-8")
    pages = Environment(loader=FileSystemLoader(templates), autoescape=True, trim_blocks=True)
    pages.filters["marked"] = marked
    drawn = [{"name": p.stem.replace("-", " "), "source": f"data:image/png;base64,{base64.b64encode(p.read_bytes()).decode()}"} for p in images]
    about = [*board.head, f"Rendered by `{command}`."]
    policy = content_policy(style, images=True)
    page = pages.get_template("leaderboard.html")
    return page.render(title=board.title, about=about, tables=board.tables, images=drawn, style=Markup(style), policy=policy) + "\n"
