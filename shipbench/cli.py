"""The command line. Only this module and the progress reporter print; everything heavy is imported inside the commands."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from . import cli_check, cli_data, cli_diagnosis, cli_import, cli_report
from .cli_common import SETTINGS, DatasetArgument, Json, Quiet, console_for_tables, print_json
from .errors import InputError, ShipbenchError

if TYPE_CHECKING:
    from .bench.leaderboard import Board
    from .bench.results import Results


class _Group(TyperGroup):
    """Turns shipbench's own errors into one message on stderr and an exit code, and remembers the command line."""

    def make_context(self, info_name: Any, args: list[str], parent: Any = None, **extra: Any) -> Any:
        command = shlex.join(["shipbench", *args])
        context = super().make_context(info_name, args, parent, **extra)
        context.obj = context.obj or command
        return context

    def invoke(self, ctx: Any) -> Any:
        try:
            return super().invoke(ctx)
        except InputError as error:
            code, text = 2, str(error)
        except ShipbenchError as error:
            code, text = 1, str(error)
        except OSError as error:
            if error.filename is None:
                raise
            code, text = 1, f"{error.filename}: {error.strerror}."
        typer.echo(f"error: {text}", err=True)
        raise typer.Exit(code)


app = typer.Typer(
    name="shipbench", cls=_Group, add_completion=False, pretty_exceptions_enable=False, rich_markup_mode=None, **SETTINGS,
    help="Benchmark of ship-motion prediction: every model on the same runs, folds, rollouts and metrics.",
)  # fmt: skip
cli_data.register(app)
cli_import.register(cli_data.data_app)
cli_diagnosis.register(app)
cli_check.register(cli_data.data_app, cli_diagnosis.suite_app)
cli_report.register(app)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"shipbench {version('shipbench')}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")] = False,
) -> None:
    pass


def _seeds(text: str | None) -> tuple[int, ...] | None:
    if text is None:
        return None
    try:
        return tuple(int(s) for s in text.replace(",", " ").split())
    except ValueError:
        raise InputError(f"--seeds {text}: not a list of whole numbers; write --seeds 0,1,2.") from None


@app.command()
def run(
    ctx: typer.Context,
    model: Annotated[list[str] | None, typer.Option("-m", "--model", help="Model spec; may be repeated.")] = None,
    dataset: Annotated[list[str] | None, typer.Option("-d", "--dataset", help="Registered name or folder; may be repeated.")] = None,
    config: Annotated[str | None, typer.Option("-c", "--config", help="Task file (TOML), or the name of a shipped one: paper, smoke.")] = None,
    folds: Annotated[int | None, typer.Option(help="Number of folds (default 5).")] = None,
    split: Annotated[str | None, typer.Option(help="folds or published.")] = None,
    seeds: Annotated[str | None, typer.Option(help="Seeds, such as 0,1,2 (default 0).")] = None,
    horizon: Annotated[float | None, typer.Option(help="Seconds to predict (default 120).")] = None,
    history: Annotated[float | None, typer.Option(help="Seconds before the start that models may use (default 0).")] = None,
    stride: Annotated[float | None, typer.Option(help="Seconds between scored windows (default: the horizon).")] = None,
    max_runs: Annotated[int | None, typer.Option(help="Use only that many runs, evenly spread.")] = None,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder for the results (default runs/<name>).")] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Keep what the same code, data and task finished before.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Fit, roll out and score models; print the leaderboard."""
    from .bench.progress import make_progress
    from .bench.results import slug
    from .bench.runner import run_tasks
    from .bench.task import load_tasks

    overrides = {
        "models": model or None, "datasets": dataset or None, "folds": folds, "split": split, "seeds": _seeds(seeds),
        "horizon_s": horizon, "history_s": history, "stride_s": stride, "max_runs": max_runs,
    }  # fmt: skip
    tasks = load_tasks(config, overrides)
    folder = out or Path("runs") / (Path(config).stem if config else slug(Path(tasks[0].dataset).name))
    outcome = run_tasks(tasks, folder, resume=resume, progress=make_progress(quiet), command=str(ctx.obj))
    written = _write_boards(outcome.results, folder, str(ctx.obj))
    if as_json:
        boards = {board.dataset: board.as_json() for board, _ in written}
        print_json({"out": str(folder), "leaderboards": boards, "failed": outcome.failed})
    elif not quiet:
        _show_boards(written)
        typer.echo(f"Results in {folder}; leaderboard: {', '.join(str(path) for _, path in written)}")
        if equations := sorted(folder.glob("cells/*/*/*/equations.txt")):
            typer.echo(f"Fitted equations of {len(equations)} models beside their predictions, e.g. {equations[0]}")
    if outcome.failed:
        typer.echo(f"{len(outcome.failed)} of {len(outcome.summaries)} fits failed:", err=True)
        for line in outcome.failed:
            typer.echo(f"  {line}", err=True)
        raise typer.Exit(1)


def _write_boards(results: Results, folder: Path, command: str, plots: bool = True) -> list[tuple[Board, Path]]:
    from .bench.leaderboard import write_boards

    return write_boards(results, folder, command, plots=plots)


def _show_boards(written: list[tuple[Board, Path]]) -> None:
    console = console_for_tables()
    for board, _ in written:
        console.print(f"\nLeaderboard: {board.dataset}", style="bold", markup=False)
        for table in board.tables:
            table.show(console)


@app.command()
def leaderboard(
    ctx: typer.Context,
    results: Annotated[list[Path] | None, typer.Argument(metavar="[RESULTS]...", help="Result folders (default: the newest below runs/).")] = None,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the pages.")] = Path("leaderboards"),
    plots: Annotated[bool, typer.Option(help="Draw the plots.")] = True,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Render leaderboards and plots from results."""
    from .bench.results import read_results

    written = _write_boards(read_results(results or [_newest_results()]), out, str(ctx.obj), plots)
    if as_json:
        print_json({board.dataset: board.as_json() for board, _ in written})
    elif not quiet:
        _show_boards(written)
        typer.echo(f"Written: {', '.join(str(path) for _, path in written)}")


def _newest_results() -> Path:
    found = sorted(Path("runs").glob("*/study.json"), key=lambda p: p.stat().st_mtime)
    if not found:
        raise InputError("no results below runs/; give result folders, or run `shipbench run` first.")
    return found[-1].parent


@app.command()
def models(as_json: Json = False) -> None:
    """List the models with their parameters."""
    from .bench.listing import describe_parts
    from .predictors.base import PREDICTORS

    parts = describe_parts(PREDICTORS)
    if as_json:
        print_json(parts)
        return
    for part in parts:
        typer.echo(f"{part['name']:<12s} {part['summary']}" + ("" if part["from"] == "shipbench" else f"  [{part['from']}]"))
        if part["parameters"]:
            typer.echo(" " * 13 + ", ".join(f"{k}={v}" if v else k for k, v in part["parameters"].items()))
    typer.echo("\nA spec sets parameters in brackets, such as 'mlp[hidden=64,seed=3]'; your own class: path/to/model.py:ClassName.")


@app.command()
def validate(as_json: Json = False) -> None:
    """Print the simulator beside published figures."""
    from .bench.tables import Table, TableColumn, significant
    from .simulate.validation import table

    rows = table()
    if as_json:
        print_json(rows)
    else:
        said = {True: "passed", False: "FAILED", None: ""}
        columns = [
            TableColumn("ship", "ship"), TableColumn("quantity", "quantity"), TableColumn("computed", "computed", significant(4)),
            TableColumn("published", "published", significant(4)), TableColumn("unit", "unit"), TableColumn("tolerance", "tolerance"),
            TableColumn("", "said"), TableColumn("source", "source"),
        ]  # fmt: skip
        Table("Simulator against published figures", columns, [row | {"said": said[row["passed"]]} for row in rows]).show(console_for_tables())
    if any(row["passed"] is False for row in rows):
        raise typer.Exit(1)  # a figure is outside its tolerance


@app.command()
def predict(
    model: Annotated[str, typer.Argument(metavar="MODEL", help="Folder of a saved model (cells/.../model of a result folder).")],
    dataset: DatasetArgument,
    out: Annotated[Path, typer.Option("-o", "--out", help="CSV file to write.")] = Path("predictions.csv"),
    horizon: Annotated[float | None, typer.Option(help="Seconds to predict (default: each run's length).")] = None,
) -> None:
    """Roll a saved model out over a data set into CSV."""
    from .bench.rollout import predict_runs, write_csv
    from .data.base import load_dataset

    predicted = predict_runs(model, load_dataset(dataset), horizon)
    write_csv(predicted, out)
    typer.echo(f"Written: {out} ({len(predicted)} runs)")


def main() -> None:
    """Entry point of the `shipbench` command."""
    app()
