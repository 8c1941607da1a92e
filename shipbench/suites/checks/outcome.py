"""Outcome of one planted fault, or of one clean set."""

from __future__ import annotations

from dataclasses import dataclass

CLEAN_SEEDS = 10
"""Clean sets of each kind and ship, for every seed of the planted ones."""
OFFSET = 7000
"""Between development seeds and reported ones."""


@dataclass(frozen=True)
class Outcome:
    """found: a finding that the fault calls for. others: kinds of findings that it does not. healed: whether its lines,
    laid into dataset.toml, make a set that loads and in which a second check finds nothing (`after`: what it found);
    None where it has no line."""

    fault: str
    source: str
    seed: int
    found: bool
    others: tuple[str, ...]
    healed: bool | None
    after: tuple[str, ...] = ()
