"""Leaderboard as Markdown, LaTeX, CSV and one HTML page."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..errors import InputError, unknown_name
from ..render.escaping import csv_text, latex_text, one_line
from ..render.table import Table
from .board import Board
from .html import board_page

FORMATS = {"md": ".md", "latex": ".tex", "csv": ".csv", "html": ".html"}
"""File suffix by name of a format."""


def check_formats(formats: Sequence[str]) -> None:
    """Check that all formats are known, and that one is given.

    Raises:
        InputError: they are not, or none is.
    """
    if not formats:
        raise InputError(f"--format: no format is given; accepted: {', '.join(FORMATS)}, several with commas between.")
    for name in formats:
        if name not in FORMATS:
            raise unknown_name("format", name, list(FORMATS))


def render(
    board: Board, name: str, command: str, images: Sequence[Path], folder: Path, curves: dict[str, Any] | None = None
) -> tuple[str, str]:
    """Suffix and text of `board` in the format `name`.

    Args:
        board, name, command: the leaderboard, a key of `FORMATS`, and the command that rendered it.
        images: its plots as files; `folder`: where the page will lie.
        curves: values that the HTML page draws instead of them (`report.curves.study_curves`).
    """
    if name == "md":
        text = board.markdown(command, [path.relative_to(folder).as_posix() for path in images])
    elif name == "latex":
        text = latex(board, command)
    elif name == "csv":
        text = csv(board)
    else:
        text = board_page(board, command, images, curves)
    return FORMATS[name], text


def latex(board: Board, command: str) -> str:
    r"""Tables for LaTeX's `\input`; they need the packages booktabs and graphicx."""
    about = [f"{board.title}. Rendered by: {command}", *board.head]
    parts = [*[f"% {one_line(line)}" for line in about], r"% \usepackage{booktabs,graphicx}", ""]
    for table in board.tables:
        parts += [
            r"\begin{table}[tbp]", r"\centering", rf"\caption{{{latex_text(f'{board.dataset}: {table.title}')}}}",
            r"\resizebox{\textwidth}{!}{%",
            _latex_tabular(table) + "}", *[rf"\par\footnotesize {latex_text(note)}" for note in table.notes],
            r"\end{table}", "",
        ]  # fmt: skip
    return "\n".join(parts)


def _latex_tabular(table: Table) -> str:
    import pandas as pd

    def cell(column: Any, row: dict[str, Any]) -> str:
        text, between = latex_text(column.text(row)), latex_text(column.interval_text(row))
        text = rf"\textit{{{text}}}" if row.get("_reference") and text else text
        return rf"\shortstack[r]{{{text}\\{{\scriptsize {between}}}}}" if between else text

    frame = pd.DataFrame(
        [[cell(c, row) for c in table.columns] for row in table.rows],
        columns=[latex_text(c.header) for c in table.columns],
    )
    layout = "".join("r" if c.format else "l" for c in table.columns)
    return frame.to_latex(index=False, escape=False, column_format=layout).rstrip()


def csv(board: Board) -> str:
    """Lines of CSV, one per figure: data set, table, row (its text cells), figure, value (not rounded), ends of the
    95 % interval."""
    import pandas as pd

    lines = []
    for table in board.tables:
        names = [c for c in table.columns if c.format is None]
        for row in table.as_json()["rows"]:
            words = [str(row[c.key]) for c in names if row[c.key] not in (None, "")]
            label = {
                "dataset": csv_text(board.dataset),
                "table": csv_text(table.title),
                "row": csv_text(" | ".join(words)),
            }
            for column in (c for c in table.columns if c.format is not None):
                ends = {end: row.get(f"{column.key}_{end}") for end in ("low", "high")}
                lines.append(label | {"figure": csv_text(column.header), "value": row[column.key], **ends})
    return pd.DataFrame(lines, columns=["dataset", "table", "row", "figure", "value", "low", "high"]).to_csv(
        index=False, lineterminator="\n"
    )
