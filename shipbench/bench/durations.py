"""Durations in words, and the remaining time of a study."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping


def duration(seconds: float) -> str:
    """Text of a duration: 42 s, 3 min 05 s, 1 h 12 min."""
    whole = round(seconds)
    if whole < 60:
        return f"{whole} s"
    return (
        f"{whole // 60} min {whole % 60:02d} s" if whole < 3600 else f"{whole // 3600} h {whole % 3600 // 60:02d} min"
    )


class Remaining:
    """Remaining time of pieces of work of several kinds.

    A piece costs the mean cost of the finished ones of its kind; without one, that of all finished pieces. Parallel
    pieces, and the work between them, count by the ratio of the elapsed time to the finished cost.

    Args:
        todo: number of pieces of each kind.
    """

    def __init__(self, todo: Mapping[str, int]) -> None:
        self.todo = Counter(todo)
        self.costs: dict[str, list[float]] = defaultdict(list)

    def done(self, kind: str, cost: float) -> None:
        """Count a finished piece; `cost` [s] is 0 for one that was finished before."""
        self.todo[kind] -= 1
        if cost > 0.0:
            self.costs[kind].append(cost)

    def seconds(self, elapsed: float) -> float | None:
        """Remaining time [s] after `elapsed` seconds; None before any piece with a cost is finished."""
        known = [cost for costs in self.costs.values() for cost in costs]
        if not known:
            return None
        mean = sum(known) / len(known)
        cost_left = sum(
            n * (sum(own) / len(own) if (own := self.costs.get(kind)) else mean) for kind, n in self.todo.items()
        )
        return elapsed * cost_left / sum(known)
