"""Learning curve: error on the same scored runs against the number of training runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..bench.executors import Execution
from ..bench.progress import Progress
from ..bench.runner import check_task, run_tasks
from ..bench.task import Task
from ..errors import InputError
from ..render.table import Table, TableColumn, number
from ..storage import write_text
from .board import Board
from .pages import build_board, scores_of
from .scores import Scores

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class Curve:
    """Table and page of a learning curve, and the cells that failed with their reasons."""

    board: Board
    page: Path
    failed: list[str]


def run_curve(
    task: Task,
    sizes: Sequence[int],
    out: Path,
    *,
    resume: bool = False,
    execution: Execution | None = None,
    progress: Progress | None = None,
    command: str = "",
) -> Curve:
    """Run `task` with each number of training runs into `out/train<number>`, and write `out/learning-curve.md` with its
    plot.

    The training runs of a smaller number are among those of a larger one; the scored runs are the same.

    Raises:
        InputError: no number, one below 2, or more than a fold has; nothing has been fitted then. Or as `run_tasks`.
    """
    numbers = sorted(set(sizes))
    if not numbers or numbers[0] < 2:
        raise InputError(
            f"--sizes {', '.join(map(str, sizes)) or '(none)'}; accepted: numbers of training runs of 2 and more, "
            "such as 4,8,16,32,72."
        )
    tasks = {n: task.model_copy(update={"train_runs": n}) for n in numbers}
    for one in tasks.values():
        check_task(one)
    found: dict[int, Scores] = {}
    failed: list[str] = []
    boards: dict[int, Board] = {}
    for n, one in tasks.items():
        outcome = run_tasks(
            [one], out / f"train{n:03d}", resume=resume, execution=execution, progress=progress, command=command
        )
        failed += [f"{n} training runs: {line}" for line in outcome.failed]
        dataset = outcome.summaries[0]["dataset"]
        found[n], boards[n] = scores_of(outcome.results, dataset), build_board(outcome.results, dataset)
    board = _board(found, boards[numbers[-1]])
    image = _save(draw(found, board.dataset), out / "learning-curve.png")
    write_text(out / "learning-curve.md", board.markdown(command, [image.name]))
    return Curve(board, out / "learning-curve.md", failed)


def _board(found: dict[int, Scores], last: Board) -> Board:
    lines: list[dict[str, Any]] = []
    for model in last.ranking:
        line: dict[str, Any] = {"model": model}
        for n, scores in found.items():
            figures = _figures(scores, model)
            line |= {f"n{n}{end}": figures[end] for end in figures}
        lines.append(line)
    columns = [
        TableColumn("model", "model"),
        *[TableColumn(f"{n} runs", f"n{n}", number(2), interval=True) for n in found],
    ]
    incomplete = {m: [n for n, s in found.items() if s.shares[m][0] < s.shares[m][1]] for m in last.ranking}
    notes = [
        (
            "ED [m], mean over runs and folds; intervals: 95 %, bootstrap over the scored runs, which are the same in "
            "every column."
        )
    ]
    notes.append(
        "Training runs include those set aside for early stopping; the runs of a smaller number are among those of "
        "a larger one."
    )
    notes += [
        f"`{m}` has runs without a score with {', '.join(map(str, n))} training runs: no figure there."
        for m, n in incomplete.items()
        if n
    ]
    return Board(
        last.dataset,
        last.ranking,
        [Table("Error against number of training runs", columns, lines, notes)],
        last.head,
        "Learning curve",
    )


def _figures(scores: Scores, model: str) -> dict[str, float]:
    """ED [m] and the ends of its interval; NaN where a run has no score, since leaving it out would favour the
    model."""
    scored, expected = scores.shares[model]
    figures = scores.figures("ed")[model] if scored == expected else {}
    return {end: figures.get(f"ed_mean{end}", float("nan")) for end in ("", "_low", "_high")}


def draw(found: dict[int, Scores], dataset: str) -> Figure:
    """Figure of ED against the number of training runs, one line with its 95 % band for each model; both axes
    logarithmic."""
    from .plots import new_figure, plain, short_name, style

    models = next(iter(found.values())).models
    figure = new_figure(8.0, 5.2)
    axis, styles = figure.subplots(), style(models)
    numbers = list(found)
    for model in models:
        figures = [_figures(scores, model) for scores in found.values()]
        middle, low, high = ([f[end] for f in figures] for end in ("", "_low", "_high"))
        if not any(m > 0 for m in middle):
            continue
        axis.plot(numbers, middle, marker="o", ms=5, lw=2, label=short_name(model), **styles[model])
        axis.fill_between(numbers, low, high, color=styles[model]["color"], alpha=0.13, lw=0)
    axis.set_xscale("log", base=2)
    axis.set_yscale("log")
    axis.set_xticks(numbers, [str(n) for n in numbers])
    axis.minorticks_off()
    axis.set_xlabel("training runs")
    axis.set_ylabel("ED [m]")
    axis.grid(alpha=0.25, which="both")
    axis.legend(fontsize=9)
    axis.set_title(f"{plain(dataset)}: error against number of training runs (band: 95 % over runs)", fontsize=11)
    return figure


def _save(figure: Figure, path: Path) -> Path:
    from .plots import save

    return save(figure, path)
