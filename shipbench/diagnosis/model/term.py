"""Term of the model: an effect that is part of it, or a candidate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...effects.base import Effect
from ..thresholds import THRESHOLDS


@dataclass(frozen=True)
class Term:
    """Effect in the model: shape parameters fixed, one of `choices`; amplitudes free, one set or one per run; `since`:
    absent before that run."""

    effect: Effect
    setting: tuple[float, ...] = ()
    per_run: bool = False
    since: int | None = None
    choices: int = 1

    @property
    def size(self) -> int:
        """Number of free amplitudes."""
        return sum(not p.shape for p in self.effect.parameters)

    @property
    def label(self) -> str:
        return self.effect.name

    def cost(self, runs: int) -> float:
        """Twice the prior log odds against the term: choice of beginning or shape parameters, variances of values per
        run."""
        if self.since is not None:
            return 2.0 * float(np.log(runs))
        own = THRESHOLDS.value("values_per_run") + float(np.log(runs)) if self.per_run else 0.0
        return 2.0 * float(np.log(self.choices)) + own
