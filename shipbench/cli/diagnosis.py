"""The commands of the diagnosis: `diagnose`, `suite`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..names import file_name
from ..regular_files import make_folder
from .common import (
    Commands,
    DatasetArgument,
    Full,
    Json,
    PredictionsMapping,
    Quiet,
    predicted_models,
    print_json,
    prints_aside,
    say,
    screen_width,
)


def diagnose(
    dataset: DatasetArgument,
    model: Annotated[
        str | None,
        typer.Option(
            "-m", "--model", help="Your own simulation to judge, such as sim.py:simulate (default: the ship file's)."
        ),
    ] = None,
    predictions: Annotated[
        str | None,
        typer.Option(help="Trajectories that your simulation predicted, where the simulator itself is not at hand."),
    ] = None,
    mapping: PredictionsMapping = None,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="Folder for diagnosis.json, report.html, summary.txt (default diagnoses/NAME)."
        ),
    ] = None,
    gain: Annotated[bool, typer.Option(help="Measure the gain on held-out runs (most of the time).")] = True,
    seed: Annotated[int, typer.Option(help="Seed of folds and bootstrap.")] = 0,
    workers: Annotated[int, typer.Option(help="Processes for the folds.")] = 2,
    thorough: Annotated[
        bool, typer.Option("--thorough", help="Use up to twice as much of a long record (twice the time or more).")
    ] = False,
    cpu_limit: Annotated[
        float,
        typer.Option(
            min=1.0, max=86_400.0, help="CPU time limit [s]; the results so far are then reported, with a note."
        ),
    ] = 900.0,
    full: Full = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Show what the physics model gets wrong on a data set, name the cause, and measure its held-out gain."""
    from ..bench.progress import steps_shown
    from ..data.base import load_dataset
    from ..diagnosis.diagnose import diagnose as run
    from ..estimation.budget import Budget
    from ..replay.stand_in import stand_in
    from ..reports.diagnosis.files import document, with_correction, write_diagnosis
    from ..reports.diagnosis.summary import summary_lines
    from ..specs import parse_spec

    data = load_dataset(dataset)
    folder = out or Path("diagnoses") / file_name(Path(data.name).name)
    make_folder(folder)
    if model is not None and predictions is not None:
        raise InputError("--model and --predictions are both given; accepted: one of them, the simulation to judge.")
    asked = [*([model] if model else []), *predicted_models([predictions] if predictions else None, mapping)]
    judged = stand_in(parse_spec(asked[0]), data) if asked else None
    with steps_shown(quiet or as_json), prints_aside():
        found = run(
            data, gain=gain, seed=seed, workers=workers, thorough=thorough, budget=Budget(seconds=cpu_limit),
            simulation=None if judged is None else judged.spec,
        )  # fmt: skip
    found = replace(found, spec=dataset, stand_in="" if judged is None else judged.note)
    found = with_correction(found, folder)
    written = write_diagnosis(found, folder)
    if as_json:
        print_json(document(found))
        return
    for line in summary_lines(found, screen_width(), full):
        say(line)
    say(f"Written: {', '.join(str(p) for p in written)}")


suite_app = typer.Typer(cls=Commands, help="Test suites of the framework itself.", no_args_is_help=True)


@suite_app.command("diagnosis")
def suite_diagnosis(
    ctx: typer.Context,
    seed: Annotated[int, typer.Option(help="Everything is drawn from it.")] = 0,
    per_effect: Annotated[int, typer.Option(help="Sets per effect and size.")] = 3,
    kinds: Annotated[
        str | None,
        typer.Option(
            help="single,pair,none-same,none-other,outside,change,unit,published,none-published (default all)."
        ),
    ] = None,
    development: Annotated[bool, typer.Option("--development", help="The ships on which thresholds are set.")] = False,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the rows.")] = Path("runs/suite-diagnosis"),
    gain: Annotated[
        bool, typer.Option(help="Also the held-out gain of every diagnosis and of the oracle (four times the time).")
    ] = True,
    resume: Annotated[bool, typer.Option(help="Keep what the same code has finished before.")] = True,
    workers: Annotated[int, typer.Option(help="Processes.")] = 2,
) -> None:
    """Hide causes in simulated runs, diagnose them, and score the diagnosis: leaderboards/diagnosis.md."""
    from ..diagnosis.diagnose import diagnose as run
    from ..suites.diagnosis.suite import suite_command

    page, rows = suite_command(
        diagnose=run, seed=seed, per_effect=per_effect, kinds=kinds, development=development, out=out, resume=resume,
        workers=workers,
        gain=gain, command=str(ctx.obj),
    )  # fmt: skip
    say(f"Written: {page} ({len(rows)} sets)")


def register(app: typer.Typer) -> None:
    """Add these commands to the command line."""
    app.command()(diagnose)
    app.add_typer(suite_app, name="suite")
