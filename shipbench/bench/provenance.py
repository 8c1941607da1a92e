"""Code and machine behind a result."""

from __future__ import annotations

import os
import platform
import subprocess
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ..registry import package_digest

_LIBRARIES = ("numpy", "scipy", "pandas", "casadi", "torch", "lightning", "torchdiffeq")


@cache
def source_digest() -> str:
    """Digest of shipbench's own source: it distinguishes edited code from the released one."""
    return package_digest("shipbench")


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
        "threads": os.environ.get("OMP_NUM_THREADS", "default"),
    }
    return info | {name: _version(name) for name in _LIBRARIES}


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "not installed"
