"""Rows of a log as arrays, and streams of them with some rows of context before and after each row."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np

ROWS = 50_000
"""Rows of a log that are read at once."""


@dataclass(frozen=True)
class Block:
    """Rows of a log: times (n,) [s], values (n, channels) in standard units with NaN where there is none.

    `new` (n,) is true where the clock was set: nothing may join that row to the one before.
    """

    t: np.ndarray
    values: np.ndarray
    new: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        if len(self.new) != len(self.t):
            object.__setattr__(self, "new", np.zeros(len(self.t), bool))

    def rows(self, select: slice | np.ndarray) -> Block:
        """Block of some rows."""
        return Block(self.t[select], self.values[select], self.new[select])


def joined(blocks: list[Block]) -> Block:
    """Rows of all blocks as one block."""
    if len(blocks) == 1:
        return blocks[0]
    return Block(*(np.concatenate([getattr(b, name) for b in blocks]) for name in ("t", "values", "new")))


def with_context(blocks: Iterable[Block], rows: int) -> Iterator[tuple[Block, int, int]]:
    """Triples (block, begin, end): every row stands once in [begin, end), with up to `rows` rows before and after it in
    the block."""
    held: Block | None = None
    begin = 0
    for block in blocks:
        if len(block.t) == 0:
            continue
        held = block if held is None else joined([held, block])
        end = len(held.t) - rows
        if end > begin:
            yield held, begin, end
            cut = max(end - rows, 0)
            held, begin = held.rows(slice(cut, None)), end - cut
    if held is not None:
        yield held, begin, len(held.t)
