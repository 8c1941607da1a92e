"""Thresholds of decisions: each with its unit, its meaning, and the place of its evidence."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Threshold:
    """Number that decides. `evidence` is a heading of docs/calibration.md, as in a link: `evidence-asked`."""

    name: str
    value: float
    unit: str
    meaning: str
    evidence: str


class Thresholds:
    """Thresholds of a package; an unknown name, or one that stands twice, is an error of the code."""

    def __init__(self, *rows: Threshold) -> None:
        self.rows = {row.name: row for row in rows}
        assert len(self.rows) == len(rows), "a name stands twice"

    def value(self, name: str) -> float:
        """The number of that name, in its unit."""
        return self.rows[name].value

    def count(self, name: str) -> int:
        """The whole number of that name."""
        number = int(self.rows[name].value)
        assert number == self.rows[name].value, f"{name} is no whole number"
        return number
