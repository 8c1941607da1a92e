"""Archive of an FMU: a ZIP file of a stranger's, checked and extracted within bounds."""

from __future__ import annotations

import platform
import stat
import sys
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path, PurePosixPath

from ...errors import InputError
from ...regular_files import check_regular, open_regular

MODEL_DESCRIPTION = "modelDescription.xml"
MOST_DESCRIPTION = 64_000_000
"""Most bytes of modelDescription.xml; that of a model with 20,000 variables has some 5 MB."""
_MOST_UNPACKED = 4_000_000_000
_MOST_FILES = 50_000
_MACHINES = {"x86_64": ("64", "x86_64"), "amd64": ("64", "x86_64"), "i686": ("32", "x86"), "aarch64": ("64", "aarch64"),
             "arm64": ("64", "aarch64")}  # fmt: skip
_SYSTEMS = {"linux": ("linux", "linux", ".so"), "darwin": ("darwin", "darwin", ".dylib"),
            "win32": ("win", "windows", ".dll")}  # fmt: skip
_BROKEN = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError, EOFError, ValueError, OSError)
"""Exceptions of zipfile on a damaged or encrypted archive."""


def here() -> tuple[tuple[str, str], str]:
    """Names of this platform in FMI 2 and FMI 3 (linux64, x86_64-linux), and the suffix of its libraries."""
    bits, architecture = _MACHINES.get(platform.machine().lower(), ("", platform.machine().lower()))
    short, system, suffix = _SYSTEMS.get(sys.platform, (sys.platform, sys.platform, ".so"))
    return (f"{short}{bits}", f"{architecture}-{system}"), suffix


@contextmanager
def opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """Open the archive, with every member checked.

    Raises:
        InputError: no regular file, no ZIP file, a damaged one, one that leaves its folder, or a larger one than
            accepted.
    """
    check_regular(path, "FMU")
    try:
        with open_regular(path, "FMU") as file, zipfile.ZipFile(file) as archive:
            _check(path, archive)
            yield archive
    except InputError:
        raise
    except _BROKEN as error:
        why = " ".join(str(error).split())[:160] or type(error).__name__
        raise InputError(f"{path} is no FMU, or it is damaged: {why}. Export the FMU again.") from None


def _check(path: Path, archive: zipfile.ZipFile) -> None:
    members = archive.infolist()
    if len(members) > _MOST_FILES or sum(m.file_size for m in members) > _MOST_UNPACKED:
        raise InputError(
            f"{path} holds {len(members)} files of {sum(m.file_size for m in members) / 1e6:.0f} MB unpacked; "
            f"accepted: up to {_MOST_FILES} files and {_MOST_UNPACKED / 1e6:.0f} MB. Leave out what the model does not "
            "need."
        )
    for member in members:
        name = PurePosixPath(member.filename.replace("\\", "/"))
        mode = member.external_attr >> 16
        if name.is_absolute() or ".." in name.parts or ":" in member.filename or stat.S_ISLNK(mode):
            raise InputError(
                f"{path} is not opened: its member '{member.filename[:80]}' leads out of its folder. Export the FMU "
                "again."
            )


def libraries(archive: zipfile.ZipFile) -> dict[str, list[str]]:
    """Names of the libraries (without suffix) of each platform for which the FMU has one."""
    found: dict[str, list[str]] = {}
    for name in archive.namelist():
        parts = PurePosixPath(name).parts
        if len(parts) == 3 and parts[0] == "binaries" and PurePosixPath(name).suffix in (".so", ".dll", ".dylib"):
            found.setdefault(parts[1], []).append(PurePosixPath(name).stem)
    return found


def has_sources(archive: zipfile.ZipFile) -> bool:
    """Whether the FMU holds C source."""
    return any(n.startswith("sources/") and n.endswith((".c", ".cpp")) for n in archive.namelist())


def extract(path: Path, folder: Path) -> None:
    """Extract what running takes: the description, this platform's libraries, resources and sources.

    Raises:
        InputError: as `opened`.
    """
    names, _ = here()
    wanted = (MODEL_DESCRIPTION, "resources/", "sources/", "buildDescription.xml", *(f"binaries/{n}/" for n in names))
    with opened(path) as archive:
        for member in archive.infolist():
            if member.filename.startswith(wanted):
                archive.extract(member, folder)
    (folder / "resources").mkdir(exist_ok=True)
