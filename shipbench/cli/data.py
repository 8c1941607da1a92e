"""The commands below `shipbench data`; other modules add theirs to `data_app`."""

from __future__ import annotations

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer

from ..errors import InputError
from .common import (
    SETTINGS,
    Commands,
    DatasetArgument,
    Device,
    Full,
    Json,
    Quiet,
    print_json,
    prints_aside,
    say,
    say_wrapped,
    show_table,
)

data_app = typer.Typer(
    cls=Commands, help="Data sets: list, get, make, check, describe, export, import, simulate.", **SETTINGS
)


@data_app.command("list")
def data_list(as_json: Json = False) -> None:
    """List the registered data sets."""
    from ..data.base import DATASETS

    parts = [DATASETS.get(name) for name in DATASETS.names()]
    if as_json:
        print_json([{"name": p.name, "summary": p.summary, "licence": p.licence} for p in parts])
        return
    for part in parts:
        say_wrapped(f"{part.name:<18s} {part.summary} ({part.licence})", hanging=" " * 19)


@data_app.command("get")
def data_get(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Registered name of a public data set.")],
    source: Annotated[
        str | None, typer.Option("--from", help="Folder with a copy, or another address of the same files.")
    ] = None,
    accept: Annotated[
        bool, typer.Option("--accept-licence", help="Accept the licence that is shown, without being asked.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Download a public data set (or take a copy) after its licence is accepted; every file is checked."""
    from ..data.base import DATASETS, public_folder

    public = DATASETS.get(name).public
    if public is None:
        raise InputError(f"data set '{name}' is not downloaded; it is made: shipbench data make {name}.")
    folder = public_folder(name)
    if not public.missing(folder) and not public.changed(folder):
        say(f"{name}: all {len(public.checksums)} files are in {folder} already, with the published checksums")
        return
    say(public.notice(), err=True)
    if not accept:
        if not sys.stdin.isatty():
            raise InputError(
                "the licence above is not accepted, and there is no terminal to ask on; nothing was fetched. Add "
                "--accept-licence."
            )
        if not typer.confirm("Do you accept the licence?", err=True):
            raise InputError("the licence is not accepted; nothing was fetched.")
    fetched = public.fetch(folder, source, (lambda text: None) if quiet else lambda text: say(text, err=True))
    say(
        f"{name}: {len(fetched)} files fetched into {folder}, every checksum is right. Use it: shipbench data "
        f"describe {name}"
    )


@data_app.command("make")
def data_make(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Registered name, with parameters in brackets.")],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Also write it as a folder of the common format.")
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Make it anew even if it is in the cache.")] = False,
    quiet: Quiet = False,
) -> None:
    """Make a data set (or take it from the cache)."""
    from ..data.base import cache_folder, load_dataset
    from ..data.files import write_dataset

    dataset = load_dataset(name, remake=force)
    if out is not None:
        write_dataset(dataset, out)
    say(f"{dataset.name}: {len(dataset)} runs, fingerprint {dataset.fingerprint}, in {out or cache_folder()}")


@data_app.command("describe")
def data_describe(
    ctx: typer.Context,
    dataset: DatasetArgument,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Write a data card there: card.md and card.html, with plots.")
    ] = None,
    full: Full = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Print a data card: statistics (beside the paper's Table II), durations, noise, what the data cannot identify."""
    from ..bench.progress import steps_shown
    from ..data.base import load_dataset
    from ..reports.dataset.card import make_card
    from ..reports.dataset.card_page import write_card

    with steps_shown(quiet or as_json):
        data = load_dataset(dataset)
        card = make_card(data)
    written = write_card(card, data, out, str(ctx.obj)) if out is not None else []
    if as_json:
        print_json(card.document())
        return
    say_wrapped(f"{card.lead()}\n")
    for table in card.tables.values() if full else card.brief():
        show_table(table)
    if not full:
        say("All tables: --full" + ("" if written else ", or --out FOLDER for a page with plots"))
    if written:
        say(f"Written: {', '.join(map(str, written))}")


@data_app.command("export")
def data_export(
    what: Annotated[
        str,
        typer.Argument(
            metavar="DATASET", help="Registered name or folder; or a result folder of `run`: its predictions."
        ),
    ],
    out: Annotated[Path, typer.Option("-o", "--out", help="Folder to write, or a file that ends in .mat.")],
    format: Annotated[
        str | None, typer.Option("--format", help="csv, parquet or mat (MATLAB; the default for a file .mat).")
    ] = None,
    quiet: Quiet = False,
) -> None:
    """Write a data set, or the predictions of a study, as CSV, Parquet or MATLAB file."""
    from ..bench.export import export_predictions, is_results
    from ..data.base import load_dataset
    from ..data.export import check_format, export_dataset

    dataset = None if is_results(Path(what)) else load_dataset(what)
    form = check_format(format, out, what)
    written = export_predictions(Path(what), out, form) if dataset is None else export_dataset(dataset, out, form)
    say(f"Written: {', '.join(map(str, written))}")


@data_app.command("simulate")
def data_simulate(
    model: Annotated[
        str,
        typer.Argument(
            metavar="MODEL",
            help="Model that needs no fit: folder of a saved model, sim.py:simulate, ship.fmu, oracle, or physics (as "
            "the particulars of the ship give it).",
        ),
    ],
    like: Annotated[str, typer.Option("--like", help="Measured data set: registered name or folder.")],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Folder to write (default: <data set>-simulated).")
    ] = None,
    device: Device = None,
    quiet: Quiet = False,
) -> None:
    """Simulate every run of a data set from its measured start with its inputs: its simulated twin."""
    from ..bench.twins import mean_distance, simulate_like, write_twin
    from ..data.base import load_dataset

    data = load_dataset(like)
    with prints_aside():
        twin = simulate_like(model, data, device)
    folder = out or Path(twin.name)
    write_twin(twin, folder)
    away = f"{mean_distance(twin, data):.3g} m from the measured positions on average"
    say(f"Written: {folder} ({len(twin)} runs, {away})")
    if not quiet:
        say(f"Train on it: shipbench run -m mlp --dataset {shlex.quote(like)} --simulated {shlex.quote(str(folder))}")


def register(app: typer.Typer) -> None:
    """Add these commands to the command line."""
    app.add_typer(data_app, name="data")
