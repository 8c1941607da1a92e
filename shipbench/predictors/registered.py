"""The predictors by name, without numpy: `shipbench models` loads nothing that computes."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence

from ..registry import Registry

PREDICTORS = Registry("predictor", "predictors", "PREDICTOR", helpers=frozenset({"base", "device", "registered", "training"}), lazy=True)


def not_installed(name: str, needs: Sequence[str]) -> str | None:
    """What the optional packages `needs` of the predictor `name` lack here, and how to install them; None where all are there."""
    missing = [package for package in needs if importlib.util.find_spec(package) is None]
    return f"{' and '.join(missing)} is not installed: pip install 'shipbench[{name}]'" if missing else None
