"""Commands of leaderboards: `shipbench leaderboard` and `shipbench learning-curve`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..errors import InputError
from ..names import file_name
from .common import Device, Full, Json, Quiet, exit_if_failed, parse_numbers, parse_seeds, print_json, say, show_boards

if TYPE_CHECKING:
    from ..bench.submissions import Results

_Results = Annotated[
    list[Path] | None, typer.Argument(metavar="[RESULTS]...", help="Result folders (default: the newest below runs/).")
]


def register(app: typer.Typer) -> None:
    """Add the commands to the main one."""
    app.command()(leaderboard)
    app.command(name="learning-curve")(learning_curve)


def leaderboard(
    ctx: typer.Context,
    results: _Results = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the pages.")] = Path("leaderboards"),
    formats: Annotated[str, typer.Option("--format", help="md, latex, csv, html; several with commas between.")] = "md",
    baseline: Annotated[str | None, typer.Option(help="Model that the skill is counted from (default: hold).")] = None,
    verify: Annotated[
        bool, typer.Option("--verify", help="First compute everything shown again from the saved predictions.")
    ] = False,
    submission: Annotated[
        Path | None, typer.Option(help="Also write rows, summary and windows there: the one folder to hand in.")
    ] = None,
    plots: Annotated[bool, typer.Option(help="Draw the plots.")] = True,
    full: Full = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Render leaderboards and plots from the results of one or several people."""
    from ..bench.submissions import check_target, read_results, write_submission
    from ..leaderboard.pages import write_boards

    found = read_results(results or [_newest_results()])
    if submission is not None:
        check_target(found, submission)
    if verify:
        _verify(found, quiet or as_json)
    names = [name.strip() for name in formats.split(",") if name.strip()]
    tell = say if not quiet and not as_json else lambda line: None
    written = write_boards(found, out, str(ctx.obj), plots=plots, formats=names, baseline=baseline, tell=tell)
    if submission is not None:
        write_submission(found, submission)
    if as_json:
        print_json({board.dataset: board.as_json() for board, _ in written})
    else:
        show_boards(written, full)
        say(f"Written: {', '.join(str(path) for _, path in written)}")
        if submission is not None:
            say(f"Submission: {submission}")


def _verify(results: Results, silent: bool) -> None:
    """Stop with exit code 1 and a line on each figure that differs."""
    from ..leaderboard.verify import verify

    differences, notes = verify(results)
    if differences:
        say(f"{len(differences)} scores are not what the saved predictions give:", err=True)
        for line in differences[:50]:
            say(f"  {line}", err=True)
        if len(differences) > 50:
            say(f"  ... and {len(differences) - 50} more", err=True)
    for note in notes:
        say(f"note: {note}", err=True)
    if differences:
        raise typer.Exit(1)
    if not silent:
        say(
            f"Verified: {len(results.rows)} rows are what the saved predictions give. Times of fits and rollouts "
            "are as reported."
        )


def _newest_results() -> Path:
    found = sorted(Path("runs").glob("*/study.json"), key=lambda p: p.stat().st_mtime)
    if not found:
        raise InputError("no results below runs/; give result folders, or run `shipbench run` first.")
    return found[-1].parent


def learning_curve(
    ctx: typer.Context,
    model: Annotated[list[str] | None, typer.Option("-m", "--model", help="Model spec; may be repeated.")] = None,
    dataset: Annotated[str | None, typer.Option("-d", "--dataset", help="Registered name or folder.")] = None,
    config: Annotated[
        str | None,
        typer.Option("-c", "--config", help="Task file (TOML), or the name of a shipped one; its first data set."),
    ] = None,
    sizes: Annotated[str, typer.Option(help="Numbers of training runs, early stopping included.")] = "4,8,16,32,64,72",
    folds: Annotated[int | None, typer.Option(help="Number of folds (default 5).")] = None,
    seeds: Annotated[str | None, typer.Option(help="Seeds, such as 0,1,2 (default 0).")] = None,
    horizon: Annotated[float | None, typer.Option(help="Seconds to predict (default 120).")] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder for the results (default runs/curve-<data set>).")
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep what the same code, data and task finished before.")
    ] = False,
    device: Device = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Error against the number of training runs: the same scored runs, ever more runs to learn from; table and plot."""
    from ..bench.executors import Execution
    from ..bench.progress import make_progress
    from ..bench.task import load_tasks
    from ..leaderboard.learning_curve import run_curve

    overrides = {
        "models": model or None, "datasets": [dataset] if dataset else None, "folds": folds,
        "seeds": parse_seeds(seeds), "horizon_s": horizon,
    }  # fmt: skip
    task = load_tasks(config, overrides)[0]
    folder = out or Path("runs") / f"curve-{file_name(Path(task.dataset).name)}"
    numbers = parse_numbers("--sizes", sizes)
    curve = run_curve(
        task,
        numbers,
        folder,
        resume=resume,
        execution=Execution(device=device),
        progress=make_progress(quiet or as_json),
        command=str(ctx.obj),
    )
    if as_json:
        print_json(
            {"out": str(folder), "page": str(curve.page), "curve": curve.board.as_json(), "failed": curve.failed}
        )
    else:
        show_boards([(curve.board, curve.page)], full=True)
        say(f"Results: {folder}\nPage: {curve.page}")
    exit_if_failed(curve.failed, f"{len(curve.failed)} fits")
