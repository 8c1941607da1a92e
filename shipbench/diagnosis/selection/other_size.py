"""Test whether a similar ship of quite another size would explain the runs better than that of the ship file: an error
in it, or another ship's file."""

from __future__ import annotations

from collections.abc import Sequence

from ...estimation.baseline import first_evidence, null_fit
from ...estimation.budget import is_spent
from ...estimation.laplace import Fit
from ...estimation.linearisation import Scales
from ..thresholds import THRESHOLDS

_FACTORS, _NEAR = (0.4, 2.5), (0.7, 0.85, 1.2, 1.4)
"""Sizes that are tried, relative to the ship file: of another ship, and of nearly the same."""


_FEW = THRESHOLDS.count("segments_per_outlier") - 1
"""Pieces of a long record by which sizes are compared: so few that no fit leaves one out as an outlier."""


def better_size(null: Fit) -> list[str]:
    """Line if a smaller or a larger ship, with masses, inertia and forces of her size, has far more evidence beside no
    cause; None if not. null: with its own noise model, as the other's is (docs/calibration.md#another-size)."""
    factor, gain = _best(null, _FACTORS)
    if factor == 1.0 or gain < 0.5 * THRESHOLDS.value("evidence_of_another_model") * _times(null):
        return []
    return [f"a similar ship of {factor:g} times the size fits the runs better (log Bayes factor {gain:.0f})"]


def size_instead_of(causes: str, worth: float, null: Fit) -> list[str]:
    """Line if a ship of nearly the same size has about the evidence of `causes` with the ship file, whose log Bayes
    factor is `worth`."""
    worth *= min(1.0, _FEW / len(null.plant.seg.run))
    factor, gain = _best(null, _NEAR)
    if factor == 1.0 or gain < (worth - 0.5 * THRESHOLDS.value("evidence")) * _times(null):
        return []
    return [
        (
            f"a similar ship of {factor:g} times the size fits the runs about as well as {causes} (log Bayes factor "
            f"{gain:.0f}, against {worth:.0f})"
        )
    ]


def _best(null: Fit, factors: Sequence[float]) -> tuple[float, float]:
    """Best factor of the size, and its gain of log evidence; 0 where none gains any."""
    if is_spent():
        return 1.0, 0.0
    few = null.plant.thinned(_FEW)
    own = null if few is null.plant else null_fit(few, Scales(few))
    best, most = 1.0, 0.0
    for plant, factor in ((few.resized(factor), factor) for factor in factors):
        if is_spent() or first_evidence(plant, own) < own.evidence:
            continue
        gain = null_fit(plant, Scales(plant)).evidence - own.evidence
        if gain > most:
            best, most = factor, gain
    return (1.0, 0.0) if is_spent() else (best, most)  # fits that were stopped are not to be compared


def _times(null: Fit) -> float:
    estimated = any(null.plant.ship.lacks(part) for part in ("propeller", "rudder"))
    return THRESHOLDS.value("other_size_estimated") if estimated else 1.0
