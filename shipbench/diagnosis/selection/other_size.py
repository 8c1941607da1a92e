"""Whether a similar ship of quite another size would explain the runs better than that of the ship file: a slip in it, or another ship's file."""

from __future__ import annotations

from collections.abc import Sequence

from ..budget import is_spent
from ..inference.baseline import first_evidence, null_fit
from ..inference.laplace import Fit
from ..model.linearisation import Scales

_FACTORS, _NEAR = (0.4, 2.5), (0.7, 0.85, 1.2, 1.4)
_PIECES = 99
"""Of a long record, spread over all runs: so few that none of them is left out of a fit as strange."""
_LEAST = 60.0
"""Log evidence over the ship of the file. (Right files: below -40 on MMG ships with a cause or none, -20 to 40 on ships of the literature and in
control engineers' models; files of ships of less than 0.6 or more than 1.7 times the length: up to 550, most of them above 60.)"""
_ESTIMATED = 3.0
"""So many times that where propeller or rudder are left to an estimate, which may suit one size better than another. (It rests on one ship: Mariner,
known by her main dimensions, 127. Six other ships had less than 60; what it costs with files of other ships so known was not measured.)"""
_WORTH_A_FIT = 0.0
"""The same after a first fit, with the noise of the ship of the file, in a fifth of the time. (126 files of other ships: what reaches `_LEAST` in the
end, where nothing else speaks against the file, has 17 and more.)"""
_ABOUT = 5.0
"""Log evidence by which a cause must beat a ship of nearly the same size, or she is spoken of (causes that come so near are called confused)."""


def better_size(null: Fit) -> list[str]:
    """A line if a smaller or a larger ship, with masses, inertia and forces of her size, is far better beside no cause; none if not. null: beside its
    own noise, as the other's is (beside the noise that suits a speed log 4.5 % off, the ship of the file was 4878 worse than one of 2.5 times her
    size, beside its own 128 better)."""
    factor, gain = _best(null, _FACTORS)
    if factor == 1.0 or gain < _LEAST * _times(null):
        return []
    return [f"a similar ship of {factor:g} times the size explains the runs better (by {gain:.0f} of log evidence)"]


def size_instead_of(causes: str, worth: float, null: Fit) -> list[str]:
    """A line if a ship of nearly the same size does about what `causes` do for that of the file, which add `worth` to the log evidence."""
    worth *= min(1.0, _PIECES / len(null.plant.seg.run))
    factor, gain = _best(null, _NEAR)
    if factor == 1.0 or gain < (worth - _ABOUT) * _times(null):
        return []
    return [f"a similar ship of {factor:g} times the size explains the runs about as well as {causes} (log evidence {gain:.0f}, against {worth:.0f})"]


def _best(null: Fit, factors: Sequence[float]) -> tuple[float, float]:
    """The best factor of the size, and the log evidence that it gains; 0 where none gains any."""
    if is_spent():
        return 1.0, 0.0
    few = null.plant.thinned(_PIECES)
    own = null if few is null.plant else null_fit(few, Scales(few))
    best, most = 1.0, 0.0
    for plant, factor in ((few.resized(factor), factor) for factor in factors):
        if is_spent() or first_evidence(plant, own) - own.evidence < _WORTH_A_FIT:
            continue
        gain = null_fit(plant, Scales(plant)).evidence - own.evidence
        if gain > most:
            best, most = factor, gain
    return (1.0, 0.0) if is_spent() else (best, most)  # fits that were stopped are not to be compared


def _times(null: Fit) -> float:
    return _ESTIMATED if any(null.plant.ship.lacks(part) for part in ("propeller", "rudder")) else 1.0
