"""Writes the reference of all commands into commands.md when the site is built, from the command line itself: it cannot
fall behind."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from typing import Any


def on_page_markdown(markdown: str, page: Any, config: Any, files: Any) -> str:
    """Called by mkdocs for every page."""
    if page.file.src_path != "commands.md":
        return markdown
    import typer

    from shipbench.cli.app import app

    return markdown.replace("<!-- commands -->", "\n".join(_sections(typer.main.get_command(app), "shipbench")))


def _sections(command: Any, name: str) -> Iterator[str]:
    if hasattr(command, "commands"):
        for part in sorted(command.commands):
            yield from _sections(command.commands[part], f"{name} {part}")
        return
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    options = [p for p in command.params if p.param_type_name == "option" and not p.hidden]
    yield f"## `{' '.join([name, *(a.metavar or a.human_readable_name for a in arguments)])}`\n"
    yield f"{one_line(command.help)}\n"
    if arguments or options:
        yield "| | |\n|---|---|"
        for a in arguments:
            yield f"| `{a.metavar or a.human_readable_name}` | {one_line(getattr(a, 'help', ''))} |"
        for o in options:
            yield f"| {', '.join(f'`{n}`' for n in (*o.opts, *o.secondary_opts))} | {one_line(o.help)} |"
        yield ""


def one_line(words: str | None) -> str:
    """Words of the program as one line of Markdown that also fits a cell of a table."""
    return escape(" ".join((words or "").split()), quote=False).replace("|", "\\|")
