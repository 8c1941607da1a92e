"""The command that writes a fitted model for other programs: `export`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .common import say


def export(
    model: Annotated[
        str, typer.Argument(metavar="MODEL", help="Folder of a saved model (cells/.../model of a result folder).")
    ],
    format: Annotated[
        str,
        typer.Option(
            "--format",
            help="fmu (co-simulation), c (source with header and test), casadi (serialised function), matlab (one "
            "function) or json (the force law).",
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="File to write, or folder of c (default: named after ship and model)."),
    ] = None,
    fmi: Annotated[int, typer.Option(help="Version of FMI of an FMU: 2 or 3.")] = 2,
    force: Annotated[bool, typer.Option("--force", help="Replace what is there.")] = False,
) -> None:
    """Write fitted physics as an FMU, C, MATLAB, CasADi or JSON; the numbers are those of `predict`."""
    from ..exporting.formats import export as write

    path = write(model, format, out, fmi=fmi, force=force)
    say(f"Written: {path}")


def register(app: typer.Typer) -> None:
    """Add this command to the command line."""
    app.command()(export)
