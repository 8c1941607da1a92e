"""C code compiled once and kept in the cache folder, under the digests of its source and of its own bytes."""

from __future__ import annotations

import contextlib
import ctypes
import hashlib
import logging
import os
import platform
import shlex
import shutil
import signal
import subprocess
import tempfile
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from .cache import cache_folder, make_private, stranger
from .storage import put

_log = logging.getLogger(__name__)
_SECONDS = 30
"""Time limit of a compiler [s]; the largest code of shipbench takes about 3 s."""
_FLAGS = (
    "-std=gnu11", "-O1", "-ftree-vectorize", "-march=native", "-mprefer-vector-width=512", "-fopenmp-simd",
    "-fno-math-errno", "-fno-trapping-math",  # neither is ever read; without them no square root would be a vector's
    "-fno-builtin-sin", "-fno-builtin-cos",  # gcc would join them to sincos, which has no vector form
    "-w", "-shared", "-fPIC",
)  # fmt: skip
_FAILED = (OSError, subprocess.SubprocessError)


def machine_code(source: str | None, function: str, arguments: Sequence[Any]) -> Callable[..., Any] | None:
    """Compiled C function of `source`, new or from the cache folder; None where that cannot be done."""
    command, machine = compiler()
    if source is None or not command:
        return None
    key = hashlib.sha256("\n".join([source, *command, *_FLAGS, machine]).encode()).hexdigest()[:24]
    try:
        if (folder := _folder()) is not None:
            with contextlib.suppress(FileNotFoundError):  # another process found it damaged in the same moment
                return _function(_kept(folder, key) or _compile(command, source, folder, key), function, arguments)
    except subprocess.TimeoutExpired:
        _give_up(command)
        return None
    except _FAILED as error:
        _log.debug("%s: %s", key, error)
    try:  # the cache folder cannot be written or is not the user's alone, or no code may run there
        with tempfile.TemporaryDirectory(prefix="shipbench-") as private:
            return _function(_compile(command, source, Path(private), key), function, arguments)
    except subprocess.TimeoutExpired:
        _give_up(command)
        return None
    except _FAILED as error:
        _log.debug("the C compiler %s failed, CasADi interprets instead: %s", command[0], error)
        return None


@cache
def compiler() -> tuple[tuple[str, ...], str]:
    """Command of the C compiler (empty: there is none) and a text that identifies its version and this processor.

    SHIPBENCH_COMPILER names another than `cc`; "none" switches compiling off.
    """
    command = tuple(shlex.split(os.environ.get("SHIPBENCH_COMPILER") or "cc"))
    if command in ((), ("none",)) or shutil.which(command[0]) is None:
        return (), ""
    try:
        found = _run([*command, "--version"], None)
        cpu = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").is_file() else platform.processor()
    except subprocess.TimeoutExpired:
        _give_up(command)
        return (), ""
    except _FAILED:
        return (), ""
    flags = next((line for line in cpu.splitlines() if line.startswith(("flags", "Features"))), cpu)
    return command, "\n".join([found, platform.machine(), platform.libc_ver()[1], flags])


def _give_up(command: tuple[str, ...]) -> None:
    """Report that the compiler hangs, and do not use it again: neither in this process nor in those that it starts."""
    _log.warning(
        "the C compiler '%s' did not end within %d s and was stopped; CasADi interprets instead: slower, the same "
        "numbers. "
        "To name another: SHIPBENCH_COMPILER=gcc; to use none: SHIPBENCH_COMPILER=none.",
        " ".join(command), _SECONDS,
    )  # fmt: skip
    os.environ["SHIPBENCH_COMPILER"] = "none"
    compiler.cache_clear()


def _run(command: Sequence[str], folder: Path | None) -> str:
    """Standard output of a command, with its temporary files in `folder`; one that hangs is stopped with all that it
    started.

    Raises:
        OSError, subprocess.SubprocessError: it cannot be started, fails, or hangs.
    """
    where = None if folder is None else {**os.environ, "TMPDIR": str(folder)}
    with subprocess.Popen(
        command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
        errors="replace", env=where,
        start_new_session=True,
    ) as process:  # fmt: skip
        try:
            output, _ = process.communicate(timeout=_SECONDS)
        except BaseException:  # also an interrupt from the keyboard, which does not reach another session
            with contextlib.suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL) if hasattr(os, "killpg") else process.kill()
            raise
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return output


def _folder() -> Path | None:
    """Folder of the code, made if there is none; None where others could write in it (reported once), so that nothing
    of it may be loaded."""
    folder = cache_folder() / "compiled"
    with contextlib.suppress(OSError):
        make_private("compiled")
        if folder.stat().st_mode & 0o777 != 0o700:
            folder.chmod(0o700)
        if (reason := stranger(folder)) is None:
            return folder
        _warn_once(reason)
    return None


@cache
def _warn_once(reason: str) -> None:
    _log.warning(
        "%s, so that no compiled code is loaded from there or kept there, and it is compiled in each process anew. "
        "Set SHIPBENCH_CACHE to a folder of your own that only you can write.", reason,
    )  # fmt: skip


def _kept(folder: Path, key: str) -> Path | None:
    """Kept library, if it is whole and the user's alone; any other file in its place is removed."""
    for path in folder.glob(f"{key}-*.so"):
        if stranger(path) is None and path.is_file() and path.stem == f"{key}-{_digest(path)}":
            return path
        shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
    return None


def _digest(path: Path) -> str:
    return hashlib.sha256(path.read_bytes()).hexdigest()[:24]


def _compile(command: tuple[str, ...], source: str, folder: Path, key: str) -> Path:
    """Write the shared library into `folder` atomically: processes that compile the same at the same time do not
    conflict."""
    _sweep(folder)
    with tempfile.TemporaryDirectory(prefix=".", dir=folder) as work, _locked(Path(work)):
        written, made = Path(work) / "rollout.c", Path(work) / "rollout.so"
        written.write_text(source)
        _run([*command, *_FLAGS, "-o", str(made), str(written), "-lm"], Path(work))
        made.chmod(0o600)
        with made.open("rb") as file:  # on the disk before it has its name: no half of it is there after a power cut
            os.fsync(file.fileno())
        path = folder / f"{key}-{_digest(made)}.so"
        put(made, path)
    return path


def _sweep(folder: Path) -> None:
    """Remove leftovers of killed compilations; running ones hold a lock."""
    for left in folder.glob(".*"):
        with contextlib.suppress(OSError), _locked(left):
            shutil.rmtree(left)


@contextlib.contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, which the system releases when a process is killed; OSError where another holds it."""
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    handle = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    finally:
        os.close(handle)


def _function(path: Path, name: str, arguments: Sequence[Any]) -> Callable[..., Any]:
    function = getattr(ctypes.CDLL(str(path)), name)
    function.argtypes, function.restype = list(arguments), None
    return function
