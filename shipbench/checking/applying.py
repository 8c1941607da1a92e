"""Corrections of findings written into dataset.toml: they add to its entries; those that contradict it or one another
are left out."""

from __future__ import annotations

import math
import shutil
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w
import tomlkit
from tomlkit.exceptions import TOMLKitError

from ..data.files import BEFORE_CHECK, parse_description
from ..errors import InputError
from ..storage import write_text
from ..toml_files import read_toml
from .finding import Finding, toml_line

_Path = tuple[str, ...]
_KEPT = ("units", "frame", "velocities", "wind")
"""Keys by which the table was read: another value does not correct the first."""


@dataclass(frozen=True)
class Laid:
    """Result of merging. description: dataset.toml with the new lines; changed: its new entries; refused: lines left
    out, with the reason."""

    description: dict[str, Any]
    changed: dict[str, Any] = field(default_factory=dict)
    refused: tuple[str, ...] = ()


def laid(given: dict[str, Any], findings: Sequence[Finding]) -> Laid:
    """Merge the lines of all findings into `given`, a parsed dataset.toml ({}: none), with which the data were read."""
    entries = [(f, dict(_leaves(tomllib.loads(f.line)))) for f in findings if f.line]
    clashes: dict[int, str] = {}
    for i, (finding, mine) in enumerate(entries):
        for key in mine:
            if key[0] in _KEPT and _at(given, key) not in (None, mine[key]):
                clashes[i] = (
                    f"{_said(key, mine[key])} ({finding.kind}) contradicts {_said(key, _at(given, key))} in "
                    "dataset.toml"
                )
            for j, (other, theirs) in enumerate(entries[:i]):
                if key in theirs and not _alike(mine[key], theirs[key]):
                    words = (
                        f"{_said(key, theirs[key])} ({other.kind}) and {_said(key, mine[key])} ({finding.kind}) "
                        "contradict each other"
                    )
                    clashes |= {i: words, j: words}
    found: dict[_Path, Any] = {}
    for mine in (mine for i, (_, mine) in enumerate(entries) if i not in clashes):
        for key, value in mine.items():
            found[key] = _joined(found.get(key, []), value) if _intervals(value) else found.get(key, value)
    new = {key: _composed(given, key, value) for key, value in found.items()}
    new = {key: value for key, value in new.items() if value != _at(given, key)}
    return Laid(_with(given, new), _with({}, new), tuple(dict.fromkeys(clashes.values())))


def _leaves(table: dict[str, Any], path: _Path = ()) -> Iterator[tuple[_Path, Any]]:
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*path, key))
        else:
            yield (*path, key), value


def _at(table: Any, path: _Path) -> Any:
    """Value under a path, or None."""
    for key in path:
        table = table.get(key) if isinstance(table, dict) else None
    return table


def _with(table: dict[str, Any], new: dict[_Path, Any]) -> dict[str, Any]:
    """Copy of a table with these entries."""
    result = {key: _with(value, {}) if isinstance(value, dict) else value for key, value in table.items()}
    for path, value in new.items():
        here = result
        for key in path[:-1]:
            here = here.setdefault(key, {})
        here[path[-1]] = value
    return result


def _said(key: _Path, value: Any) -> str:
    return toml_line(_with({}, {key: value})).replace("\n", " ")


def _intervals(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and isinstance(value[0], list)


def _alike(a: Any, b: Any) -> bool:
    """Whether two findings agree on one entry: intervals add up, and estimates of one number may differ by their
    error."""
    if _intervals(a) and _intervals(b):
        return True
    if isinstance(a, list) and isinstance(b, list):
        return all(map(_alike, a, b))
    return math.isclose(a, b, rel_tol=0.5) if isinstance(a, float) and isinstance(b, float) else bool(a == b)


def _joined(old: list[Any], new: list[Any]) -> list[Any]:
    return sorted([*old, *(v for v in new if v not in old)])


def _composed(given: dict[str, Any], path: _Path, value: Any) -> Any:
    """Entry equivalent to the given one followed by the new one: (reading - bias) / scale twice over, delays and
    vectors added."""
    old, kind = _at(given, path), path[-2] if len(path) > 1 else path[0]
    if _intervals(value):
        return _joined(old or [], value)
    if kind == "scale":
        return _round(value * (old or 1.0))
    if kind == "bias":
        before = old if old is not None else _at(given, ("bias", path[-1])) or 0.0
        return _round(before + value * (_at(given, ("scale", path[-1])) or 1.0))
    if kind == "delay":
        return _round(value + (old or 0.0))
    if path[-1] in ("current", "antenna"):
        before = old or (_at(given, ("current",)) if path[-1] == "current" else None) or (0.0, 0.0)
        return [_round(a + b) for a, b in zip(before, value, strict=True)]
    return value


def _round(value: float) -> float:
    return float(f"{value:.6g}")


def write_lines(folder: Path, findings: Sequence[Finding]) -> tuple[Laid, Path | None]:
    """Write the lines of findings into a folder's dataset.toml; its comments stay, and a copy of the old file is kept
    beside it.

    Returns:
        The merged lines, and the copy of the old file (None where nothing changed).

    Raises:
        InputError: the file cannot be read or written, or would no longer describe a data set.
    """
    path = folder / "dataset.toml"
    found = laid(read_toml(path), findings)
    if not found.changed:
        return found, None
    parse_description(found.description, path)
    try:
        text = _edited(path.read_text(encoding="utf-8"), found)
        old = next(p for n in range(1, 10_000) if not (p := path.with_name(BEFORE_CHECK + f".{n}" * (n > 1))).exists())
        shutil.copy2(path, old)
        write_text(path, text)
    except OSError as error:
        raise InputError(f"cannot write {path}: {error.strerror}. Give a folder that can be written.") from None
    return found, old


def _edited(text: str, found: Laid) -> str:
    """Text of the file with the new entries in it."""
    try:
        document: Any = tomlkit.parse(text)
        for key, value in _leaves(found.changed):
            here = document
            for part in key[:-1]:
                if part not in here:
                    here[part] = tomlkit.table()
                here = here[part]
            here[key[-1]] = value
        edited = tomlkit.dumps(document)
        if tomllib.loads(edited) == found.description:
            return edited
    except (TOMLKitError, tomllib.TOMLDecodeError, KeyError, TypeError):
        pass
    return tomli_w.dumps(found.description)  # written in a way that does not let a key be added: without its comments
