"""HTML page of a leaderboard: result, intervals of the errors, sortable tables, tracks and time histories."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..render.html import render_page
from ..render.table import table_cells
from .strips import STYLE, strips

if TYPE_CHECKING:
    from .board import Board


def board_page(board: Board, command: str, images: Sequence[Path], curves: dict[str, Any] | None) -> str:
    """HTML of a leaderboard; it needs no network and no other file.

    Args:
        board: tables, ranking and lines on the origin of the figures.
        command: the command that rendered it.
        images: pictures as files, which the page holds where it has no `curves`.
        curves: tracks, time histories and growth of the errors (`report.curves.study_curves`), or None.
    """
    embedded = (
        []
        if curves is not None
        else [(p.stem.replace("-", " "), base64.b64encode(p.read_bytes()).decode()) for p in images]
    )
    return render_page(
        "leaderboard.html.j2", title=board.title, dataset=board.dataset, command=command, lead=board.lead,
        tiles=board.tiles,
        plots=curves is not None and bool(curves["tracks"]["runs"]), images=bool(embedded), style=STYLE,
        strips=strips(board.tables[0]),
        tables=[table_cells(t) for t in board.tables], about=board.head, drawn=embedded,
        curves=None if curves is None else curves | {"name": board.dataset},
    )  # fmt: skip
