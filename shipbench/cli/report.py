"""The command `report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..regular_files import check_output
from .common import Json, Quiet, print_json, say


def report(
    ctx: typer.Context,
    results: Annotated[list[Path], typer.Argument(metavar="RESULTS...", help="Result folders of `shipbench run`.")],
    out: Annotated[
        Path | None,
        typer.Option("-o", "--out", help="HTML file to write (default: report.html in the first result folder)."),
    ] = None,
    diagnosis: Annotated[
        list[Path] | None, typer.Option("--diagnosis", help="Folder of a diagnosis to link; may be repeated.")
    ] = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Write a page to look at: leaderboard, tracks, error growth, regimes, fitted parameters, failures; one HTML file
    that needs no network."""
    from ..bench.submissions import read_results
    from ..reports.study.page import write_report

    if out is not None:
        check_output(out, [] if out.suffix == ".html" else results)
    written = write_report(
        read_results(results), out or results[0] / "report.html", str(ctx.obj), given=diagnosis or []
    )
    if as_json:
        print_json({"out": str(written.path), "bytes": written.size, "left_out": written.left_out})
        return
    if not quiet:
        for dataset, lines in written.left_out.items():
            for line in lines:
                say(f"{dataset}: {line}")
    say(f"Written: {written.path} ({written.size / 1e6:.1f} MB)")


def register(app: typer.Typer) -> None:
    """Add the command to the command line."""
    app.command()(report)
