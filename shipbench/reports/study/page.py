"""Page of `shipbench report`: one HTML file that needs no network, rendered from results and the files beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...bench.provenance import code_version
from ...bench.submissions import Results
from ...errors import InputError
from ...leaderboard import pictures
from ...leaderboard.board import Board
from ...leaderboard.curves import study_curves
from ...leaderboard.pages import build_board, scores_of
from ...leaderboard.series import POINTS
from ...leaderboard.slicing import regime_errors
from ...render.html import Tile, render_page, short_name
from ...render.table import table_cells
from ...storage import Frame, write_text
from .beside import check_given, diagnoses, fitted

_FAILURES = 200


@dataclass(frozen=True)
class Written:
    """Path and size [bytes] of the page, and by data set the lines on its omissions."""

    path: Path
    size: int
    left_out: dict[str, list[str]]


def write_report(
    results: Results, out: Path, command: str, *, given: Sequence[Path] = (), points: int = POINTS
) -> Written:
    """Write the page of `results` to `out`, atomically; `given` are folders of diagnoses; at most `points` time steps
    are drawn.

    Raises:
        InputError: the rows cannot be ranked together (as `build_board`), a folder of `given` holds no diagnosis of
            these data, or `out` cannot be written. Nothing is written then.
    """
    names = list(dict.fromkeys(s["dataset"] for s in results.summaries))
    check_given(given, names)
    boards = [build_board(results, name) for name in names]
    sections = [_section(i, results, board, given, out, points // len(boards)) for i, board in enumerate(boards)]
    text = render(sections, results, command)
    try:
        write_text(out, text)
    except OSError as error:
        raise InputError(
            f"cannot write the page to {out}: {error.strerror}. Give a file that can be written with --out."
        ) from None
    return Written(out, out.stat().st_size, {s["name"]: s["left_out"] for s in sections if s["left_out"]})


def render(sections: Sequence[dict[str, Any]], results: Results, command: str) -> str:
    """HTML of the page. The template escapes everything but the pictures and its own style and script."""
    names = ", ".join(s["name"] for s in sections)
    return render_page(
        "report.html.j2", title="Study of ship-motion prediction", dataset=names, command=command,
        tiles=_tiles(sections, results),
        plots=any(s["tracks"]["runs"] for s in sections), sections=sections, code=code_version(),
    )  # fmt: skip


def _tiles(sections: Sequence[dict[str, Any]], results: Results) -> list[Tile]:
    """Tiles of the best model of each data set, windows, fits, and windows without a score."""
    best = []
    for section in sections:
        if section["models"]:
            name = section["models"][0]["name"]
            scored = results.rows[(results.rows["dataset"] == section["name"]) & (results.rows["status"] == "ok")]
            folds = scored[scored["model"] == name].groupby(["seed", "fold"])["ed"].mean()
            mean = float(folds.mean())  # as in the table
            best.append(
                Tile(
                    f"Best on {section['name']}",
                    short_name(name),
                    f"mean position error ED {mean:.2f} m over {section['horizon']:g} s",
                )
            )
    bad = sum(any(status != "ok" for status in s["run_status"]) for s in results.summaries)
    models, windows = results.rows["model"].nunique(), len(results.rows[["dataset", "run"]].drop_duplicates())
    status = "the reasons are under Status" if bad else "every prediction was scored"
    return [
        *best, Tile("Windows", str(windows), f"{models} model{'s' * (models != 1)}"),
        Tile("Fits", str(len(results.summaries)), "data set, model, fold, seed"),
        Tile("Failed, diverged or skipped", str(bad), status),
    ]  # fmt: skip


def _section(
    number: int, results: Results, board: Board, given: Sequence[Path], out: Path, points: int
) -> dict[str, Any]:
    rows = results.rows[results.rows["dataset"] == board.dataset]
    scored = set(rows.loc[rows["status"] == "ok", "model"])
    models = [m for m in board.ranking if m in scored]
    found = regime_errors(rows, scores_of(results, board.dataset).windows, models)
    return {
        "id": f"d{number}", "name": board.dataset, "head": board.head,
        "tables": [table_cells(t) for t in board.tables],
        **study_curves(results, board.dataset, models, points),
        "regimes": [(r, pictures.slices(r, models)) for r in found], "fits": fitted(results, board.dataset, models),
        "diagnoses": diagnoses(results, board.dataset, given, out), "failures": _failures(rows),
    }  # fmt: skip


def _failures(rows: Frame) -> dict[str, Any]:
    """Statuses other than ok with their reasons: model, folds and seeds, windows."""
    bad = rows[rows["status"] != "ok"]
    lines = []
    for (model, status, reason), part in bad.groupby(["model", "status", "reason"], sort=False):
        cells = part.drop_duplicates(["fold", "seed"])
        where = ", ".join(f"fold {f} seed {s}" for f, s in list(zip(cells["fold"], cells["seed"], strict=True))[:6])
        more = f" and {len(cells) - 6} more" if len(cells) > 6 else ""
        lines.append(
            {
                "model": model,
                "status": status,
                "reason": reason,
                "windows": len(part),
                "first": part["run"].iloc[0],
                "where": where + more,
            }
        )
    return {"lines": lines[:_FAILURES], "more": max(0, len(lines) - _FAILURES)}
