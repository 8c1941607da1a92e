"""The command `demo`: the whole way from a trial to a named cause and a page, on a small simulated trial."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any

import typer

from .common import Quiet, say_wrapped


def demo(
    ctx: typer.Context,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the results and the page.")] = Path("demo"),
    quiet: Quiet = False,
) -> None:
    """Make a small trial with a hidden current, score three models, diagnose it, and write one page.

    Takes under a minute on two cores. Nothing is read but the package itself.
    """
    from ..bench.progress import make_progress
    from ..bench.runner import run_tasks
    from ..bench.submissions import read_results
    from ..bench.task import load_tasks
    from ..data.base import load_dataset
    from ..data.demo import SPEED, TOWARDS
    from ..diagnosis.diagnose import diagnose
    from ..reports.diagnosis.files import write_diagnosis
    from ..reports.study.page import write_report

    trial = load_dataset("demo")
    note = (lambda text: None) if quiet else (lambda text: typer.echo(text, err=True))
    note(
        f"1/3 diagnose: a trial of {len(trial.runs)} runs with a current of {SPEED} m/s towards {_degrees(TOWARDS)} "
        "that no model knows"
    )
    found = replace(diagnose(trial, gain=False), spec="demo")
    note("2/3 score: no model, the physics, and the physics with what was found; 3 folds by run")
    models = list(dict.fromkeys(["hold", "physics", found.extended_model]))
    tasks = load_tasks(None, {"models": models, "datasets": ["demo"], "folds": 3, "horizon_s": 60.0})
    run_tasks(tasks, out, progress=make_progress(quiet), command=str(ctx.obj))
    note("3/3 write the page")
    results = read_results([out])
    write_diagnosis(found, out / "diagnosis")
    page = write_report(results, out / "report.html", str(ctx.obj), given=[out / "diagnosis"])
    error = results.rows.groupby("model").ed.mean()
    say_wrapped(f"Hidden in the trial: a current of {SPEED} m/s towards {_degrees(TOWARDS)}. Found: {_found(found)}.")
    say_wrapped(
        "Position error after a 60 s prediction, mean over held-out runs: "
        f"{', '.join(f'{m} {error[m]:.1f} m' for m in models)}."
    )
    typer.echo(f"Page: {page.path}. Open it in a browser.")
    typer.echo("Your trial: shipbench data import LOG.csv --propose mapping.toml")
    typer.echo("Your model: shipbench run --model path/to/model.py:Class --model physics --dataset demo --horizon 60")


def _degrees(angle: float) -> str:
    from math import degrees

    return f"{degrees(angle):03.0f}°"


def _found(found: Any) -> str:
    """The named causes in words."""
    if not found.causes:
        return "nothing"
    words = []
    for cause in found.causes:
        size = cause.parameters
        if {"speed", "to"} <= size.keys():
            low, high = size["speed"].ci95
            words.append(
                f"{cause.effect} of {size['speed'].value:.2f} m/s (95 %: {low:.2f} to {high:.2f}) towards "
                f"{_degrees(size['to'].value)}"
            )
        else:
            words.append(cause.effect)
    return " and ".join(words)


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(demo)
