"""What all commands share: their common options and the two ways to print."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .errors import InputError
from .names import shown

if TYPE_CHECKING:
    from rich.console import Console

    from .bench.leaderboard import Board

SETTINGS: dict[str, Any] = {"context_settings": {"help_option_names": ["-h", "--help"]}, "no_args_is_help": True}
"""Of every group of commands."""
Json = Annotated[bool, typer.Option("--json", help="Print one JSON document to stdout and nothing else.")]
Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="No progress.")]
Device = Annotated[str | None, typer.Option(help="Where networks compute: cpu, cuda or cuda:1 (default cpu); physics stays on the CPU.")]
DatasetArgument = Annotated[str, typer.Argument(metavar="DATASET", help="Registered name or folder.")]


def say(text: str, err: bool = False) -> None:
    """Print text that may hold names and words of a stranger's: what a terminal would take for a command is shown."""
    typer.echo(shown(text, keep="\n\t"), err=err)


def print_json(data: Any) -> None:
    """One document on stdout."""
    typer.echo(json.dumps(data, indent=1, default=str, allow_nan=False))


def console_for_tables() -> Console:
    """A console for tables; wide enough for Table III where the output is a file or a pipe."""
    from rich.console import Console

    console = Console(highlight=False, soft_wrap=False)
    return console if console.is_terminal else Console(highlight=False, width=160)


def parse_numbers(option: str, text: str) -> tuple[int, ...]:
    """The whole numbers of an option such as `--seeds 0,1,2`.

    Raises:
        InputError: it is no such list.
    """
    try:
        return tuple(int(s) for s in text.replace(",", " ").split())
    except ValueError:
        raise InputError(f"{option} {text}: not a list of whole numbers; write {option} 0,1,2.") from None


def parse_seeds(text: str | None) -> tuple[int, ...] | None:
    """`--seeds`, or None where it is not given."""
    return None if text is None else parse_numbers("--seeds", text)


def exit_if_failed(failed: Sequence[str], what: str) -> None:
    """Name the fits that failed and end with exit code 1, if there are any; `what` heads the list."""
    if failed:
        typer.echo(f"{what} failed:", err=True)
        for line in failed:
            say(f"  {line}", err=True)
        raise typer.Exit(1)


def show_boards(boards: Sequence[Board]) -> None:
    """Print leaderboards on a terminal."""
    console = console_for_tables()
    for board in boards:
        console.print(f"\n{shown(board.title)}", style="bold", markup=False)
        for table in board.tables:
            table.show(console)
