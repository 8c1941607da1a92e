"""Term of the model: an effect that is part of it, or a candidate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..effects.base import Effect, Parameter
from ..ops import Array
from ..physics.actuators import Gear
from ..physics.modifiers import Flow, Modifiers
from ..ship import Particulars
from .thresholds import THRESHOLDS


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


class Given(Effect):
    """An effect of which some values are given; its parameters are the others, shapes included."""

    def __init__(self, effect: Effect, given: Sequence[float | None]) -> None:
        self.effect, self.given = effect, tuple(given)
        for key in ("name", "family", "traits", "moves_flow", "late"):
            setattr(self, key, getattr(effect, key))

    @property
    def enters(self) -> str:
        return self.effect.enters

    @property
    def parameters(self) -> tuple[Parameter, ...]:  # type: ignore[override]
        return self._open(self.effect.parameters)

    def sized(self, L: float) -> tuple[Parameter, ...]:
        return self._open(self.effect.sized(L))

    def _open(self, parameters: Sequence[Parameter]) -> tuple[Parameter, ...]:
        return tuple(p for p, value in zip(parameters, self.given, strict=True) if value is None)

    def values(self, q: Sequence[Array]) -> tuple[Array, ...]:
        """All values of the effect."""
        rest = iter(q)
        return tuple(next(rest) if value is None else value for value in self.given)

    def force(self, e: Modifiers, s: Flow, q: Sequence[Array], ship: Particulars) -> None:
        self.effect.force(e, s, self.values(q), ship)

    def gear(self, gears: dict[str, Gear], q: Sequence[Array]) -> None:
        self.effect.gear(gears, self.values(q))

    def measure(self, S: np.ndarray, q: Sequence[Array], dt: float) -> np.ndarray:
        return self.effect.measure(S, self.values(q), dt)
