"""An effect as a part of the model, or as a candidate for it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...effects.base import Effect

_PER_RUN = 14.0
"""A value for every run takes up so much of what single manoeuvres do beyond the model. (200 sets with nothing hidden, on development ships and
ships of the literature: before any cost one reaches 22 beyond what the form of its hull is allowed, the others at most 19; with the threshold 27
are asked.)"""


@dataclass(frozen=True)
class Term:
    """An effect in the model: shape parameters fixed, one of `choices`; amplitudes free, one set or one per run; `since`: absent before that run."""

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
        """Twice the log odds against it before any data: for the choice of a beginning or of shape parameters, for variances of values per run."""
        if self.since is not None:
            return 2.0 * float(np.log(runs))
        return 2.0 * float(np.log(self.choices)) + (_PER_RUN + float(np.log(runs)) if self.per_run else 0.0)
