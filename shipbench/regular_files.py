"""Safe opening of files from unknown sources: regular files only, with their size known before memory is allocated.

A named pipe would wait for ever, a device such as /dev/zero never ends, and opening a device may start it. Every reader
of shipbench opens its files here: `open_regular` for readers that take an open file, `check_regular` for those that
insist on a path, `read_text`, `read_json` and `read_npz` for files that are read whole. `check_output` keeps output
files apart from input files.
"""

from __future__ import annotations

import json
import lzma
import os
import stat
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

from .errors import InputError

if TYPE_CHECKING:
    import numpy as np

MOST_TEXT = 64_000_000
"""Most bytes of a text that is read whole (JSON, Python); those that shipbench writes for 10,000 runs have some
5 MB."""
MOST_ARRAYS = 1_000_000_000
"""Most bytes of arrays that are read whole."""
_DAMAGED = (
    OSError, ValueError, KeyError, TypeError, EOFError, SyntaxError, MemoryError, RecursionError, RuntimeError,
    NotImplementedError,
    zipfile.BadZipFile, zlib.error, lzma.LZMAError, struct.error, tokenize.TokenError,
)  # fmt: skip
"""Exceptions of zipfile and numpy on a damaged .npz file."""
_KINDS: dict[str, Callable[[int], bool]] = {
    "a folder": stat.S_ISDIR, "a named pipe": stat.S_ISFIFO, "a socket": stat.S_ISSOCK,
    "a device": lambda mode: stat.S_ISCHR(mode) or stat.S_ISBLK(mode),
}  # fmt: skip


def check_regular(path: str | Path, what: str = "file") -> int:
    """Size [bytes] of a regular file, or of the one that a link points to; `what` names the kind of file in messages
    ("TOML file").

    Raises:
        InputError: there is no such file, or it is a folder, a named pipe, a device or a socket.
    """
    try:
        return _size(os.stat(path), path, what)
    except (OSError, ValueError) as error:
        raise _unreadable(path, what, error) from None


def open_regular(path: str | Path, what: str = "file") -> IO[bytes]:
    """Open a regular file for reading. It is checked before and after opening, so that a file replaced in between is
    refused, too.

    Raises:
        InputError: as `check_regular`, or the file may not be read.
    """
    check_regular(path, what)
    try:
        # Without O_NONBLOCK, opening a pipe waits for a writer.
        handle = os.open(
            path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
        )
        try:
            _size(os.fstat(handle), path, what)
            return os.fdopen(handle, "rb")
        except BaseException:
            os.close(handle)
            raise
    except (OSError, ValueError) as error:
        raise _unreadable(path, what, error) from None


def read_bytes(path: str | Path, what: str = "file", most: int = MOST_TEXT) -> bytes:
    """Read a whole regular file.

    Raises:
        InputError: as `open_regular`, or the file is larger than `most` bytes.
    """
    with open_regular(path, what) as file:
        try:
            size = os.fstat(file.fileno()).st_size
            content = (file.read(most + 1) or b"") if size <= most else b""
        except OSError as error:
            raise _unreadable(path, what, error) from None
    if max(size, len(content)) > most:
        raise InputError(
            f"{path} has {max(size, len(content)) / 1e6:.3g} MB; accepted: a {what} of up to {most / 1e6:.3g} MB."
        )
    return content


def read_text(path: str | Path, what: str = "text file", most: int = MOST_TEXT) -> str:
    """Read a whole UTF-8 text.

    Raises:
        InputError: as `read_bytes`, or it is not UTF-8.
    """
    try:
        return read_bytes(path, what, most).decode("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{path} is not UTF-8 text (byte {error.start}); accepted: a {what} in UTF-8. Save it again in that "
            "encoding."
        ) from None


def read_json(path: str | Path, what: str = "JSON file", most: int = MOST_TEXT) -> Any:
    """Read the document of a JSON file.

    Raises:
        InputError: as `read_text`, or it is not JSON, or is nested too deeply.
    """
    text = read_text(path, what, most)
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as error:
        reason = "it is nested too deeply" if isinstance(error, RecursionError) else error
        raise InputError(f"{path} is not valid JSON: {reason}. Give a {what} as shipbench wrote it.") from None


def read_npz(path: str | Path, what: str = "file of arrays (.npz)", most: int = MOST_ARRAYS) -> dict[str, np.ndarray]:
    """Read the arrays of a .npz file. Nothing is unpickled, and no array is made before its declared size is known to
    be in the file.

    Raises:
        InputError: as `open_regular`, the file is damaged or holds other things than arrays of numbers or text, or more
            than `most` bytes.
    """
    import numpy as np

    with open_regular(path, what) as file:
        try:
            with zipfile.ZipFile(file) as packed:
                size = sum(part.file_size for part in packed.infolist())
                if size <= most:
                    for part in packed.infolist():
                        _check_array(packed, part)
            if size <= most:
                file.seek(0)
                with np.load(file, allow_pickle=False) as arrays:
                    return {name: arrays[name] for name in arrays.files}
        except _DAMAGED as error:
            reason = " ".join(str(error).split())[:160] or type(error).__name__
            raise InputError(f"{path} cannot be read: {reason}. Give a {what} as shipbench wrote it.") from None
    raise InputError(f"{path} holds {size / 1e6:.0f} MB unpacked; accepted: up to {most / 1e6:.0f} MB.")


def _check_array(packed: zipfile.ZipFile, part: zipfile.ZipInfo) -> None:
    """Refuse a member whose header declares more numbers than it holds, before they are allocated."""
    import numpy as np

    with packed.open(part) as member:
        version = np.lib.format.read_magic(member)
        header = {(1, 0): np.lib.format.read_array_header_1_0, (2, 0): np.lib.format.read_array_header_2_0}.get(version)
        if header is None:
            raise ValueError(f"'{part.filename}' is of a version of .npy that is not read")
        shape, _, dtype = header(member)
        held = part.file_size - member.tell()
    if dtype.hasobject:
        raise ValueError(f"'{part.filename}' holds Python objects, which are not read")
    if any(n < 0 for n in shape) or int(np.prod(shape, dtype=object)) * dtype.itemsize > held:
        raise ValueError(f"'{part.filename}' declares the shape {shape}, which takes more than its {held} bytes")


def check_output(path: Path, inputs: Iterable[str | Path] = (), option: str = "--out") -> None:
    """Refuse to write a file over an input of the same command, or in the place of a device, a named pipe or a folder.

    `inputs` are files, and folders whose files are not replaced; a link counts as its target. A path where nothing is
    yet is accepted.

    Raises:
        InputError: the path is one of these.
    """
    if not path.exists():
        return
    if not path.is_file():
        kind = next((name for name, is_it in _KINDS.items() if is_it(path.stat().st_mode)), "of another kind")
        raise InputError(
            f"{option} {path} is {kind}; accepted: a new name, or a file to replace. Give another {option}."
        )
    if any(path.resolve().is_relative_to(Path(given).resolve()) for given in inputs):
        raise InputError(
            f"{option} {path} is there already, among the inputs of this command; it would be overwritten. Give "
            f"another {option}."
        )


def make_folder(path: Path, option: str = "--out") -> None:
    """Make the folder of results and its parents, unless they are there.

    Raises:
        InputError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        reason = "it is a file" if path.is_file() else error.strerror
        raise InputError(
            f"{option} {path} cannot be made: {reason}; accepted: a folder. Give another {option}."
        ) from None


def _size(found: os.stat_result, path: str | Path, what: str) -> int:
    if not stat.S_ISREG(found.st_mode):
        kind = next((name for name, is_it in _KINDS.items() if is_it(found.st_mode)), "of another kind")
        raise InputError(f"cannot read {path}: it is {kind}, not a regular file. Give the path of an existing {what}.")
    return found.st_size


def _unreadable(path: str | Path, what: str, error: OSError | ValueError) -> InputError:
    """Error with the system's reason; a ValueError comes of a path that no file can have (with a zero byte, or no
    text)."""
    if isinstance(error, OSError):
        dangling = isinstance(error, FileNotFoundError) and os.path.islink(path)
        reason = "it is a link to a file that does not exist" if dangling else error.strerror or type(error).__name__
        return InputError(f"cannot read {path}: {reason}. Give the path of an existing {what}.")
    return InputError(f"cannot read {str(path)!r}: no file can have this name. Give the path of an existing {what}.")
