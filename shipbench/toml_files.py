"""TOML files that people write (dataset.toml, ship.toml, a task, a mapping): parsed within bounds, with strict types
and one form of message."""

from __future__ import annotations

import re
import reprlib
import tomllib
from pathlib import Path
from typing import Annotated, Any

from pydantic import BeforeValidator, ValidationError

from .errors import InputError
from .regular_files import read_text

MOST_TOML = 8_000_000
"""Most bytes of a file; the dataset.toml of 10,000 runs has some 2 MB."""
_DEEPEST = 32
"""Most levels of nested tables and lists; the files of shipbench have 4."""
_PART = r"""(?:"[^"\n]*+"|'[^'\n]*+'|[\w-]++)\s*+"""
_CHAIN = re.compile(rf"(?<![\w-])(?:{_PART}\.\s*+){{{_DEEPEST},}}+(?:{_PART}([=\]]))?")
"""Pattern of a long dotted key. The parser's time grows with the square of a key's parts."""
_LONGEST_SHOWN = 80


def read_toml(path: str | Path) -> dict[str, Any]:
    """Parse a TOML file.

    Raises:
        InputError: the file is missing, not a regular file, too large, not TOML, nested too deeply, or holds an integer
            beyond 64 bits.
    """
    text = read_text(path, "TOML file", MOST_TOML)
    try:
        if any(chain[1] for chain in _CHAIN.finditer(text)):
            raise InputError(
                f"{path} is not valid TOML: a key has more than {_DEEPEST} parts; accepted: up to {_DEEPEST}. "
                "Shorten the key."
            )
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path} is not valid TOML: {error}. Correct the line that the message names.") from None
    except RecursionError:
        raise _too_deep(path) from None
    except ValueError:  # Python reads no decimal integer of more than 4300 digits
        raise _too_large(path) from None
    _check_bounds(data, path)
    return data


def _check_bounds(data: dict[str, Any], path: str | Path) -> None:
    """Refuse nesting and integers beyond the limits of TOML. A loop, not a recursion: nesting has no limit."""
    levels = [iter(data.values())]
    while levels:
        for value in levels[-1]:
            if isinstance(value, dict | list):
                levels.append(iter(value.values() if isinstance(value, dict) else value))
                break
            if isinstance(value, int) and not -(2**63) <= value < 2**63:
                raise _too_large(path)
        else:
            levels.pop()
        if len(levels) > _DEEPEST:
            raise _too_deep(path)


def _too_deep(path: str | Path) -> InputError:
    return InputError(
        f"{path} is not valid TOML: it is nested too deeply; accepted: up to {_DEEPEST} levels. Put the entries "
        "into fewer tables."
    )


def _too_large(path: str | Path) -> InputError:
    return InputError(
        f"{path} is not valid TOML: an integer does not fit into 64 bits; accepted: -2^63 to 2^63 - 1. Write it as "
        "1e30, or shorter."
    )


def _number(value: Any) -> Any:
    """Refuse values that pydantic would convert to a number: "2" and true."""
    if isinstance(value, str | bytes | bool):
        raise ValueError(f"Input should be a number, not {'true or false' if isinstance(value, bool) else 'text'}")
    return value


def _switch(value: Any) -> Any:
    if not isinstance(value, bool):
        raise ValueError("Input should be true or false")
    return value


Number = Annotated[float, BeforeValidator(_number)]
"""Number that was written as one; infinite and NaN are the model's choice (`allow_inf_nan` of its config)."""
Whole = Annotated[int, BeforeValidator(_number)]
"""Whole number (2 or 2.0)."""
Switch = Annotated[bool, BeforeValidator(_switch)]
"""Value true or false; 1 and "yes" are neither."""


def fault(error: ValidationError) -> tuple[tuple[str, ...], str, str]:
    """First fault that pydantic found: the place as keys, the kind of fault, and the message on the value received, in
    words."""
    first = error.errors()[0]
    place = tuple(str(key) for key in first["loc"])
    received = first["input"]
    shown = reprlib.repr(received) if isinstance(received, dict | list | tuple) else str(received)[:_LONGEST_SHOWN]
    value = "" if first["type"] == "missing" else f" (value: {shown})"
    more = f" ({error.error_count() - 1} more faults)" if error.error_count() > 1 else ""
    return place, first["type"], f"{first['msg'].removeprefix('Value error, ')}{value}{more}"
