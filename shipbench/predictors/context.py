"""Context of a prediction: what a model may know of the runs beside start, inputs and history, and never the truth."""

from __future__ import annotations

import inspect
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any

import numpy as np

from ..records import Dataset
from ..ship import Ship


@dataclass(frozen=True, eq=False)
class Context:
    """Context of the rows of a batch, for models whose `predict` (or function) has an argument named `context`.

    Args:
        ship: the vessel's particulars.
        dt: sample time [s].
        inputs: names of the columns of U: the four commands, then the environment channels.
        runs: id of the recorded run of each row, (batch,).
        start: time of s0 in that run, (batch,) [s].
        began: date and time at which that run began, or None, (batch,).
    """

    ship: Ship
    dt: float
    inputs: tuple[str, ...]
    runs: tuple[str, ...]
    start: np.ndarray
    began: tuple[datetime | None, ...]

    @classmethod
    def of(cls, data: Dataset, history: int = 0) -> Context:
        """Context of the batch that `data.batch(history)` stacks."""
        return cls(
            data.ship,
            data.dt,
            data.inputs,
            tuple(run.parent for run in data.runs),
            np.array([run.t[history] for run in data.runs]),
            tuple(run.began for run in data.runs),
        )

    def __len__(self) -> int:
        return len(self.runs)

    def rows(self, at: Sequence[int] | np.ndarray) -> Context:
        """Context of the rows `at`."""
        return replace(
            self,
            runs=tuple(self.runs[i] for i in at),
            start=self.start[np.asarray(at, dtype=int)],
            began=tuple(self.began[i] for i in at),
        )


def wants_context(function: Any) -> bool:
    """Whether a function asks for the context by an argument of that name."""
    try:
        return "context" in inspect.signature(function).parameters
    except (TypeError, ValueError):  # some builtins have no signature
        return False


def predicted(model: Any, s0: np.ndarray, U: np.ndarray, history: Any, context: Context | None) -> Any:
    """Result of `model.predict`, with the context where the model asks for it."""
    if context is not None and wants_context(model.predict):
        return model.predict(s0, U, history, context=context)
    return model.predict(s0, U, history)
