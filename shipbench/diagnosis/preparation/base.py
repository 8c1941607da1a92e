"""Prepared runs: a corrected data set, and the findings on the way to it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from ...checking.units import UnitFinding
from ...records import Dataset


@dataclass(frozen=True)
class LateVelocities:
    """Velocities that are late as a vector in the earth's axes. delay, sd [s]; filtered: by a filter of first order,
    else a pure delay; score: twice the log Bayes factor of the baseline model for the correction of the velocities;
    over_position: the same against a shift of the position instead."""

    delay: float
    sd: float
    filtered: bool
    score: float
    over_position: float


@dataclass(frozen=True)
class Prepared:
    """Data set after preparation.

    Attributes:
        dataset: the runs, corrected so far.
        notes: lines for the reader, in the order of the passes.
        excluded: effects of which the data are free; they are not searched.
        errors: units, signs and frames that were corrected; each is a cause.
        late: velocities that were late and are corrected; a cause, too.
    """

    dataset: Dataset
    notes: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    errors: tuple[UnitFinding, ...] = ()
    late: LateVelocities | None = None

    def corrected(self, dataset: Dataset, *notes: str) -> Prepared:
        """Prepared data set with other runs, and lines on the correction."""
        return replace(self, dataset=dataset, notes=(*self.notes, *notes))


Pass = Callable[[Prepared], Prepared]
"""Step of the preparation. A pass without findings returns its argument."""


def prepare(dataset: Dataset, passes: Iterable[Pass]) -> Prepared:
    """Prepared data set after all passes.

    Raises:
        InputError: a pass refuses the runs.
    """
    prepared = Prepared(dataset)
    for apply in passes:
        prepared = apply(prepared)
    return prepared
