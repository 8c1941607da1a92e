"""Folder of a study while it runs: one study at a time, no leftovers of killed ones, and one clear message where it
cannot be written."""

from __future__ import annotations

import errno
import os
import re
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError, WorkError, option
from ..regular_files import read_json
from .task import Task, make_task

_LEFTOVERS = {
    "": r"(writable|study\.json|rows\.parquet|summary\.json|windows\.parquet)", "truth/*": r"fold\d+\.npz",
    "cells/*/*": r"fold\d+-seed\d+",
}  # fmt: skip
"""Half-written files of a killed study, by folder: `.NAME.PID.tmp` of these names. No other file is removed."""


def _elsewhere() -> str:
    return f"another folder with {option('--out', 'out=FOLDER')}"


@contextmanager
def claimed(out: Path) -> Iterator[None]:
    """Make `out`, check that it can be written and that no other study writes there now, and remove the half-written
    files of killed studies.

    Raises:
        InputError: the folder cannot be made or written, or holds links in the place of its folders, or another study
            is at work in it.
        WorkError: writing failed later (disk full, a folder that has gone).
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / f".writable.{os.getpid()}.tmp"
        probe.write_bytes(b"\n")
        probe.unlink()
        handle = os.open(out, os.O_RDONLY)
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror}. Give {_elsewhere()}.") from None
    try:
        _lock(handle, out)
        _refuse_links(out)
        _take_away_leftovers(out)
        yield
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        raise WorkError(
            f"the study stopped: {where}{error.strerror or error}. What is finished is kept in {out}; "
            f"make room (or repair it) and run the same command again with {option('--resume', 'resume=True')}."
        ) from error
    finally:
        os.close(handle)  # and with it the lock, which the system also takes from a killed process


def free_folder(base: Path, tasks: Sequence[Task], resume: bool) -> Path:
    """Folder for a study for which none was given: `base`, or `base-2` and so on where another study is there.
    `resume`: that of the same tasks, `base` where there is none."""
    number, folder = 1, base
    while (there := _tasks_of(folder)) is not None and there != list(tasks):
        number += 1
        folder = base.with_name(f"{base.name}-{number}")
    return base if resume and there is None else folder


def refuse_other_study(out: Path, tasks: Sequence[Task]) -> None:
    """Keep the results of another study from being replaced: a folder holds the tables of one.

    Raises:
        InputError: `out` holds results of other tasks, or results that do not state their task.
    """
    there = _tasks_of(out)
    if there is not None and there != list(tasks):
        raise InputError(
            f"{out} holds the results of another study, which would be replaced. Give {_elsewhere()}. To go on "
            "there, give "
            f"{option('--resume', 'resume=True')}: finished fits of these models are kept, and the tables become "
            "those of this study."
        )


def _tasks_of(out: Path) -> list[Task] | None:
    """Tasks of the study in `out`; empty for results that do not state them; None where there are no results."""
    if not any((out / name).exists() for name in ("study.json", "rows.parquet", "summary.json")):
        return None
    try:
        return [make_task(task) for task in read_json(out / "study.json")["tasks"]]
    except (InputError, KeyError, TypeError):  # a damaged file may hold anything
        return []


def _refuse_links(out: Path) -> None:
    """Refuse links in a folder: a file written through a link lies outside `out`."""
    for pattern in ("cells", "truth", "cells/*", "cells/*/*"):
        if link := next((path for path in out.glob(pattern) if path.is_symlink()), None):
            raise InputError(
                f"{link} is a link; accepted: folders, so that a study writes only below {out}. Remove the link, or "
                f"give {_elsewhere()}."
            )


def _take_away_leftovers(out: Path) -> None:
    for pattern, name in _LEFTOVERS.items():
        for folder in [out] if not pattern else out.glob(pattern):
            if any(part.is_symlink() for part in (folder, *folder.parents) if part != out and part.is_relative_to(out)):
                continue  # it leads out of the study
            for path in folder.glob(".*.tmp"):
                if re.fullmatch(rf"\.{name}\.\d+(\.old)?\.tmp", path.name):
                    shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()


def _lock(handle: int, out: Path) -> None:
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            raise InputError(
                f"another study is being written to {out} at this moment; wait for it, or give {_elsewhere()}."
            ) from None
        # file systems without locks (some of clusters): the user keeps two studies apart
