"""A leaderboard in memory."""

from __future__ import annotations

import dataclasses

import pytest
from made_results import results

from shipbench.leaderboard.pages import build_board


def test_a_board_is_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        build_board(results({"m": [[1, 2]]}), "toy").dataset = "x"  # pyright: ignore[reportAttributeAccessIssue]
