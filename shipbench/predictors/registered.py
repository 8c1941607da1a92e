"""Predictors by name, without numpy: `shipbench models` loads nothing that computes."""

from __future__ import annotations

from ..registry import Registry

PREDICTORS = Registry(
    "predictor", "predictors", "PREDICTOR", helpers=frozenset({"base", "device", "registered", "training"}), lazy=True
)
