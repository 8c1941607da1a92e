"""Folder of made data sets, downloads and compiled code, and the check that it belongs to the user alone."""

from __future__ import annotations

import os
import stat
from pathlib import Path


def cache_folder() -> Path:
    """Folder in the environment variable SHIPBENCH_CACHE, else ~/.cache/shipbench."""
    return Path(os.environ.get("SHIPBENCH_CACHE") or Path.home() / ".cache" / "shipbench")


def make_private(*parts: str) -> Path:
    """Make the folder `parts` of the cache, with the mode 0700 like all folders of the cache above it; existing ones
    keep theirs.

    Raises:
        OSError: it cannot be made.
    """
    folder = cache_folder()
    folder.parent.mkdir(parents=True, exist_ok=True)
    for part in ("", *parts):
        folder = folder / part
        folder.mkdir(mode=0o700, exist_ok=True)
    return folder


def stranger(path: Path) -> str | None:
    """Reason why others could change a file or folder of the cache, or None where only the user can.

    All folders up to the cache's are checked: a user who can write in one of them can replace this one.
    """
    if not hasattr(os, "geteuid"):  # Windows: the profile's folder is the user's
        return None
    root = cache_folder()
    for place in (path, *(parent for parent in path.parents if root in (parent, *parent.parents))):
        try:
            found = os.stat(place)
            owners = {found.st_uid, os.lstat(place).st_uid}  # of the place, and of the link that leads there
        except OSError as error:
            return f"{place} cannot be read ({error.strerror})"
        if owners != {os.geteuid()}:
            return f"{place} belongs to another user"
        if found.st_mode & (stat.S_IWGRP | stat.S_IWOTH):
            return f"{place} can be written by other users"
    return None
