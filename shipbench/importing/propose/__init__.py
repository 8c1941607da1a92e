"""Draft of mapping.toml from the heads and cells of logs; every guess is marked in the file, for a person to check."""

from .proposal import write_proposal

__all__ = ["write_proposal"]
