"""The folder of a study while it runs: one study at a time, no leftovers of killed ones, and one clear message where it cannot be written."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..errors import InputError, WorkError

_LEFTOVERS = (".*.tmp", "truth/*/.*.tmp", "cells/*/*/.*.tmp")


@contextmanager
def claimed(out: Path) -> Iterator[None]:
    """Make `out`, see that it can be written and that no other study writes there now, and take away what killed studies left half-written.

    Raises:
        InputError: the folder cannot be made or written, or another study is at work in it.
        WorkError: writing failed later (disk full, a folder that has gone).
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
        probe = out / f".writable.{os.getpid()}.tmp"
        probe.write_bytes(b"\n")
        probe.unlink()
        handle = os.open(out, os.O_RDONLY)
    except OSError as error:
        raise InputError(f"cannot write to {out}: {error.strerror}. Give another folder with --out.") from None
    try:
        _lock(handle, out)
        for leftover in (path for pattern in _LEFTOVERS for path in out.glob(pattern)):
            shutil.rmtree(leftover) if leftover.is_dir() else leftover.unlink()
        yield
    except OSError as error:
        where = f"{error.filename}: " if error.filename else ""
        raise WorkError(
            f"the study stopped: {where}{error.strerror or error}. What is finished is kept in {out}; "
            "make room (or mend the folder) and run the same command again with --resume."
        ) from error
    finally:
        os.close(handle)  # and with it the lock, which the system also takes from a killed process


def _lock(handle: int, out: Path) -> None:
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        if error.errno in (errno.EWOULDBLOCK, errno.EACCES):
            raise InputError(f"another study is being written to {out} at this moment; wait for it, or give another folder with --out.") from None
        # file systems without locks (some of clusters): the user keeps two studies apart
