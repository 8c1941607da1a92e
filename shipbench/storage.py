"""Files and folders that are written whole or not at all: a reader sees the old or the new one, never half of it."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

Frame = Any
"""A pandas DataFrame. pandas' own annotations are unions of all that a method can return, which no checker can
follow."""


@contextmanager
def in_one_step(path: Path, suffix: str = ".tmp") -> Iterator[Path]:
    """A hidden sibling of `path` to write (a file or a folder), which then takes its place. It goes if writing fails.

    Args:
        suffix: of the sibling's name, where a library goes by it.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f".{path.name}.{os.getpid()}{suffix}")
    try:
        yield part
        os.replace(part, path)
    except BaseException:
        shutil.rmtree(part) if part.is_dir() else part.unlink(missing_ok=True)
        raise


def put(made: Path, path: Path) -> None:
    """Move a file or folder that is complete to its place, in one step; both on one file system. A folder in its place
    must be empty."""
    os.replace(made, path)


def exchange(made: Path, path: Path) -> None:
    """Put the folder `made` in the place of `path`, which may exist; where that fails, the old one stays."""
    if not path.is_dir():
        put(made, path)
        return
    old = made.with_name(made.name + ".old")
    put(path, old)
    try:
        put(made, path)
    except OSError:
        put(old, path)
        raise
    shutil.rmtree(old, ignore_errors=True)


def write_text(path: Path, text: str) -> Path:
    """Write text in one step and return its path; lone surrogates, from badly decoded names, become question marks."""
    with in_one_step(path) as part:
        part.write_text(text, encoding="utf-8", errors="replace")
    return path


def write_json(path: Path, data: Any) -> None:
    """Write JSON in one step."""
    with in_one_step(path) as part:
        part.write_text(json.dumps(data, indent=1, default=str) + "\n", encoding="utf-8")


def write_rows(path: Path, rows: Frame) -> None:
    """Write a table as parquet in one step."""
    with in_one_step(path) as part:
        rows.to_parquet(part, index=False)
