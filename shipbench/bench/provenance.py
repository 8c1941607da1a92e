"""Which code on which machine made a result."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from collections.abc import Iterable
from functools import cache
from importlib.metadata import PackageNotFoundError, entry_points, version
from importlib.util import find_spec
from pathlib import Path

_LIBRARIES = ("numpy", "scipy", "pandas", "casadi", "torch", "lightning", "torchdiffeq")


def source_digest() -> str:
    """That of shipbench itself: tells edited code from the released one."""
    return package_digest("shipbench")


@cache
def package_digest(name: str) -> str:
    """SHA-256 (first 12 digits) over the Python files of an importable package or module; "" where it is not installed."""
    found = find_spec(name)
    if found is None or found.origin is None:
        return ""
    origin = Path(found.origin)
    package = origin.parent
    files = sorted(package.rglob("*.py")) if found.submodule_search_locations else [origin]
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.relative_to(package).as_posix().encode() + b"\0" + path.read_bytes())
    return digest.hexdigest()[:12]


def plugin_digests(names: Iterable[str]) -> dict[str, str]:
    """Package -> digest of the plug-ins that add one of these parts through an entry point."""
    wanted = set(names)
    groups = ("predictors", "effects", "metrics")
    points = [point for group in groups for point in entry_points(group=f"shipbench.{group}") if point.name in wanted]
    return {package: package_digest(package) for package in sorted({point.module.partition(".")[0] for point in points})}


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
