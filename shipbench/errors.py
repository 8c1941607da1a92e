"""Exceptions of shipbench: one family, one form of message.

Every message says what is wrong, the value received, what is accepted and what to do.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar

_on_command_line: ContextVar[bool] = ContextVar("on_command_line", default=False)


class ShipbenchError(Exception):
    """Base of every error that shipbench raises on purpose."""


class InputError(ShipbenchError):
    """Error for bad input from the user (the command line ends with exit code 2)."""


class WorkError(ShipbenchError):
    """Error of the work itself on valid input (exit code 1, or a `failed` row in a study)."""


@contextmanager
def command_line() -> Iterator[None]:
    """Let the messages of the work inside name options of the command line."""
    before = _on_command_line.set(True)
    try:
        yield
    finally:
        _on_command_line.reset(before)


def option(command: str, python: str) -> str:
    """Spelling of an option for the caller: `command` such as "--out" on the command line, else `python` such as
    "out="."""
    return command if _on_command_line.get() else python


def unknown_parameter(owner: str, name: str, names: Iterable[str]) -> InputError:
    """Return the error for a parameter that `owner` does not have, with the nearest match and all that it has."""
    known = sorted(names)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return InputError(f"{owner} has no parameter '{name}'.{hint} Accepted: {', '.join(known) or 'none'}.")


def unknown_name(kind: str, name: str, names: Iterable[str]) -> InputError:
    """Return the error for a name that is not registered, with the nearest match and the full list."""
    known = sorted(names)
    near = difflib.get_close_matches(name, known, n=1, cutoff=0.5)
    hint = f" Did you mean '{near[0]}'?" if near else ""
    return InputError(f"unknown {kind} '{name}'.{hint} Known: {', '.join(known) or 'none'}.")
