"""The commands of the data check: `data check`, `suite check`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from .common import DatasetArgument, Full, Json, Quiet, print_json, say, say_wrapped, screen_width, show_table

if TYPE_CHECKING:
    from ..checking.applying import Laid
    from ..checking.finding import Finding


def data_check(
    ctx: typer.Context,
    dataset: DatasetArgument,
    out: Annotated[
        Path | None,
        typer.Option(
            "-o", "--out", help="Folder for a page (check.html), findings.json and a picture of each finding."
        ),
    ] = None,
    apply: Annotated[
        bool,
        typer.Option(
            "--apply",
            help="Write the proposed lines into dataset.toml; the old file stays beside it as "
            "dataset.toml.before-check.",
        ),
    ] = False,
    full: Full = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Find faults of a data set from the data themselves: units, signs, frames, clocks, samples, copies.

    Exit code 0: no error among the findings (warnings and notes may be there); 1: at least one error; 2: the input
    cannot be read.
    """
    from ..bench.progress import steps_shown
    from ..checking.applying import laid, write_lines
    from ..checking.base import check_path
    from ..reports.dataset.facts import dataset_facts
    from ..reports.dataset.findings import check_document, write_findings

    if apply and not Path(dataset, "dataset.toml").is_file():
        raise InputError(
            f"'{dataset}' has no dataset.toml to apply lines to; accepted: a folder with one. Make it: shipbench "
            f"data export {dataset} --out FOLDER"
        )
    with steps_shown(quiet or as_json):
        recording, findings = check_path(dataset)
    facts, document = dataset_facts(recording.dataset), check_document(recording, findings)
    proposed = [f for f in findings if f.severity != "note"]
    written = write_findings(recording, findings, out, str(ctx.obj)) if out is not None else []
    lines, before = write_lines(Path(dataset), proposed) if apply else (laid(recording.given, proposed), None)
    if as_json:
        print_json(document | ({"before": str(before) if before else None} if apply else {}))
    else:
        _show(facts, findings, full)
        _show_lines(lines, apply)
        if before is not None:
            say(
                f"Written: {Path(dataset, 'dataset.toml')} (the old file: {before.name}). Next: shipbench data "
                f"check {dataset}"
            )
        if written:
            say(f"Written: {written[0]} and {len(written) - 1} files beside it")
    if any(f.severity == "error" for f in findings):
        raise typer.Exit(1)


_BRIEF = ("name", "ship", "runs")
"""Facts that are printed without --full."""


def _show(facts: dict[str, Any], findings: list[Finding], full: bool) -> None:
    """Print the number of findings in a sentence, facts of the data set, then each finding with its correction; notes
    with --full only."""
    counts = {severity: sum(f.severity == severity for f in findings) for severity in ("error", "warning", "note")}
    numbers = [f"{number} {severity}{'s' * (number != 1)}" for severity, number in counts.items()]
    say(f"Findings: {', '.join(numbers)}.\n")
    for key, value in facts.items():
        if full or key in _BRIEF:
            for line in value if isinstance(value, list) else [value]:
                say_wrapped(f"{key + ':':<13s}{line}", hanging=" " * 13)
    for f in findings:
        if f.severity != "note" or full:
            _show_finding(f)
    if counts["note"] and not full:
        say(f"\n{numbers[-1]} more: --full")


def _show_finding(finding: Finding) -> None:
    channels = f" of {', '.join(finding.channels)}" if finding.channels else ""
    say("")
    say_wrapped(f"{finding.severity.upper()}: {finding.kind}{channels}", hanging="  ")
    say_wrapped(finding.text, "  ")
    lines = finding.line.split("\n") if finding.line else []
    for line in lines[:_LINES]:
        say(f"    {_cut(line, screen_width() - 4)}")
    if len(lines) > _LINES:
        say(f"    ... and {len(lines) - _LINES} more lines")
    if finding.todo:
        say_wrapped(finding.todo, "  ")


_LINES = 6
"""Most lines for dataset.toml that are printed with a finding; all stand together below, and in the folder of --out."""


def _cut(line: str, width: int) -> str:
    return line if len(line) <= width else f"{line[: width - 3]}..."


def _show_lines(lines: Laid, applied: bool) -> None:
    """Print the entries of dataset.toml that the findings change, and the omitted ones."""
    from ..checking.finding import toml_line

    if lines.changed:
        text = toml_line(lines.changed).split("\n")
        say("\nIn dataset.toml now:" if applied else "\nFor dataset.toml, after you have looked at each finding:")
        width = screen_width() - 2
        for row in text[:40]:
            say(f"  {_cut(row, width)}")
        if len(text) > 40 or any(len(row) > width for row in text):
            say("  (shortened: --out FOLDER writes them all into dataset_lines.toml)")
    for line in lines.refused:
        say_wrapped(f"Left out: {line}. Look at these findings and write the right line yourself.")
    if applied and not lines.changed:
        say("Nothing to write into dataset.toml.")


def suite_check(
    ctx: typer.Context,
    seeds: Annotated[int, typer.Option(help="Sets per source and fault.")] = 1,
    seed: Annotated[int, typer.Option(help="First seed.")] = 580,
    development: Annotated[
        bool, typer.Option("--development", help="Other seeds, on which thresholds are set; nothing is published.")
    ] = False,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the page.")] = Path("leaderboards"),
    quiet: Quiet = False,
) -> None:
    """Plant faults in clean simulated sets and count what `data check` finds: check.md."""
    from ..bench.progress import make_progress
    from ..suites.checks.suite import suite_command

    page, tables = suite_command(
        seeds=seeds, first=seed, development=development, out=out, progress=make_progress(quiet), command=str(ctx.obj)
    )
    for table in tables:
        show_table(table)
    say(f"Written: {page}")


def register(data_app: typer.Typer, suite_app: typer.Typer) -> None:
    """Add these commands to `shipbench data` and `shipbench suite`."""
    data_app.command("check")(data_check)
    suite_app.command("check")(suite_check)
