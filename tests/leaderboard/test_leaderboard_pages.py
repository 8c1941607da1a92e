"""Pages of a leaderboard: rows that are refused, and what a page says of its origin."""

from __future__ import annotations

from pathlib import Path

import pandas as pd
import pytest
from made_results import results

from shipbench.bench.results import PROTOCOL
from shipbench.bench.submissions import Results
from shipbench.errors import InputError
from shipbench.leaderboard.pages import build_board, write_boards


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"fingerprint": "f2"}, r"different data \(fingerprints\).*f1: a; f2: b"),
        ({"protocol": PROTOCOL + 1}, r"different protocol versions"),
        ({"task": "t2"}, r"different tasks"),
    ],
)
def test_rows_of_different_kind_are_never_mixed(changes, message):
    first, second = results({"a": [[1]]}), results({"b": [[2]]}, **changes)
    mixed = Results(pd.concat([first.rows, second.rows]), first.summaries + second.summaries, [Path()] * 2)
    with pytest.raises(InputError, match=message):
        build_board(mixed, "toy")


def test_rows_of_an_older_protocol_are_refused():
    with pytest.raises(InputError, match=r"protocol 0, this version ranks protocol"):
        build_board(results({"a": [[1]]}, protocol=0), "toy")


def test_a_page_is_written_per_data_set_with_what_made_it(tmp_path):
    one, two = results({"a": [[1, 2]]}, "one"), results({"a": [[1, 2]]}, "two")
    both = Results(pd.concat([one.rows, two.rows]), one.summaries + two.summaries, [Path()] * 2)
    written = write_boards(both, tmp_path, "shipbench leaderboard x", plots=False)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["one.md", "two.md"]
    text = written[0][1].read_text()
    for part in (
        "`f1`",
        f"protocol {PROTOCOL}",
        "2026-01-02",
        "`shipbench run -m x`",
        "`shipbench leaderboard x`",
        "source abc",
        "Note: depth unknown.",
    ):
        assert part in text
