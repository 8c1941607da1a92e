"""Common parts of all commands: their options and the two ways to print."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stdout
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from ..errors import InputError
from ..names import shown

if TYPE_CHECKING:
    from pathlib import Path

    from rich.console import Console

    from ..leaderboard.board import Board
    from ..render.table import Table

SETTINGS: dict[str, Any] = {"context_settings": {"help_option_names": ["-h", "--help"]}, "no_args_is_help": True}
"""Settings of every group of commands."""
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document to stdout and nothing else.")]
Quiet = Annotated[
    bool,
    typer.Option("-q", "--quiet", help="No progress and no notes; the result and what was written are still printed."),
]
Full = Annotated[bool, typer.Option("--full", help="Print all tables, as on the written page.")]
Device = Annotated[
    str | None,
    typer.Option(help="Where networks compute: cpu, cuda or cuda:1 (default cpu); physics stays on the CPU."),
]
Predictions = Annotated[
    list[str] | None,
    typer.Option("--predictions", help="File or folder of predicted trajectories, as a model; may be repeated."),
]
PredictionsMapping = Annotated[
    str | None, typer.Option("--mapping", help="Mapping (TOML) of the files of --predictions, as for a log.")
]
DatasetArgument = Annotated[str, typer.Argument(metavar="DATASET", help="Registered name or folder.")]


HELP = 200
"""Most characters of the help of one command in a list of commands: it wraps, and is not cut."""


class Commands(TyperGroup):
    """Group of commands whose list shows their help whole."""

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Write the commands in their order."""
        with formatter.section("Commands"):
            formatter.write_dl(
                [(name, self.commands[name].get_short_help_str(HELP)) for name in self.list_commands(ctx)]
            )


def say(text: str, err: bool = False) -> None:
    """Print text that may hold names and words of others: characters that a terminal would take for a command are shown
    as escapes."""
    typer.echo(shown(text, keep="\n\t"), err=err)


@contextmanager
def prints_aside() -> Iterator[None]:
    """Send what a user's code prints on stdout to stderr meanwhile, also from C and from other processes."""
    sys.stdout.flush()
    kept = os.dup(1)
    os.dup2(2, 1)
    try:
        with redirect_stdout(sys.stderr):
            yield
    finally:
        sys.stdout.flush()
        os.dup2(kept, 1)
        os.close(kept)


def print_json(data: Any) -> None:
    """Print one document on stdout."""
    typer.echo(json.dumps(data, indent=1, default=str, allow_nan=False))


def console_for_tables() -> Console:
    """Console for tables, as wide as the terminal; 80 columns in a file, a pipe or a notebook, or the number in
    COLUMNS."""
    from rich.console import Console

    return Console(highlight=False)


def show_table(table: Table) -> None:
    """Print one table."""
    from ..render.terminal import show_table as show

    show(table, console_for_tables())


def say_wrapped(text: str, indent: str = "", hanging: str = "", err: bool = False) -> None:
    """Print text in lines of the terminal's width. In a pipe without COLUMNS lines stay whole: they can be searched."""
    from ..render.terminal import paragraph

    width = screen_width() if (sys.stderr if err else sys.stdout).isatty() or "COLUMNS" in os.environ else 10**6
    for line in text.split("\n"):
        say("\n".join(paragraph(shown(line), width, indent, hanging)), err=err)


def screen_width() -> int:
    """Columns of the terminal, as for `console_for_tables`."""
    return console_for_tables().width


def parse_numbers(option: str, text: str) -> tuple[int, ...]:
    """Whole numbers of an option such as `--seeds 0,1,2`.

    Raises:
        InputError: it is no such list.
    """
    try:
        return tuple(int(s) for s in text.replace(",", " ").split())
    except ValueError:
        raise InputError(f"{option} {text}: not a list of whole numbers; write {option} 0,1,2.") from None


def parse_seeds(text: str | None) -> tuple[int, ...] | None:
    """Seeds of `--seeds`, or None where it is not given."""
    return None if text is None else parse_numbers("--seeds", text)


def parse_words(text: str | None) -> tuple[str, ...] | None:
    """Words of an option with commas between them, or None where it is not given."""
    return None if text is None else tuple(word.strip() for word in text.split(",") if word.strip())


def predicted_models(paths: Sequence[str] | None, mapping: str | None) -> list[str]:
    """Specs of the models of `--predictions`, with the mapping of `--mapping`.

    Raises:
        InputError: a mapping is given without predictions.
    """
    if mapping and not paths:
        raise InputError(
            f"--mapping {mapping} belongs to --predictions, which is not given. Accepted: --predictions FOLDER "
            f"--mapping {mapping}."
        )
    given = f"[mapping={mapping}]" if mapping else ""
    return [f"predictions:{path}{given}" for path in paths or []]


def exit_if_failed(failed: Sequence[str], what: str) -> None:
    """Name the fits that failed and end with exit code 1, if there are any; `what` heads the list."""
    if failed:
        typer.echo(f"{what} failed:", err=True)
        for line in failed:
            say(f"  {line}", err=True)
        raise typer.Exit(1)


def show_boards(boards: Sequence[tuple[Board, Path]], full: bool) -> None:
    """Print leaderboards on a terminal: a sentence, then a short table, or all tables."""
    for board, page in boards:
        say("")
        say_wrapped(f"{board.title}\n{board.lead}\n")
        short = None if full else board.short
        for table in [short] if short else board.tables:
            show_table(table)
        if short:
            say_wrapped(f"All {len(board.tables)} tables: --full, or {page}")
