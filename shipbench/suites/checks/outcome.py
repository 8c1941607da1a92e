"""Outcome of one planted fault, or of one clean set."""

from __future__ import annotations

from dataclasses import dataclass

CLEAN_SEEDS = 10
"""Number of clean sets of each kind and ship, for every seed of the planted ones."""
OFFSET = 7000
"""Offset between development seeds and reported ones."""


@dataclass(frozen=True)
class Outcome:
    """Outcome of a case. found: an expected finding; others: kinds of unexpected findings; healed: whether its lines,
    merged into dataset.toml, make a set that loads and in which a second check finds nothing (`after`: its findings);
    None where it has no line."""

    fault: str
    source: str
    seed: int
    found: bool
    others: tuple[str, ...]
    healed: bool | None
    after: tuple[str, ...] = ()
