"""Predictors by name, without numpy: `shipbench models` loads nothing that computes."""

from __future__ import annotations

from ..registry import Registry

PREDICTORS = Registry(
    "predictor",
    "predictors",
    "PREDICTOR",
    lazy=True,
    helpers=frozenset({"base", "context", "device", "own_simulator", "registered", "training"}),
)
