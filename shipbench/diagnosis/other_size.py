"""Whether a similar ship of quite another size would explain the runs better than that of the ship file: a slip in it, or another ship's file."""

from __future__ import annotations

from .model import Scales
from .plain import first_evidence, null_fit
from .settle import Fit

_FACTORS = (0.4, 2.5)
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


def better_size(null: Fit) -> list[str]:
    """A line if a smaller or a larger ship, with masses, inertia and forces of her size, is far better beside no cause; none if not."""
    few = null.plant.thinned(_PIECES)
    own = null if few is null.plant else null_fit(few, Scales(few))
    estimated = any(null.plant.ship.lacks(part) for part in ("propeller", "rudder"))
    best, most = 1.0, _LEAST * (_ESTIMATED if estimated else 1.0)
    for plant, factor in ((few.resized(factor), factor) for factor in _FACTORS):
        if first_evidence(plant, own) - own.evidence < _WORTH_A_FIT:
            continue
        gain = null_fit(plant, Scales(plant)).evidence - own.evidence
        if gain > most:
            best, most = factor, gain
    return [] if best == 1.0 else [f"a similar ship of {best:g} times the size explains the runs better (by {most:.0f} of log evidence)"]
