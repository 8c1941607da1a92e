"""Mean error of every model in the slices of the truth."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..bench.regimes import slices
from ..storage import Frame


@dataclass(frozen=True)
class Regime:
    """Mean ED [m] of every model in the slices of one regime; `counts` are windows, a value is NaN where a model has no
    score."""

    name: str
    labels: tuple[str, ...]
    counts: tuple[int, ...]
    values: dict[str, tuple[float, ...]]


def regime_errors(rows: Frame, windows: Frame | None, models: Sequence[str]) -> list[Regime]:
    """Errors in every regime in which the windows differ. rows: of one data set; windows: `Results.windows` of it."""
    if windows is None:
        return []
    scored = rows[rows["status"] == "ok"]
    means: dict[str, list[tuple[str, int, Any]]] = {}
    for part in slices(windows):
        inside = scored[scored["run"].isin(windows.loc[part.members, "run"])]
        label, count = part.label.removeprefix(f"{part.regime} "), int(part.members.sum())
        means.setdefault(part.regime, []).append((label, count, inside.groupby("model")["ed"].mean()))
    return [
        Regime(
            name, tuple(label for label, _, _ in found), tuple(count for _, count, _ in found),
            {m: tuple(float(mean.get(m, np.nan)) for _, _, mean in found) for m in models},
        )
        for name, found in means.items()
    ]  # fmt: skip
