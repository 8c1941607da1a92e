"""Leaderboard of a data set, rendered from saved rows only."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..bench.cost import parameters_by_model
from ..bench.memory import give_back_memory
from ..bench.results import PROTOCOL
from ..bench.submissions import Results
from ..errors import InputError
from ..names import file_name
from ..render.table import Table, TableColumn
from ..storage import Frame, write_text
from . import comparisons as board_statistics
from . import tables as board_tables
from .board import Board
from .fit_notes import MARK, fit_notes
from .formats import check_formats, render
from .lead import lead, lead_tiles, short_table
from .replay_notes import replay_notes
from .scores import Scores, cluster_of

SPLITS = {
    "folds": "{folds} folds by run", "published": "published split",
    "kind": ("{folds} folds, each scored on a kind "
             "of manoeuvre left out of training"),
    "speed": "trained on the slower runs, scored on the fastest",
    "extrapolate": "trained on the least severe runs, scored on those beyond",
}  # fmt: skip
"""Description of the split of a task on a page."""


def build_board(results: Results, dataset: str, baseline: str | None = None) -> Board:
    """Leaderboard of `dataset`; skill is relative to the model `baseline` (default: `hold`, where it is there).

    Raises:
        InputError: the rows are of different protocols, data (fingerprints) or tasks, which are never ranked together;
            or there is no such baseline.
    """
    return _board(scores_of(results, dataset, baseline), [s for s in results.summaries if s["dataset"] == dataset])


def scores_of(results: Results, dataset: str, baseline: str | None = None) -> Scores:
    """Scores of the rows of `dataset`, from which its tables are made.

    Raises:
        InputError: as `build_board`.
    """
    rows = results.rows[results.rows["dataset"] == dataset]
    summaries = [s for s in results.summaries if s["dataset"] == dataset]
    _refuse_mixtures(rows, summaries, dataset)
    columns = {c["name"]: c for s in summaries for c in s["columns"]}
    windows = results.windows
    if windows is not None:
        windows = windows[
            (windows["dataset"] == dataset)
            & windows["fingerprint"].isin(rows["fingerprint"])
            & windows["task"].isin(rows["task"])
        ]
    tasks = [s["task"] for s in summaries]
    beside_paper = dataset == board_tables.PAPER_DATASET and all(
        t["split"] == "folds" and not t.get("train_runs") for t in tasks
    )
    return Scores(dataset, rows.assign(cluster=cluster_of(rows)), columns, windows, baseline, beside_paper)


def _board(scores: Scores, summaries: list[dict[str, Any]]) -> Board:
    first = _marked(board_tables.table_iii(scores), scores.dataset, summaries)
    told = [f"`{model}`: {note}" for (_, model), notes in replay_notes(summaries).items() for note in notes]
    tables: list[Table | None] = [replace(first, notes=[*first.notes, *told])]
    if scores.beside_paper and {"physics", "mlp"} <= set(scores.models):
        tables.append(board_tables.claim(scores))
    tables.append(board_statistics.comparison_table(scores))
    if len(scores.matched.comparable) > 1 and len(scores.ranked) > 1:
        tables.append(board_statistics.pair_table(scores))
    tables += [board_tables.horizon_table(scores), board_tables.signal_table(scores), board_tables.band_table(scores)]
    if scores.rows["kind"].nunique() > 1:
        tables.append(board_tables.kind_table(scores))
    tables += [board_statistics.slice_table(scores), board_statistics.trial_table(scores)]
    tables.append(board_tables.status_table(scores, parameters_by_model(summaries)))
    known = [t for t in tables if t is not None]
    tiles = lead_tiles(scores, summaries[0]["task"]["horizon_s"])
    return Board(
        scores.dataset,
        scores.models,
        known,
        _head(scores.rows, summaries),
        lead=lead(scores),
        tiles=tiles,
        short=short_table(known[0]),
    )


def _marked(table: Table, dataset: str, summaries: list[dict[str, Any]]) -> Table:
    """Table with a mark and a note at every model whose physics does not fit its own training runs."""
    notes = {model: note for (name, model), note in fit_notes(summaries).items() if name == dataset}
    if not notes:
        return table
    rows = [row | {"fit": MARK} if row.get("model") in notes else row for row in table.rows]
    columns = [*table.columns[:3], TableColumn("fit", "fit"), *table.columns[3:]]
    return replace(
        table,
        columns=columns,
        rows=rows,
        notes=[*table.notes, *(f"{MARK} `{model}`: {note}" for model, note in notes.items())],
    )


def _refuse_mixtures(rows: Frame, summaries: list[dict[str, Any]], dataset: str) -> None:
    for column, what in (("protocol", "protocol versions"), ("fingerprint", "data (fingerprints)"), ("task", "tasks")):
        found = sorted(rows[column].unique().tolist())
        if len(found) > 1:
            models = {value: sorted(rows.loc[rows[column] == value, "model"].unique()) for value in found}
            listed = "; ".join(f"{value}: {', '.join(names)}" for value, names in models.items())
            raise InputError(
                f"data set '{dataset}': the rows are of different {what}, which are never ranked together ({listed}). "
                "Give result folders of one kind, or run the models again."
            )
    if summaries and summaries[0]["protocol"] != PROTOCOL:
        raise InputError(
            f"data set '{dataset}': the rows are of protocol {summaries[0]['protocol']}, this version ranks "
            f"protocol {PROTOCOL}; "
            "run the models again."
        )


def _code_text(code: dict[str, str]) -> str:
    return f"shipbench {code['shipbench']} (source {code['source']}{', git ' + code['git'] if code['git'] else ''})"


def _head(rows: Frame, summaries: list[dict[str, Any]]) -> list[str]:
    """Lines that identify the experiment."""
    first = summaries[0]
    task, scored, runs = first["task"], len(rows[["fold", "run"]].drop_duplicates()), rows["parent"].nunique()
    windows = f"{scored} runs" if scored == runs else f"{scored} windows (from {runs} runs)"
    split = SPLITS[task["split"]].format(folds=rows["fold"].nunique())
    if task.get("train_runs"):
        split += f", {task['train_runs']} training runs"
    seeds = ", ".join(str(s) for s in sorted(rows["seed"].unique()))
    codes = dict.fromkeys(_code_text(s["code"]) for s in summaries)
    machines = dict.fromkeys("{cpus} CPUs, Python {python}, torch {torch}".format(**s["machine"]) for s in summaries)
    commands = dict.fromkeys(s["command"] for s in summaries if s["command"])
    notes = dict.fromkeys(note for s in summaries for note in s["notes"])
    history = f", {task['history_s']:g} s of history" if task["history_s"] else ""
    return [
        f"{windows} of {task['horizon_s']:g} s{history}, {split}, seed(s) {seeds}; "
        f"ship {first['ship']} (L = {first['ship_L']:g} m), dt = {first['dt']:g} s.",
        f"Data fingerprint `{first['fingerprint']}`, task `{first['task_key']}`, protocol {first['protocol']}.",
        f"Made {max(s['finished'] for s in summaries)[:10]} with {'; '.join(codes)} on {'; '.join(machines)}.",
        *[f"Made by `{command}`." for command in commands],
        f"Source: {first['source'] or 'not stated'}; licence: {first['licence'] or 'not stated'}.",
        *[f"Note: {note.rstrip('.')}." for note in notes],
    ]


def write_boards(
    results: Results,
    out: str | Path,
    command: str,
    *,
    plots: bool = True,
    formats: Sequence[str] = ("md",),
    baseline: str | None = None,
    tell: Callable[[str], None] = lambda line: None,
) -> list[tuple[Board, Path]]:
    """Render every data set of `results` into `out/<dataset>.md` (and the other `formats`), with its plots beside it in
    `out/<dataset>/`.

    Several data sets with several models in common also get a page over all of them. `tell` gets a line on each plot
    that cannot be drawn.

    Returns:
        Each board with the path of its page in the first format.

    Raises:
        InputError: as `build_board`, or an unknown format; nothing is written then.
    """
    from .overall import over_data_sets

    check_formats(formats)
    give_back_memory()  # the data of the study that was run
    out = Path(out)
    names = list(dict.fromkeys(s["dataset"] for s in results.summaries))
    boards = [build_board(results, name, baseline) for name in names]
    images: dict[str, list[Path]] = {}
    overall = over_data_sets([scores_of(results, name, baseline) for name in names])
    if overall is not None:
        page = overall.board.dataset
        if page in names:
            raise InputError(
                f"a data set is named '{page}', as the page over all data sets is. Rename the data set, or give it "
                "alone."
            )
        boards.append(overall.board)
        images[page] = [overall.draw(out / page)] if plots and overall.can_draw else []
    written = []
    for board in boards:
        if plots and board.dataset not in images:
            images[board.dataset] = _draw(results, board, out, tell)
        curves = _curves(results, board) if plots and "html" in formats and board.dataset in names else None
        paths = [_write(board, name, command, images.get(board.dataset, []), out, curves) for name in formats]
        written.append((board, paths[0]))
    return written


def _draw(results: Results, board: Board, out: Path, tell: Callable[[str], None]) -> list[Path]:
    from .plots import draw_all

    folder = out / file_name(board.dataset)
    if folder.is_symlink():
        raise InputError(
            f"{folder} is a link; accepted: a folder, so that pictures land below {out}. Remove the link, or give "
            "another --out."
        )
    return draw_all(results, board.dataset, board.ranking, folder, lambda line: tell(f"{board.dataset}: {line}"))


def _curves(results: Results, board: Board) -> dict[str, Any]:
    from .curves import study_curves

    rows = results.rows[(results.rows["dataset"] == board.dataset) & (results.rows["status"] == "ok")]
    scored = set(rows["model"])
    return study_curves(results, board.dataset, [m for m in board.ranking if m in scored])


def _write(
    board: Board, form: str, command: str, images: Sequence[Path], out: Path, curves: dict[str, Any] | None
) -> Path:
    """Write the page in one format, atomically."""
    suffix, text = render(board, form, command, images, out, curves)
    return write_text(out / f"{file_name(board.dataset)}{suffix}", text)
