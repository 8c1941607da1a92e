"""The command that puts the contract to a model: `check`."""

from __future__ import annotations

from typing import Annotated

import typer

from .common import Device, Json, print_json, prints_aside, say_wrapped, show_table


def check(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="Model spec: name, name[key=value], path/to/model.py:ClassName, or a saved model's folder.",
        ),
    ],
    dataset: Annotated[
        str | None,
        typer.Option("-d", "--dataset", help="Check on a few windows of these data (default: small simulated runs)."),
    ] = None,
    device: Device = None,
    as_json: Json = False,
) -> None:
    """Check whether a model keeps the contract, rule by rule, in seconds.

    The model is fitted three times on a few short runs; give one that trains for long few epochs:
    'neural_ode[epochs=2]'.

    Exit code 0: every rule that applies is kept; 1: at least one is broken; 2: the model cannot be made or the data
    cannot be read.
    """
    from ..contract.base import BROKEN, NOT_APPLICABLE, PASSED
    from ..contract.check import check_model
    from ..data.base import load_dataset
    from ..render.table import Table, TableColumn

    data = None if dataset is None else load_dataset(dataset)
    with prints_aside():
        report = check_model(model, data, device)
    if as_json:
        print_json(report.document())
    else:
        shown = {PASSED: "passed", BROKEN: "BROKEN", NOT_APPLICABLE: "n/a"}
        columns = [
            TableColumn("rule", "rule"),
            TableColumn("", "status"),
            TableColumn("what it says", "says"),
            TableColumn("evidence", "evidence"),
        ]
        tried = [v for v in report.verdicts if v.tried]
        rows = [
            vars(v) | {"status": shown[v.status], "says": "" if v.status == PASSED else v.says}
            for v in sorted(tried, key=lambda v: v.status != BROKEN)
        ]
        counts = [len(report.of(status)) for status in (PASSED, BROKEN, NOT_APPLICABLE)]
        verdict = "breaks the contract" if counts[1] else "keeps the contract"
        say_wrapped(
            f"'{report.model}' {verdict}: {{}} rules passed, {{}} broken, {{}} not applicable; {report.seconds:.1f} "
            "s.\n".format(*counts)
        )
        show_table(Table(f"{report.model} on {report.data}", columns, rows))
        if others := [v.rule for v in report.verdicts if not v.tried]:
            say_wrapped(f"Not tried, since a rule before them is broken: {', '.join(others)}.")
    if report.of(BROKEN):
        raise typer.Exit(1)


def register(app: typer.Typer) -> None:
    """Add this command to the command line."""
    app.command()(check)
