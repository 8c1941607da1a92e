"""Optional packages: the extra of shipbench that installs each, and the one message where it is not installed."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib.util import find_spec

from .errors import InputError

EXTRAS = {
    "torch": ("torch", "networks"), "lightning": ("lightning", "networks"), "torchdiffeq": ("torchdiffeq", "networks"),
    "sklearn": ("scikit-learn", "sklearn"), "pysindy": ("pysindy", "pysindy"),
    "scikit_posthocs": ("scikit-posthocs", "diagrams"),
    "nonlinear_benchmarks": ("nonlinear_benchmarks", "nonlinear-benchmarks"), "distributed": ("distributed", "dask"),
    "openpyxl": ("openpyxl", "excel"), "h5py": ("h5py", "matlab"), "matio": ("mat-io", "matlab"),
    "fmpy": ("fmpy", "fmu"),
}  # fmt: skip
"""Name on the package index and extra of each optional package, by the name under which it is imported (pyproject.toml
has the versions)."""


def not_installed(packages: Iterable[str]) -> str:
    """First of `packages` (import names) that is missing, and the command that installs it; "" where all are here. It
    imports none of them."""
    return next((_lack(package) for package in packages if find_spec(package) is None), "")


@contextmanager
def needed_by(what: str, instead: str = "") -> Iterator[None]:
    """Turn a failed import of an optional package inside the context into one message.

    Args:
        what: subject of the message, such as "'mlp'".
        instead: what helps without the package, such as "Save the sheet as CSV".

    Raises:
        InputError: an optional package is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        package = (error.name or "").partition(".")[0]
        if package not in EXTRAS:
            raise
        raise InputError(f"{what} {_lack(package, instead)}") from None


def _lack(package: str, instead: str = "") -> str:
    distribution, extra = EXTRAS[package]
    return (
        f"needs {distribution}, which is not installed. {f'{instead}, or install' if instead else 'Install'} it: "
        f"pip install 'shipbench[{extra}]'"
    )
