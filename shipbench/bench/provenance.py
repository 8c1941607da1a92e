"""Which code on which machine made a result."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_LIBRARIES = ("numpy", "scipy", "pandas", "casadi", "torch", "lightning", "torchdiffeq")


@cache
def source_digest() -> str:
    """SHA-256 (first 12 digits) over the package's Python files: tells edited code from the released one."""
    package = Path(__file__).resolve().parent.parent
    digest = hashlib.sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def code_version() -> dict[str, str]:
    """Package version, digest of its source, and git's description of the checkout ("" outside one)."""
    package = Path(__file__).resolve().parent.parent
    described = ""
    if (package.parent / ".git").exists():
        command = ["git", "-C", str(package.parent), "describe", "--always", "--dirty", "--tags"]
        try:
            described = subprocess.run(command, capture_output=True, text=True, timeout=10, check=True).stdout.strip()
        except (OSError, subprocess.SubprocessError):
            described = ""  # no git program, or not its checkout: the source digest still identifies the code
    return {"shipbench": _version("shipbench"), "source": source_digest(), "git": described}


@cache
def machine() -> dict[str, str | int]:
    """Processor count, platform, Python and library versions (read without importing the libraries)."""
    info: dict[str, str | int] = {
        "cpus": len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1,
        "platform": platform.platform(),
        "python": platform.python_version(),
    }
    return info | {name: _version(name) for name in _LIBRARIES}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
