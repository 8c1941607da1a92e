"""The commands of the data check: `data check`, `suite check`."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .cli_common import DatasetArgument, Json, Quiet, console_for_tables, print_json, say
from .errors import InputError

if TYPE_CHECKING:
    from .checking.applying import Laid
    from .checking.finding import Finding


def data_check(
    dataset: DatasetArgument,
    out: Annotated[Path | None, typer.Option("-o", "--out", help="Folder for findings.json and a picture of each finding.")] = None,
    apply: Annotated[
        bool, typer.Option("--apply", help="Write the proposed lines into dataset.toml; the old file stays beside it as dataset.toml.before-check.")
    ] = False,
    as_json: Json = False,
) -> None:
    """Find faults of a data set from the data themselves: units, signs, frames, clocks, samples, copies.

    Exit code 0: no error among the findings (warnings and notes may be there); 1: at least one error; 2: the input cannot be read.
    """
    from .bench.check_report import check_document, check_tables, write_findings
    from .bench.dataset_facts import dataset_facts
    from .checking.applying import laid, write_lines
    from .checking.base import check_path

    if apply and not Path(dataset, "dataset.toml").is_file():
        raise InputError(
            f"'{dataset}' has no dataset.toml to apply lines to; accepted: a folder with one. Make it: shipbench data export {dataset} --out FOLDER"
        )
    recording, findings = check_path(dataset)
    facts, document = dataset_facts(recording.dataset), check_document(recording, findings)
    proposed = [f for f in findings if f.severity != "note"]
    written = write_findings(recording, findings, out) if out is not None else []
    lines, before = write_lines(Path(dataset), proposed) if apply else (laid(recording.given, proposed), None)
    if as_json:
        print_json(document | ({"before": str(before) if before else None} if apply else {}))
    else:
        _show(facts, findings, check_tables(findings))
        _show_lines(lines, apply)
        if before is not None:
            say(f"Written: {Path(dataset, 'dataset.toml')} (the old file: {before.name}). Next: shipbench data check {dataset}")
        if written:
            say(f"Written: {out} ({len(written)} files)")
    if any(f.severity == "error" for f in findings):
        raise typer.Exit(1)


def _show(facts: dict[str, Any], findings: list[Finding], tables: list[Any]) -> None:
    for key, value in facts.items():
        for line in value if isinstance(value, list) else [value]:
            say(f"{key + ':':<13s}{line}")
    console = console_for_tables()
    for table in tables:
        table.show(console)
    counts = {severity: sum(f.severity == severity for f in findings) for severity in ("error", "warning", "note")}
    said = [f"{number} {severity}{'s' * (number != 1)}" for severity, number in counts.items()]
    say(f"Findings: {', '.join(said)}.")


def _show_lines(lines: Laid, applied: bool) -> None:
    """The entries of dataset.toml that the findings change, and what is left out."""
    from .checking.finding import toml_line

    if lines.changed:
        text = toml_line(lines.changed).split("\n")
        say("\nIn dataset.toml now:" if applied else "\nFor dataset.toml, after you have looked at each finding:")
        for row in text[:40]:
            say(f"  {row if len(row) <= 140 else row[:137] + '...'}")
        if len(text) > 40 or any(len(row) > 140 for row in text):
            say("  (shortened: --out FOLDER writes them all into dataset_lines.toml)")
    for line in lines.refused:
        say(f"Left out: {line}. Look at these findings and write the right line yourself.")
    if applied and not lines.changed:
        say("Nothing to write into dataset.toml.")


def suite_check(
    ctx: typer.Context,
    seeds: Annotated[int, typer.Option(help="Sets per source and fault.")] = 1,
    seed: Annotated[int, typer.Option(help="First seed.")] = 580,
    development: Annotated[bool, typer.Option("--development", help="Other seeds, on which thresholds are set; nothing is published.")] = False,
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder for the page.")] = Path("leaderboards"),
    quiet: Quiet = False,
) -> None:
    """Plant faults in clean simulated sets and count what `data check` finds: check.md."""
    from .bench.check_suite import suite_command
    from .bench.progress import make_progress

    page, tables = suite_command(seeds=seeds, first=seed, development=development, out=out, progress=make_progress(quiet), command=str(ctx.obj))
    if not quiet:
        for table in tables:
            table.show(console_for_tables())
    say(f"Written: {page}")


def register(data_app: typer.Typer, suite_app: typer.Typer) -> None:
    """Add these commands to `shipbench data` and `shipbench suite`."""
    data_app.command("check")(data_check)
    suite_app.command("check")(suite_check)
