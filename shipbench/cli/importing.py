"""The command `data import`: a log of a sea trial becomes a data set."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from ..names import file_name
from .common import Json, Quiet, print_json, say, say_wrapped, screen_width


def data_import(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="CSV (also .gz), Parquet, MATLAB .mat or Excel .xlsx files.")
    ],
    mapping: Annotated[
        Path | None, typer.Option("-m", "--map", help="mapping.toml: their columns, units, signs and clock.")
    ] = None,
    ship: Annotated[Path | None, typer.Option("--ship", help="ship.toml of the vessel.")] = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder of the data set (default: the mapping's name).")
    ] = None,
    propose: Annotated[
        Path | None,
        typer.Option(
            "--propose",
            help="Write a draft of mapping.toml for these logs, keeping what --map says, and do nothing else.",
        ),
    ] = None,
    name: Annotated[str | None, typer.Option("--name", help="Name of the data set instead of the mapping's.")] = None,
    dt: Annotated[float | None, typer.Option("--dt", help="Sample time [s] instead of the mapping's.")] = None,
    window: Annotated[float | None, typer.Option("--window", help="Cut into windows of that many seconds.")] = None,
    shortest: Annotated[float | None, typer.Option("--shortest", help="Leave out shorter pieces [s].")] = None,
    still: Annotated[
        float | None, typer.Option("--still", help="Cut where the ship lies still: slower than that [m/s].")
    ] = None,
    encoding: Annotated[
        str | None, typer.Option("--encoding", help="With --propose: encoding of the logs, such as latin-1.")
    ] = None,
    sheet: Annotated[str | None, typer.Option("--sheet", help="With --propose: sheet of the workbook.")] = None,
    header: Annotated[
        int | None,
        typer.Option(
            "--header", min=0, help="With --propose: number of the row with the columns' names; 0 where there is none."
        ),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace the data set in --out (or the draft of --propose).")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Import logs of a trial: resample, derive what is missing, split into runs, write a data set.

    First `shipbench data import LOG --propose mapping.toml`; read and correct the draft; then
    `shipbench data import LOG --map mapping.toml --ship ship.toml --out FOLDER`.
    """
    if propose is not None:
        from ..importing.propose import write_proposal
        from ..render.terminal import command_lines

        known = {
            key: given
            for key, given in (("encoding", encoding), ("sheet", sheet), ("header", header))
            if given is not None
        }
        lines = write_proposal(logs, propose, force, file=known, partial=mapping)
        if as_json:
            print_json({"mapping": str(propose), "remarks": lines})
            return
        *remarks, command = lines
        for line in remarks[-1:] if quiet else remarks:
            say_wrapped(line, hanging=_hanging(line))
        say("\n".join(command_lines(command, screen_width())))
        return
    if only := [
        f"--{name}"
        for name, given in (("encoding", encoding), ("sheet", sheet), ("header", header))
        if given is not None
    ]:
        raise InputError(
            f"{only[0]} serves --propose; an import takes it from the mapping. Write it there: [file] {only[0][2:]} "
            "= ..."
        )
    if mapping is None or ship is None:
        raise InputError(
            f"{'--map' if mapping is None else '--ship'} is missing; needed: --map mapping.toml and --ship ship.toml. "
            "`shipbench data import LOG --propose mapping.toml` writes a draft of the mapping."
        )
    from ..bench.progress import steps_shown
    from ..importing.importer import import_logs
    from ..importing.mapping import load_mapping
    from ..ship import Ship

    plan = load_mapping(mapping, name=name, dt=dt, window=window, shortest=shortest, still_speed=still)
    folder = out or Path(file_name(plan.name))  # a name is no path
    with steps_shown(quiet or as_json):
        summary = import_logs(
            logs, plan, Ship.load(ship), folder, force=force, tell=lambda line: None if quiet else say(line, err=True)
        )
    if as_json:
        print_json(summary.document())
    else:
        for line in summary.lines()[: 1 if quiet else None]:
            say_wrapped(line, hanging=_hanging(line))
        say(f"Written: {folder} ({summary.table.name}, dataset.toml, ship.toml)")
        say(f"Next: shipbench data check {shlex.quote(str(folder))}")


def _hanging(line: str) -> str:
    """Indent of the continuation of a wrapped line."""
    return " " * (len(line) - len(line.lstrip()) + 4)


def register(data_app: typer.Typer) -> None:
    """Add the command to `shipbench data`."""
    data_app.command("import")(data_import)
