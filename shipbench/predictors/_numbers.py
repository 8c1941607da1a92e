"""Bounds of the numbers that a model spec sets: beyond them a model takes all memory, or does not finish."""

from __future__ import annotations

from typing import Any

WIDTH, LAYERS, ROUNDS = (1, 10_000), (1, 100), (1, 1_000_000)
"""Neurons of a layer, layers, and epochs, minibatches or patience."""
RATE, WEIGHT = (0.0, 100.0), (0.0, 1e6)
"""Step sizes of an optimiser, and weights of a term of the loss."""


def check_numbers(model: Any, bounds: dict[str, tuple[float, float]]) -> None:
    """Raise ValueError where a field of `model` is no number within its bounds; whole numbers where both bounds are
    whole."""
    for key, (low, high) in bounds.items():
        value, whole = getattr(model, key), isinstance(low, int)
        if isinstance(value, bool) or not isinstance(value, int if whole else (int, float)) or not low <= value <= high:
            raise ValueError(
                f"{key} = {value!r}; accepted: {low:g} or more, at most {high:g}{', a whole number' if whole else ''}"
            )
