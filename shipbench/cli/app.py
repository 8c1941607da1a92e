"""The command line. Only this module and the progress reporter print; everything heavy is imported inside the
commands."""

from __future__ import annotations

import errno
import shlex
import signal
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperGroup

from ..errors import InputError, ShipbenchError, command_line
from ..names import file_name
from ..regular_files import check_output
from . import check as cli_check
from . import contract as cli_contract
from . import data as cli_data
from . import demo as cli_demo
from . import diagnosis as cli_diagnosis
from . import exporting as cli_export
from . import importing as cli_import
from . import leaderboard as cli_leaderboard
from . import parts as cli_parts
from . import report as cli_report
from . import shield
from .common import (
    HELP,
    SETTINGS,
    DatasetArgument,
    Device,
    Full,
    Json,
    Predictions,
    PredictionsMapping,
    Quiet,
    exit_if_failed,
    parse_seeds,
    parse_words,
    predicted_models,
    print_json,
    say,
    say_wrapped,
    show_boards,
    show_table,
)

_GROUPS = {
    "Your data": ("demo", "data", "diagnose"),
    "Models": ("models", "effects", "check", "predict", "export"),
    "Results": ("run", "leaderboard", "learning-curve", "report"),
    "For developers": ("validate", "suite"),
}
"""Commands in the order of `shipbench --help`."""


class _Group(TyperGroup):
    """Command group that turns shipbench's own errors into one message on stderr and an exit code, and remembers the
    command line."""

    def make_context(self, info_name: Any, args: list[str], parent: Any = None, **extra: Any) -> Any:
        command = shlex.join(["shipbench", *args])
        context = super().make_context(info_name, args, parent, **extra)
        context.obj = context.obj or command
        return context

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands in the groups of `_GROUPS`; a command that is in none of them comes last."""
        left = dict.fromkeys(self.list_commands(ctx))
        for title, names in [*_GROUPS.items(), ("More", tuple(left))]:
            rows = [(name, self.commands[name].get_short_help_str(HELP)) for name in names if name in left]
            for name in names:
                left.pop(name, None)
            if rows:
                with formatter.section(title):
                    formatter.write_dl(rows)

    def invoke(self, ctx: Any) -> Any:
        try:
            with command_line():
                return super().invoke(ctx)
        except InputError as error:
            code, text = 2, str(error)
        except ShipbenchError as error:
            code, text = 1, str(error)
        except OSError as error:
            if error.errno in (
                None,
                errno.EPIPE,
            ):  # a reader that has read enough (| head) is no error; typer ends quietly
                raise
            code, text = 1, f"{error.filename or 'a file'}: {error.strerror}."
        say(f"error: {text}", err=True)
        raise typer.Exit(code)


app = typer.Typer(
    name="shipbench", cls=_Group, pretty_exceptions_enable=False, rich_markup_mode=None, **SETTINGS,
    help="Benchmark of ship-motion prediction: every model on the same runs, folds, rollouts and metrics.",
)  # fmt: skip
cli_demo.register(app)
cli_data.register(app)
cli_import.register(cli_data.data_app)
cli_diagnosis.register(app)
cli_contract.register(app)
cli_check.register(cli_data.data_app, cli_diagnosis.suite_app)
cli_leaderboard.register(app)
cli_report.register(app)
cli_parts.register(app)
cli_export.register(app)


def _show_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"shipbench {version('shipbench')}")
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    pass


_Split = Annotated[
    str | None,
    typer.Option(
        help="folds, published, kind (leave one kind of manoeuvre out), speed (score the fastest) or extrapolate "
        "(train on small rudder angles, drift angles and speeds, score beyond them)."
    ),
]
_Simulated = Annotated[
    str | None, typer.Option(help="Simulated twin of the data set, as `shipbench data simulate` writes it.")
]
_TrainOn = Annotated[
    str | None,
    typer.Option(
        help="With --simulated: measured, simulated or simulated+measured; several with commas between (default: "
        "all three). Scored on measured runs always."
    ),
]


@app.command()
def run(
    ctx: typer.Context,
    model: Annotated[list[str] | None, typer.Option("-m", "--model", help="Model spec; may be repeated.")] = None,
    predictions: Predictions = None,
    mapping: PredictionsMapping = None,
    dataset: Annotated[
        list[str] | None, typer.Option("-d", "--dataset", help="Registered name or folder; may be repeated.")
    ] = None,
    config: Annotated[
        str | None, typer.Option("-c", "--config", help="Task file (TOML), or the name of a shipped one: paper, smoke.")
    ] = None,
    folds: Annotated[int | None, typer.Option(help="Number of folds (default 5).")] = None,
    split: _Split = None,
    seeds: Annotated[str | None, typer.Option(help="Seeds, such as 0,1,2 (default 0).")] = None,
    horizon: Annotated[float | None, typer.Option(help="Seconds to predict (default 120).")] = None,
    history: Annotated[
        float | None, typer.Option(help="Seconds before the start that models may use (default 0).")
    ] = None,
    stride: Annotated[float | None, typer.Option(help="Seconds between scored windows (default: the horizon).")] = None,
    max_runs: Annotated[int | None, typer.Option(help="Use only that many runs, evenly spread.")] = None,
    bands: Annotated[
        bool, typer.Option("--bands", help="Score 90 % bands of position and heading, too: five more fits of each.")
    ] = False,
    simulated: _Simulated = None,
    train_on: _TrainOn = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="Folder for the results (default runs/<name>; <name>-2 beside another study)."
        ),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Keep what the same code, data and task scored before.")
    ] = False,
    executor: Annotated[
        str, typer.Option(help="Where the cells run: local, processes or dask; the numbers are the same.")
    ] = "local",
    workers: Annotated[
        int | None, typer.Option(help="Number of processes at a time (default: one for each CPU).")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of the Dask scheduler, such as tcp://host:8786.")
    ] = None,
    time_limit: Annotated[
        float | None, typer.Option(help="Time limit per fit and prediction in seconds; one that exceeds it is stopped.")
    ] = None,
    memory_limit: Annotated[
        float | None, typer.Option(help="Memory limit per fit in GB; a fit that exceeds it is stopped.")
    ] = None,
    wait: Annotated[
        float | None, typer.Option(help="Seconds to wait for Dask workers before the study stops (default: no limit).")
    ] = None,
    device: Device = None,
    full: Full = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Fit, roll out and score models; print the leaderboard."""
    from ..bench.executors import Execution
    from ..bench.isolate import Limits
    from ..bench.lock import free_folder
    from ..bench.progress import make_progress
    from ..bench.runner import run_tasks
    from ..bench.task import load_tasks
    from ..leaderboard.fit_notes import fit_notes
    from ..leaderboard.pages import write_boards

    models = [*(model or []), *predicted_models(predictions, mapping)]
    overrides = {
        "models": models or None, "datasets": dataset or None, "folds": folds, "split": split,
        "seeds": parse_seeds(seeds),
        "horizon_s": horizon, "history_s": history, "stride_s": stride, "max_runs": max_runs,
        "bands": bands or None, "simulated": simulated, "train_on": parse_words(train_on),
    }  # fmt: skip
    execution = Execution(executor, workers, scheduler, Limits(time_limit, memory_limit), device, wait)
    tasks = load_tasks(config, overrides)
    name = Path(config).stem if config else file_name(Path(tasks[0].dataset).name)
    folder = out or free_folder(Path("runs") / name, tasks, resume)
    progress, command = make_progress(quiet or as_json), str(ctx.obj)
    outcome = run_tasks(tasks, folder, resume=resume, execution=execution, progress=progress, command=command)
    tell = say if not quiet and not as_json else lambda line: None
    written = write_boards(outcome.results, folder, command, tell=tell)
    if as_json:
        boards = {board.dataset: board.as_json() for board, _ in written}
        print_json({"out": str(folder), "leaderboards": boards, "failed": outcome.failed})
    else:
        show_boards(written, full)
        say(f"Results: {folder}\nLeaderboard: {', '.join(str(path) for _, path in written)}")
        if not quiet:
            _tell_equations(outcome.equations)
    for (name, model_name), note in fit_notes(outcome.summaries).items():
        say_wrapped(f"warning: {name}, {model_name}: {note}", err=True)
    exit_if_failed(outcome.failed, f"{len(outcome.failed)} of {len(outcome.summaries)} fits")


def _tell_equations(equations: dict[tuple[str, str], Path]) -> None:
    """Say where the fitted equations are, if there are any."""
    if equations:
        models = "1 model" if len(equations) == 1 else f"{len(equations)} models"
        say(f"Fitted equations of {models}, for example:\n  {next(iter(equations.values()))}")


@app.command()
def validate(as_json: Json = False) -> None:
    """Print the simulator beside published figures."""
    from ..render.table import Table, TableColumn, significant
    from ..simulate.validation import table

    rows = table()
    judged = [row for row in rows if row["passed"] is not None]
    failed = [row for row in judged if not row["passed"]]
    if as_json:
        print_json(rows)
    else:
        words = {True: "passed", False: "FAILED", None: "not judged"}
        columns = [
            TableColumn("ship", "ship"), TableColumn("quantity", "quantity"),
            TableColumn("computed", "computed", significant(4)),
            TableColumn("published", "published", significant(4)), TableColumn("unit", "unit"),
            TableColumn("tolerance", "tolerance"),
            TableColumn("result", "result"), TableColumn("source", "source"),
        ]  # fmt: skip
        within = f"{len(judged) - len(failed)} of {len(judged)} figures with a tolerance are within it."
        say_wrapped(f"{within} {len(rows) - len(judged)} figures are not judged.\n")
        show_table(
            Table(
                "Simulator against published figures", columns, [row | {"result": words[row["passed"]]} for row in rows]
            )
        )
    if failed:
        raise typer.Exit(1)  # a figure is outside its tolerance


@app.command()
def predict(
    model: Annotated[
        str, typer.Argument(metavar="MODEL", help="Folder of a saved model (cells/.../model of a result folder).")
    ],
    dataset: DatasetArgument,
    out: Annotated[Path, typer.Option("-o", "--out", help="CSV file to write.")] = Path("predictions.csv"),
    horizon: Annotated[float | None, typer.Option(help="Seconds to predict (default: each run's length).")] = None,
    device: Device = None,
) -> None:
    """Roll a saved model out over a data set into CSV: states, and 90 % limits x_low to r_high of a model that
    `shipbench run --bands` saved."""
    from ..bench.predict import predict_runs, write_csv
    from ..data.base import load_dataset

    check_output(out, [model, dataset])
    notes: list[str] = []
    predicted = predict_runs(model, load_dataset(dataset), horizon, device, notes.append)
    write_csv(predicted, out)
    say(f"Written: {out} ({len(predicted)} runs)")
    for note in notes:
        say_wrapped(note)


def main() -> None:
    """Run the `shipbench` command. SIGTERM ends it as Ctrl-C does: finished work is kept, no process continues."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    with shield.in_child() if sys.argv[1:2] and sys.argv[1] in shield.COMMANDS else nullcontext():
        app()
