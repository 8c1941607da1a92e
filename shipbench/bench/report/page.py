"""The page of `shipbench report`: one HTML file that needs no network, rendered from results and what lies beside them."""

from __future__ import annotations

import contextlib
import json
import os
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...errors import InputError
from ..escaping import content_policy
from ..leaderboard import Board, build_board, scores_of
from ..provenance import code_version
from ..results import Frame, Results
from ..tables import Table, TableColumn
from . import pictures
from .beside import check_given, diagnoses, fitted
from .series import POINTS, Series, gather
from .slicing import regime_errors

_HERE = Path(__file__).resolve().parent
_FAILURES = 200


@dataclass(frozen=True)
class Written:
    """The page's path and size [bytes], and by data set the lines on what it leaves out."""

    path: Path
    size: int
    left_out: dict[str, list[str]]


def write_report(results: Results, out: Path, command: str, *, given: Sequence[Path] = (), points: int = POINTS) -> Written:
    """Write the page of `results` to `out`, in one step; `given` are folders of diagnoses; at most `points` points of tracks are drawn.

    Raises:
        InputError: the rows cannot be ranked together (as `build_board`), a folder of `given` holds no diagnosis of these data, or `out` cannot be
            written. Nothing is written then.
    """
    names = list(dict.fromkeys(s["dataset"] for s in results.summaries))
    check_given(given, names)
    boards = [build_board(results, name) for name in names]
    sections = [_section(i, results, board, given, out, points // len(boards)) for i, board in enumerate(boards)]
    text = render(sections, results, command)
    part = out.with_name(f".{out.name}.{os.getpid()}.tmp")
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(text, encoding="utf-8", errors="replace")  # names from badly decoded files may hold lone surrogates
        os.replace(part, out)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink()
        raise InputError(f"cannot write the page to {out}: {error.strerror}. Give a file that can be written with --out.") from None
    return Written(out, out.stat().st_size, {s["name"]: s["left_out"] for s in sections if s["left_out"]})


def render(sections: Sequence[dict[str, Any]], results: Results, command: str) -> str:
    """The HTML. Everything but the pictures and our own style and script is escaped by the template."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined

    environment = Environment(loader=FileSystemLoader(_HERE), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True)
    environment.filters["ticks"] = _ticks
    environment.filters["short"] = lambda model: Path(model).name if "/" in model else model
    script = (_HERE / "report.js").read_text(encoding="utf-8")
    style = (_HERE / "report.css").read_text(encoding="utf-8")
    bad = sum(s["status"] != "ok" for s in results.summaries)
    return environment.get_template("report.html.j2").render(
        sections=sections, style=style, script=script, policy=content_policy(style, script), command=command,
        code=code_version(), cells=len(results.summaries), bad=bad, title=", ".join(s["name"] for s in sections),
    )  # fmt: skip


def _ticks(text: Any) -> Any:
    """Escaped text with `words in backticks` as code."""
    from markupsafe import Markup, escape

    return Markup(re.sub(r"`([^`]+)`", r"<code>\1</code>", str(escape(text))))


def _section(number: int, results: Results, board: Board, given: Sequence[Path], out: Path, points: int) -> dict[str, Any]:
    rows = results.rows[results.rows["dataset"] == board.dataset]
    summary = next(s for s in results.summaries if s["dataset"] == board.dataset)
    scored = set(rows.loc[rows["status"] == "ok", "model"])
    models = [m for m in board.ranking if m in scored]
    series = gather(results, board.dataset, models, points)
    found = regime_errors(rows, scores_of(results, board.dataset).windows, models)
    return {
        "id": f"d{number}", "name": board.dataset, "head": board.head, "models": [_model(i, m) for i, m in enumerate(models)],
        "tables": [_table(t) for t in board.tables], "tracks": _tracks(series, rows, models, summary),
        "growth": [
            ("Position error ED", pictures.growth(series, models, 0, "ED [m]")),
            ("Heading error", pictures.growth(series, models, 1, "|heading error| [deg]")),
        ],
        "regimes": [(r, pictures.slices(r, models)) for r in found], "fits": fitted(results, board.dataset, models),
        "diagnoses": diagnoses(results, board.dataset, given, out), "failures": _failures(rows), "left_out": series.left_out,
        "horizon": summary["task"]["horizon_s"],
    }  # fmt: skip


def _model(i: int, name: str) -> dict[str, Any]:
    return {"i": i, "name": name, "stroke": pictures.stroke(i)}


def _table(table: Table) -> dict[str, Any]:
    """Cells as text, beside the value that they are sorted by."""
    lines = []
    for row in table.rows:
        cells = [
            {"text": c.text(row), "between": _between(c, row), "by": _sort_key(row.get(c.key)), "number": c.format is not None} for c in table.columns
        ]
        lines.append({"cells": cells, "reference": bool(row.get("_reference"))})
    head = [{"text": c.header, "number": c.format is not None, "model": c.key == "model"} for c in table.columns]
    return {"title": table.title, "head": head, "rows": lines, "notes": list(table.notes)}


def _between(column: TableColumn, row: dict[str, Any]) -> str:
    """The interval of a cell, where its row holds one under `key_low` and `key_high`."""
    low, high = row.get(f"{column.key}_low"), row.get(f"{column.key}_high")
    if column.format is None or low is None or high is None or not high > low:
        return ""
    return f"{column.format(low)} to {column.format(high)}"


def _sort_key(value: Any) -> str:
    """A number as text that a browser reads back; "" for what has none and comes last."""
    value = value.item() if isinstance(value, np.generic) else value
    if isinstance(value, bool | int | float):
        return repr(float(value)) if np.isfinite(value) else ""
    return "" if value is None else str(value)


def _failures(rows: Frame) -> dict[str, Any]:
    """Every status but ok with its reason: model, folds and seeds, windows."""
    bad = rows[rows["status"] != "ok"]
    lines = []
    for (model, status, reason), part in bad.groupby(["model", "status", "reason"], sort=False):
        cells = part.drop_duplicates(["fold", "seed"])
        where = ", ".join(f"fold {f} seed {s}" for f, s in list(zip(cells["fold"], cells["seed"], strict=True))[:6])
        more = f" and {len(cells) - 6} more" if len(cells) > 6 else ""
        lines.append({"model": model, "status": status, "reason": reason, "windows": len(part), "first": part["run"].iloc[0], "where": where + more})
    return {"lines": lines[:_FAILURES], "more": max(0, len(lines) - _FAILURES)}


def _tracks(series: Series, rows: Frame, models: Sequence[str], summary: dict[str, Any]) -> dict[str, Any]:
    """Everything that the page needs to show any window: drawings, and the errors of the models in it."""
    first = rows.sort_values(["seed", "fold"], kind="stable").drop_duplicates(["model", "run"])  # as the tracks: of several seeds the first
    by_run = {run: part.set_index("model") for run, part in first.groupby("run")}
    found = []
    for track in series.tracks:
        mine = by_run[track.run]
        errors = [_error(mine, m) for m in models]
        kind = str(mine["kind"].iloc[0])
        svg = pictures.track(track, models, summary["ship_L"], summary["ship_B"])
        found.append({"run": track.run, "kind": kind, "errors": errors, "svg": svg})
    return {"runs": found, "json": _script_json(found), "start": _median_run(found)}


def _error(mine: Frame, model: str) -> str:
    if model not in mine.index:
        return "not run"
    row = mine.loc[model]
    return f"{row['ed']:.3g} m" if row["status"] == "ok" else f"{row['status']}: {row['reason']}"


def _median_run(found: Sequence[dict[str, Any]]) -> int:
    """The window shown first: the one whose best model has the median error."""
    sizes = [min([float(e.split()[0]) for e in f["errors"] if e.endswith(" m") and ":" not in e], default=np.inf) for f in found]
    return int(np.argsort(sizes, kind="stable")[len(sizes) // 2]) if sizes else 0


def _script_json(data: Any) -> Any:
    """JSON that can stand inside a script element: nothing in it can end the element."""
    from markupsafe import Markup

    text = json.dumps(data, separators=(",", ":"), ensure_ascii=True)
    return Markup(text.replace("<", "\\u003c"))
