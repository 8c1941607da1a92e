"""Atomic writing of files and folders: a reader gets the old or the new one, never half of it."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

Frame = Any
"""Type of a pandas DataFrame. pandas' own annotations are unions of all possible return types, which no checker can
follow."""


@contextmanager
def in_one_step(path: Path, suffix: str = ".tmp") -> Iterator[Path]:
    """Provide a hidden sibling of `path` to write (a file or a folder), which then takes its place. It is removed if
    writing fails.

    Args:
        suffix: of the sibling's name, where a library depends on it.
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
    """Move a complete file or folder to its place, atomically; both on one file system. A folder in its place must be
    empty."""
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
    """Write text atomically and return its path; lone surrogates, from badly decoded names, become question marks."""
    with in_one_step(path) as part:
        part.write_text(text, encoding="utf-8", errors="replace")
    return path


def write_json(path: Path, data: Any) -> None:
    """Write JSON atomically."""
    with in_one_step(path) as part:
        part.write_text(json.dumps(data, indent=1, default=str) + "\n", encoding="utf-8")


def write_rows(path: Path, rows: Frame) -> None:
    """Write a table as parquet atomically."""
    with in_one_step(path) as part:
        rows.to_parquet(part, index=False)
