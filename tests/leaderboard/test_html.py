"""HTML page of a leaderboard."""

from __future__ import annotations

import base64

from made_results import results

from shipbench.leaderboard.html import board_page
from shipbench.leaderboard.pages import build_board


def test_pictures_are_held_by_a_page_without_curves_alone(tmp_path):
    board = build_board(results({"m": [[1.0, 2.0]], "n": [[3.0, 4.0]]}), "toy")
    picture = tmp_path / "error-growth.png"
    picture.write_bytes(b"not a picture")
    held = base64.b64encode(b"not a picture").decode()
    page = board_page(board, "shipbench leaderboard x", [picture], None)
    assert held in page
    assert "error growth" in page
    assert "shipbench leaderboard x" in page
    assert held not in board_page(board, "shipbench leaderboard x", [], None)
    assert all(f'id="t{i}"' in page for i in range(len(board.tables)))
