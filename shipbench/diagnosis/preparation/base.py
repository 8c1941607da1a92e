"""Prepared runs: a data set as it is to be read, and what was found on the way to it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from ...checking.units import UnitFinding
from ...records import Dataset


@dataclass(frozen=True)
class LateVelocities:
    """Velocities that are late as a vector in the earth's axes. delay, sd [s]; filtered: by a filter of first order,
    else as they were; score: 2 log evidence of the plain model that mending the velocities adds; over_position: the
    same over moving the position instead."""

    delay: float
    sd: float
    filtered: bool
    score: float
    over_position: float


@dataclass(frozen=True)
class Prepared:
    """A data set as it is to be read.

    Attributes:
        dataset: the runs, corrected so far.
        notes: lines for the reader, in the order of the passes.
        excluded: effects of which the data are free, so that they are not looked for.
        errors: units, signs and frames that were corrected; each is a cause.
        late: velocities that were late and are corrected; a cause, too.
    """

    dataset: Dataset
    notes: tuple[str, ...] = ()
    excluded: tuple[str, ...] = ()
    errors: tuple[UnitFinding, ...] = ()
    late: LateVelocities | None = None

    def corrected(self, dataset: Dataset, *notes: str) -> Prepared:
        """Prepared data set with other runs, and lines that say what was corrected."""
        return replace(self, dataset=dataset, notes=(*self.notes, *notes))


Pass = Callable[[Prepared], Prepared]
"""One step of the preparation. A pass that finds nothing returns what it was given."""


def prepare(dataset: Dataset, passes: Iterable[Pass]) -> Prepared:
    """The data set after all passes.

    Raises:
        InputError: a pass refuses the runs.
    """
    prepared = Prepared(dataset)
    for apply in passes:
        prepared = apply(prepared)
    return prepared
